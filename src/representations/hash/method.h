// The method `hash`, for the table of methods (representations/methods.h).
#pragma once

#include "train/method.h"

namespace tessera {

const Method& hashMethod();

}  // namespace tessera
