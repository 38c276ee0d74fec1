// For tests: finds the representations that a source file names, in C++, GLSL or TypeScript. Comments and ordinary
// words do not count.
#pragma once

#include <algorithm>
#include <cctype>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "representations/list.h"

namespace tessera {

// Names that are also ordinary parts of identifiers (ConfigField, SurfaceMesh): of these only string literals and paths
// count.
inline constexpr std::string_view kOrdinaryNames[] = {"field", "mesh"};

// The other names of the list, of which identifiers count too (VolumeContent, decodeHash).
inline const std::vector<std::string_view>& distinctNames() {
#define TESSERA_NAME(name, Name) #name,
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> all = {TESSERA_REPRESENTATIONS(TESSERA_NAME, TESSERA_NAME)};
    for (const std::string_view ordinary : kOrdinaryNames) std::erase(all, ordinary);
    return all;
  }();
#undef TESSERA_NAME
  return names;
}

// Words in identifiers and file names that mean something else.
inline constexpr std::string_view kHomonyms[] = {
    "hash grid",      // the encoding of positions, an operation that several representations use
    "lattice hash",   // of a point of that grid
    "hash of",        // of bytes
    "hash settings",  // in the browser's address, behind its #
    "light volume",   // of the synthetic city: how much light reaches a place
};

// Returns "hash grid level" for HashGridLevel, hash_grid_level, kHashGridLevel or hash-grid-level.h.
inline std::string splitWords(std::string_view name) {
  std::string words;
  for (size_t i = 0; i < name.size(); ++i) {
    const auto is = [&](size_t at, int (*kind)(int)) {
      return at < name.size() && kind(static_cast<unsigned char>(name[at])) != 0;
    };
    if (!is(i, std::isalnum)) {
      if (!words.empty() && words.back() != ' ') words += ' ';
      continue;
    }
    const bool begins = is(i, std::isupper) && i > 0 && (!is(i - 1, std::isupper) || is(i + 1, std::islower));
    if (begins && !words.empty() && words.back() != ' ') words += ' ';
    words += static_cast<char>(std::tolower(static_cast<unsigned char>(name[i])));
  }
  return words;
}

// Returns whether `text` contains `letters` (lower case), ignoring the case of `text`.
inline bool hasLetters(std::string_view text, std::string_view letters) {
  const auto same = [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; };
  return std::search(text.begin(), text.end(), letters.begin(), letters.end(), same) != text.end();
}

inline bool hasWords(const std::string& words, std::string_view phrase) {
  return (" " + words + " ").find(" " + std::string(phrase) + " ") != std::string::npos;
}

class NamedRepresentations {
 public:
  explicit NamedRepresentations(std::string_view source) : source_(source) {
    while (at_ < source_.size()) read();
  }
  const std::set<std::string>& names() const { return names_; }

 private:
  void read() {
    const char c = source_[at_];
    if (source_.substr(at_, 2) == "//") {
      at_ = std::min(source_.find('\n', at_), source_.size());
    } else if (source_.substr(at_, 2) == "/*") {
      const size_t end = source_.find("*/", at_ + 2);
      at_ = end == std::string_view::npos ? source_.size() : end + 2;
    } else if (std::isdigit(static_cast<unsigned char>(c)) != 0) {  // also 1'000
      while (at_ < source_.size() && (isOfName(source_[at_]) || source_[at_] == '\'')) ++at_;
    } else if (c == '"' || c == '\'' || c == '`') {
      text(c);
    } else if (isOfName(c)) {
      const size_t begin = at_;
      while (at_ < source_.size() && isOfName(source_[at_])) ++at_;
      identifier(source_.substr(begin, at_ - begin));
    } else {
      ++at_;
    }
  }

  static bool isOfName(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

  void text(char quote) {
    const size_t begin = ++at_;
    while (at_ < source_.size() && source_[at_] != quote && (quote == '`' || source_[at_] != '\n')) {
      at_ += source_[at_] == '\\' ? 2 : 1;
    }
    at_ = std::min(at_, source_.size());
    const std::string_view content = source_.substr(begin, at_ - begin);
    ++at_;
    const bool isPath = content.find('/') != std::string_view::npos && content.find(' ') == std::string_view::npos;
    const auto names = [&](std::string_view name) {
      return content == name || contains(content, "--method " + std::string(name)) ||
             contains(content, "representations/" + std::string(name));
    };
    for (const std::string_view name : kOrdinaryNames) {
      if (names(name)) names_.emplace(name);
    }
    for (const std::string_view name : distinctNames()) {
      if (names(name) || (isPath && containsWord(content, name))) names_.emplace(name);
    }
  }

  void identifier(std::string_view identifier) {
    for (const std::string_view name : distinctNames()) {
      if (identifier != name && containsWord(identifier, name)) names_.emplace(name);
    }
  }

  static bool contains(std::string_view text, const std::string& part) {
    return text.find(part) != std::string_view::npos;
  }
  // Returns whether a name is a word of an identifier or path and not part of a homonym.
  static bool containsWord(std::string_view identifier, std::string_view name) {
    if (!hasLetters(identifier, name)) return false;
    const std::string words = splitWords(identifier);
    return hasWords(words, name) && std::none_of(std::begin(kHomonyms), std::end(kHomonyms),
                                                 [&](std::string_view other) { return hasWords(words, other); });
  }

  std::string_view source_;
  size_t at_ = 0;
  std::set<std::string> names_;
};

}  // namespace tessera
