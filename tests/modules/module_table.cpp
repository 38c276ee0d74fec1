#include "modules/module_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <regex>
#include <set>
#include <sstream>

#include "base/error.h"

namespace tessera {
namespace {

std::vector<std::string> split(const std::string& text, const std::regex& separator) {
  const std::sregex_token_iterator begin(text.begin(), text.end(), separator, -1), end;
  return {begin, end};
}

// Splits a list at commas and "and", and strips quotes and spaces; "—" is the empty list.
std::vector<std::string> splitList(const std::string& text) {
  static const std::regex separator(R"(,|\band\b)"), around(R"([\s`]+)");
  std::vector<std::string> words;
  for (const std::string& part : split(text, separator)) {
    std::string word = std::regex_replace(part, around, "");
    if (!word.empty() && word != "—") words.push_back(std::move(word));
  }
  return words;
}

std::vector<std::string> linesOfTable(std::string_view markdown) {
  std::istringstream in{std::string(markdown)};
  std::vector<std::string> lines;
  bool isBelowHeading = false;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#")) isBelowHeading = line.find("bottom to top") != std::string::npos;
    if (isBelowHeading && line.starts_with("|")) {
      lines.push_back(line);
    } else if (!lines.empty()) {
      break;
    }
  }
  return lines;
}

std::vector<std::string> splitPath(const std::string& path) {
  std::vector<std::string> parts;
  std::istringstream in(path);
  for (std::string part; std::getline(in, part, '/');) parts.push_back(part);
  return parts;
}

bool isPlaceholder(const std::string& part) {
  return part.starts_with("<") && part.ends_with(">");
}

// Returns the values of the placeholders of `folder` if it contains `file`; otherwise nothing.
std::optional<std::map<std::string, std::string>> match(const std::string& folder, const std::string& file) {
  const std::vector<std::string> parts = splitPath(folder), path = splitPath(file);
  if (path.size() <= parts.size()) return std::nullopt;  // the last part is the file itself
  std::map<std::string, std::string> names;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (isPlaceholder(parts[i])) {
      if (names.try_emplace(parts[i], path[i]).first->second != path[i]) return std::nullopt;
    } else if (parts[i] != path[i]) {
      return std::nullopt;
    }
  }
  return names;
}

std::string withNames(std::string text, const std::map<std::string, std::string>& names) {
  for (const auto& [placeholder, name] : names) {
    for (size_t at; (at = text.find(placeholder)) != std::string::npos;) text.replace(at, placeholder.size(), name);
  }
  return text;
}

Error wrong(const std::string& where, const std::string& why) {
  return {"ARCHITECTURE.md", where, why, "mend its table of modules"};
}

ModuleRow rowOfCells(const std::string& folder, const std::string& mayUse) {
  static const std::regex clauseEnd(";"), also(R"(\balso\b)");
  ModuleRow row = {folder, {}, {}};
  bool isFirst = true;
  for (const std::string& clause : split(mayUse, clauseEnd)) {
    const std::vector<std::string> sides = split(clause, also);
    if (isFirst) {
      row.uses = splitList(clause);
    } else if (sides.size() == 2) {
      for (const std::string& path : splitList(sides[0])) row.also.push_back({path, splitList(sides[1])});
    } else {
      throw wrong(folder, "\"" + clause + "\" does not say who also may use what");
    }
    isFirst = false;
  }
  return row;
}

}  // namespace

ModuleTable ModuleTable::parse(std::string_view markdown) {
  ModuleTable table;
  const std::vector<std::string> lines = linesOfTable(markdown);
  static const std::regex bar(R"(\s*\|\s*)");
  for (size_t i = 2; i < lines.size(); ++i) {                     // skips the titles and the separator
    const std::vector<std::string> cells = split(lines[i], bar);  // the first cell is the text before the first bar
    if (cells.size() < 3) throw wrong(lines[i], "has no second column");
    for (const std::string& folder : splitList(cells[1])) table.rows_.push_back(rowOfCells(folder, cells[2]));
  }
  if (table.rows_.empty()) throw wrong("", "has no table of modules, \"bottom to top\"");

  std::set<std::string> known = {"all"};
  for (const ModuleRow& row : table.rows_) {
    if (!known.insert(row.folder).second) throw wrong(row.folder, "has two rows");
  }
  for (const ModuleRow& row : table.rows_) {
    std::vector<std::string> uses = row.uses;
    for (const ModuleRow::Also& also : row.also) uses.insert(uses.end(), also.uses.begin(), also.uses.end());
    for (const std::string& one : uses) {
      if (!one.ends_with(".h") && !known.contains(one)) {
        throw wrong(row.folder, "may use \"" + one + "\", which no row is");
      }
    }
  }
  return table;
}

const ModuleRow* ModuleTable::findRow(const std::string& file, Names& names) const {
  const ModuleRow* best = nullptr;
  const auto rank = [](const ModuleRow& row) {
    const auto slashes = std::count(row.folder.begin(), row.folder.end(), '/');
    const auto placeholders = std::count(row.folder.begin(), row.folder.end(), '<');
    return std::pair(slashes, -placeholders);
  };
  for (const ModuleRow& row : rows_) {
    const std::optional<Names> matched = match(row.folder, file);
    if (!matched || (best != nullptr && rank(row) <= rank(*best))) continue;
    best = &row;
    names = *matched;
  }
  return best;
}

std::string ModuleTable::findModule(const std::string& file) const {
  Names names;
  const ModuleRow* row = findRow(file, names);
  return row == nullptr ? std::string() : withNames(row->folder, names);
}

std::vector<std::string> ModuleTable::allowedIncludes(const std::string& file) const {
  Names names;
  const ModuleRow* row = findRow(file, names);
  if (row == nullptr) return {};
  std::vector<std::string> uses;
  for (const std::string& one : row->uses) uses.push_back(withNames(one, names));
  for (const ModuleRow::Also& also : row->also) {
    const std::string path = withNames(row->folder, names) + "/" + also.path;
    if (path.ends_with("/") ? !file.starts_with(path) : file != path) continue;
    for (const std::string& one : also.uses) uses.push_back(withNames(one, names));
  }
  return uses;
}

std::string ModuleTable::validationError(const std::string& file, const std::string& header) const {
  const std::string module = findModule(file), other = findModule(header);
  if (module.empty()) return fmt::format("{} belongs to no module", file);
  if (other.empty()) return fmt::format("{} belongs to no module", header);
  if (module == other) return {};
  const std::vector<std::string> uses = allowedIncludes(file);
  for (const std::string& one : uses) {
    if (one == other || one == header || (one == "all" && !other.starts_with("apps/"))) return {};
  }
  return fmt::format("{} may use {}, not {}", module,
                     uses.empty() ? "nothing" : fmt::format("{}", fmt::join(uses, ", ")), other);
}

}  // namespace tessera
