#include "world/world_text.h"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace tessera {
namespace {

// Returns the value of a digit of base64, or -1.
int decodeDigit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

// Returns the scheme of an address; empty if it has none. Drives of Windows are none.
std::string_view schemeIn(std::string_view address) {
  if (address.empty() || std::isalpha(static_cast<unsigned char>(address[0])) == 0) return {};
  size_t end = 0;
  while (end < address.size() && (std::isalnum(static_cast<unsigned char>(address[end])) != 0 || address[end] == '+' ||
                                  address[end] == '-' || address[end] == '.')) {
    ++end;
  }
  return end > 1 && end < address.size() && address[end] == ':' ? address.substr(0, end) : std::string_view();
}

}  // namespace

bool isOfNetwork(std::string_view address) {
  return !schemeIn(address).empty() || address.starts_with("//") || address.starts_with("\\\\");
}

bool hasOtherScheme(std::string_view address) {
  std::string scheme(schemeIn(address));
  for (char& c : scheme) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return !scheme.empty() && scheme != "http" && scheme != "https";
}

size_t countCharacters(std::string_view text) {
  size_t count = 0;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    count += (byte & 0xc0) == 0x80 ? 0 : byte >= 0xf0 ? 2 : 1;  // the first byte of a character tells how many units
  }
  return count;
}

std::string_view trimmed(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\n\r"), last = text.find_last_not_of(" \t\n\r");
  return first == std::string_view::npos ? std::string_view() : text.substr(first, last + 1 - first);
}

std::string decodePercent(std::string_view text) {
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    unsigned byte = 0;
    if (text[i] == '%' && i + 2 < text.size()) {
      const char* digits = text.data() + i + 1;
      if (const auto [end, error] = std::from_chars(digits, digits + 2, byte, 16);
          error == std::errc() && end == digits + 2 && byte != 0) {
        plain += static_cast<char>(byte);
        i += 2;
        continue;
      }
    }
    plain += text[i];
  }
  return plain;
}

std::optional<Bytes> decodeBase64(std::string_view text) {
  Bytes bytes;
  bytes.reserve(text.size() / 4 * 3 + 3);
  uint32_t bits = 0;
  size_t digits = 0, padding = 0;
  for (const char c : text) {
    if (std::isspace(static_cast<unsigned char>(c)) != 0) continue;
    if (c == '=') {
      if (++padding > 2) return std::nullopt;
      continue;
    }
    const int digit = decodeDigit(c);
    if (digit < 0 || padding > 0) return std::nullopt;
    bits = bits << 6 | static_cast<uint32_t>(digit);
    if (++digits % 4 != 0) continue;
    for (int shift = 16; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::byte>(bits >> shift & 255));
  }
  const size_t rest = digits % 4;
  if (rest == 1 || (padding > 0 && (rest + padding) % 4 != 0)) return std::nullopt;
  if (rest >= 2) bytes.push_back(static_cast<std::byte>((rest == 2 ? bits >> 4 : bits >> 10) & 255));
  if (rest == 3) bytes.push_back(static_cast<std::byte>(bits >> 2 & 255));
  return bytes;
}

bool isDataUri(std::string_view address) {
  const std::string_view scheme = "data:";
  return address.size() >= scheme.size() &&
         std::equal(scheme.begin(), scheme.end(), address.begin(),
                    [](char a, char b) { return a == std::tolower(static_cast<unsigned char>(b)); });
}

std::optional<Bytes> decodeDataUri(std::string_view address) {
  const std::string_view base64 = ";base64";
  const size_t comma = address.find(',');
  if (!isDataUri(address) || comma == std::string_view::npos) return std::nullopt;
  if (!address.substr(0, comma).ends_with(base64)) return std::nullopt;
  return decodeBase64(address.substr(comma + 1));
}

}  // namespace tessera
