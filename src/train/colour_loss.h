// The colour loss that `--set loss=...` names.
#pragma once

#include <string>

#include "base/error.h"
#include "compute/losses.h"

namespace tessera {

// Throws Error if no colour loss has that name.
inline ColourLossKind colourLossKind(const std::string& name) {
  if (name == "mse") return ColourLossKind::mse;
  if (name == "huber") return ColourLossKind::huber;
  if (name == "charbonnier") return ColourLossKind::charbonnier;
  throw Error("--set loss=" + name, "", "there is no such colour loss", "use huber, mse or charbonnier");
}

}  // namespace tessera
