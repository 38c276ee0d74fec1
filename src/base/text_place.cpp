#include "base/text_place.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

namespace tessera {

std::string placeInText(std::string_view text, size_t bytes) {
  const std::string_view before = text.substr(0, bytes > 0 ? bytes - 1 : 0);
  const std::string_view line = before.substr(before.rfind('\n') + 1);  // the whole text where there is none
  const auto continues = [](char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; };
  return fmt::format("line {}, column {}", std::count(before.begin(), before.end(), '\n') + 1,
                     std::count_if(line.begin(), line.end(), std::not_fn(continues)) + 1);
}

}  // namespace tessera
