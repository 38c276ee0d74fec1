#include "base/error.h"

#include <fmt/format.h>

#include <utility>

namespace tessera {
namespace {

// Returns the text, in UTF-8, as one line without control characters that a terminal would interpret. File names,
// libraries and file contents may have put them there.
std::string shown(const std::string& text) {
  std::string shown;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if (byte == '\n' || byte == '\r') {
      shown += ' ';
    } else if (byte < 0x20 || byte == 0x7f) {
      shown += fmt::format("\\x{:02x}", byte);
    } else if (byte == 0xc2 && next >= 0x80 && next < 0xa0) {  // the control characters of Latin-1
      shown += fmt::format("\\u{:04x}", next);
      ++i;
    } else {
      shown += text[i];
    }
  }
  return shown;
}

std::string sentence(const std::string& what, const std::string& where, const std::string& why,
                     const std::string& remedy) {
  std::string text = what;
  if (!where.empty()) text += ": " + where;
  text += ": " + why;
  if (!remedy.empty()) text += "; " + remedy;
  return shown(text);
}

}  // namespace

Error::Error(std::string what, std::string where, std::string why, std::string remedy)
    : std::runtime_error(sentence(what, where, why, remedy)),
      subject_(std::move(what)),
      place_(std::move(where)),
      reason_(std::move(why)),
      remedy_(std::move(remedy)) {}

}  // namespace tessera
