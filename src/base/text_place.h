// Places in texts, for errors.
#pragma once

#include <string>
#include <string_view>

namespace tessera {

// Returns the line and column of the last of the first `bytes` bytes, such as "line 3, column 14". A character of UTF-8
// is one column.
std::string placeInText(std::string_view text, size_t bytes);

}  // namespace tessera
