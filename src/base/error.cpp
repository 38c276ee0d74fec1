#include "base/error.h"

#include <utility>

namespace tessera {
namespace {

std::string sentence(const std::string& what, const std::string& where, const std::string& why,
                     const std::string& remedy) {
  std::string text = what;
  if (!where.empty()) text += ": " + where;
  text += ": " + why;
  if (!remedy.empty()) text += "; " + remedy;
  for (char& c : text) {
    if (c == '\n' || c == '\r') c = ' ';  // one line, whatever a file name or a library put into it
  }
  return text;
}

}  // namespace

Error::Error(std::string what, std::string where, std::string why, std::string remedy)
    : std::runtime_error(sentence(what, where, why, remedy)),
      subject_(std::move(what)),
      place_(std::move(where)),
      reason_(std::move(why)),
      remedy_(std::move(remedy)) {}

}  // namespace tessera
