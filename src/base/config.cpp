#include "base/config.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <numeric>

#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

#include "base/error.h"

namespace tessera {
namespace {

size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i + 1;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t next = std::min({row[j] + 1, row[j + 1] + 1, diagonal + (a[i] != b[j])});
      diagonal = row[j + 1];
      row[j + 1] = next;
    }
  }
  return row.back();
}

const ConfigField* find(const std::vector<ConfigField>& fields, std::string_view name) {
  for (const ConfigField& field : fields) {
    if (field.name == name) return &field;
  }
  return nullptr;
}

std::string nearest(const std::vector<ConfigField>& fields, std::string_view name) {
  const auto best = std::min_element(fields.begin(), fields.end(), [&](const ConfigField& a, const ConfigField& b) {
    return editDistance(a.name, name) < editDistance(b.name, name);
  });
  return best == fields.end() ? std::string() : std::string(best->name);
}

constexpr std::string_view kAuto = "auto";

template <class T>
bool parseNumber(std::string_view text, T* value) {
  T parsed{};
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), parsed);
  if (status != std::errc() || end != text.data() + text.size()) return false;
  *value = parsed;
  return true;
}

bool assign(const ConfigField& field, std::string_view text) {
  if (const auto* flag = std::get_if<bool*>(&field.value)) {
    if (text != "true" && text != "false") return false;
    **flag = text == "true";
    return true;
  }
  if (const auto* number = std::get_if<int*>(&field.value)) return parseNumber(text, *number);
  if (const auto* number = std::get_if<int64_t*>(&field.value)) return parseNumber(text, *number);
  if (const auto* number = std::get_if<double*>(&field.value)) return parseNumber(text, *number);
  if (const auto* number = std::get_if<NumberOrAuto*>(&field.value)) {
    double parsed = 0;
    if (text == kAuto) {
      (*number)->reset();
      return true;
    }
    if (!parseNumber(text, &parsed)) return false;
    **number = parsed;
    return true;
  }
  **std::get_if<std::string*>(&field.value) = std::string(text);
  return true;
}

const char* typeName(const ConfigField& field) {
  constexpr const char* kNames[] = {"true or false", "a whole number",   "a whole number",
                                    "a number",      "a number or auto", "text"};
  return kNames[field.value.index()];
}

}  // namespace

void setConfigField(const std::vector<ConfigField>& fields, std::string_view assignment) {
  const size_t equals = assignment.find('=');
  const std::string name(assignment.substr(0, equals));
  const ConfigField* field = find(fields, name);
  if (field == nullptr) {
    throw Error("--set " + std::string(assignment), "", "there is no setting '" + name + "'",
                "did you mean '" + nearest(fields, name) + "'?");
  }
  if (equals == std::string_view::npos || !assign(*field, assignment.substr(equals + 1))) {
    throw Error("--set " + std::string(assignment), "", name + " wants " + typeName(*field),
                "write " + name + "=VALUE");
  }
}

namespace {

std::string textOf(bool value) {
  return value ? "true" : "false";
}
std::string textOf(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}
std::string textOf(const NumberOrAuto& value) {
  return value ? textOf(*value) : std::string(kAuto);
}
std::string textOf(const std::string& value) {
  return value;
}
template <class T>
std::string textOf(T whole) {
  return fmt::format("{}", whole);
}

}  // namespace

bool ConfigField::isAuto() const {
  const auto* number = std::get_if<NumberOrAuto*>(&value);
  return number != nullptr && !(*number)->has_value();
}

std::string configValueText(const ConfigField& field) {
  return std::visit([](const auto* value) { return textOf(*value); }, field.value);
}

std::string configToToml(const std::vector<ConfigField>& fields) {
  std::string text;
  for (const ConfigField& field : fields) {
    std::string value = configValueText(field);
    if (std::holds_alternative<std::string*>(field.value) || field.isAuto()) {
      std::ostringstream quoted;
      quoted << toml::value<std::string>(value);
      value = quoted.str();
    }
    text += fmt::format("{} = {}  # {}\n", field.name, value, field.help);
  }
  return text;
}

void configFromToml(const std::vector<ConfigField>& fields, const fs::path& path) {
  const std::string text = readTextFile(path);
  toml::table table;
  try {
    table = toml::parse(text, path.string());
  } catch (const toml::parse_error& error) {
    throw Error(path.string(), fmt::format("line {}", error.source().begin.line), std::string(error.description()),
                "correct the file");
  }
  for (const auto& [key, node] : table) {
    const std::string place = fmt::format("line {}", node.source().begin.line);
    const ConfigField* field = find(fields, key.str());
    if (field == nullptr) {
      throw Error(path.string(), place, fmt::format("there is no setting '{}'", key.str()),
                  "did you mean '" + nearest(fields, key.str()) + "'?");
    }
    const bool read = std::visit(
        [&node = node](auto* value) {
          using T = std::remove_pointer_t<decltype(value)>;
          if (node.is_boolean() != std::is_same_v<T, bool>) return false;  // toml++ would take one for the other
          if constexpr (std::is_same_v<T, NumberOrAuto>) {
            *value = node.template value<double>();
            return value->has_value() || node.template value<std::string>() == kAuto;
          } else {
            const auto found = node.template value<T>();
            if (found) *value = *found;
            return found.has_value();
          }
        },
        field->value);
    if (!read) {
      throw Error(path.string(), place, fmt::format("{} wants {}", key.str(), typeName(*field)), "correct the value");
    }
  }
}

}  // namespace tessera
