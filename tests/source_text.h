// For tests: what a source file of C++, GLSL or TypeScript says outside its comments, strings and include lines.
#pragma once

#include <algorithm>
#include <cctype>
#include <string>
#include <string_view>

namespace tessera {

inline bool isIdentifierCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}

// The source with comments, strings and include lines replaced by spaces; line breaks stay. Code inside the `${...}` of
// a TypeScript template is kept.
class CodeOfSource {
 public:
  explicit CodeOfSource(std::string_view source, bool hasTemplates) : source_(source), hasTemplates_(hasTemplates) {
    readCode(false);
  }
  const std::string& text() const { return text_; }

 private:
  // Up to the end, or up to the bracket that closes an expression of a template.
  void readCode(bool isExpression) {
    int depth = 0;
    while (at_ < source_.size()) {
      const char c = source_[at_];
      if (isExpression && c == '}' && depth-- == 0) return;
      if (isExpression && c == '{') ++depth;
      if (source_.substr(at_, 2) == "//") {
        blankTo(source_.find('\n', at_));
      } else if (source_.substr(at_, 2) == "/*") {
        blankPast("*/", at_ + 2);
      } else if (c == '#' && source_.substr(at_, 8) == "#include") {
        blankTo(source_.find('\n', at_));
      } else if (source_.substr(at_, 2) == "R\"" && !followsIdentifier()) {
        const size_t open = std::min(source_.find('(', at_), source_.size());
        blankPast(")" + std::string(source_.substr(at_ + 2, open - at_ - 2)) + "\"", open);
      } else if (c == '"' || (c == '\'' && !followsIdentifier())) {
        readString(c);
      } else if (c == '`' && hasTemplates_) {
        readTemplate();
      } else {
        text_ += c;
        ++at_;
      }
    }
  }

  void readString(char quote) {
    size_t end = at_ + 1;
    while (end < source_.size() && source_[end] != quote && source_[end] != '\n') end += source_[end] == '\\' ? 2 : 1;
    blankTo(end + 1);
  }

  void readTemplate() {
    blankTo(at_ + 1);
    while (at_ < source_.size() && source_[at_] != '`') {
      if (source_.substr(at_, 2) == "${") {
        blankTo(at_ + 2);
        readCode(true);
        blankTo(at_ + 1);
      } else {
        blankTo(at_ + (source_[at_] == '\\' ? 2 : 1));
      }
    }
    blankTo(at_ + 1);
  }

  // A digit separator or the suffix of a name, not the beginning of a character or of a raw string.
  bool followsIdentifier() const { return at_ > 0 && isIdentifierCharacter(source_[at_ - 1]); }
  void blankPast(std::string_view end, size_t from) {
    const size_t match = source_.find(end, from);
    blankTo(match == std::string_view::npos ? match : match + end.size());
  }
  void blankTo(size_t end) {
    for (end = std::min(end, source_.size()); at_ < end; ++at_) text_ += source_[at_] == '\n' ? '\n' : ' ';
  }

  std::string_view source_;
  bool hasTemplates_;
  size_t at_ = 0;
  std::string text_;
};

}  // namespace tessera
