// Helpers for writing HTML.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace tessera {

// Escapes text for use between tags and inside quoted attributes. Control characters become spaces, and bytes that are
// not UTF-8, as names of files may have, U+FFFD.
std::string escapedHtml(std::string_view text);
std::string base64(std::span<const std::byte> bytes);

}  // namespace tessera
