// Errors for contents that readers would reject and that settings of the training can cause. Writers of all
// representations throw them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "base/error.h"
#include "tiles/content.h"

namespace tessera {

Error contentTooLarge(const std::string& why, const std::string& remedy);
// Throws contentTooLarge if there are more parts, or bytes of memory, than readers accept.
void requireContentWithin(const ContentLimits& limits, size_t parts, uint64_t bytes, const std::string& remedy);
// Throws contentTooLarge if the file is larger than readers accept.
void requireFileWithin(const ContentLimits& limits, uint64_t bytes, const std::string& remedy);

}  // namespace tessera
