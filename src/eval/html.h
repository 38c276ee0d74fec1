// The little HTML that a report needs.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace tessera {

// Safe as text and inside a quoted attribute. Control characters become spaces.
std::string escapedHtml(std::string_view text);
std::string base64(std::span<const std::byte> bytes);

}  // namespace tessera
