#include "base/config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <numeric>

#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

#include "base/error.h"
#include "base/former_settings.h"

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

// Returns the remedy for an unknown setting `name`: its current name, or the nearest one.
std::string remedyForUnknown(const std::vector<ConfigField>& fields, std::string_view name) {
  const std::string_view now = currentSettingName(name);
  if (find(fields, now) != nullptr) return fmt::format("its name is '{}' now", now);
  return "did you mean '" + nearest(fields, name) + "'?";
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

void setOwnDefaults(const std::vector<ConfigField>& fields) {
  for (const ConfigField& field : fields) {
    if (!field.ownDefault) continue;
    std::visit([&](auto* member) { *member = std::get<std::remove_pointer_t<decltype(member)>>(*field.ownDefault); },
               field.value);
  }
}

void setConfigField(const std::vector<ConfigField>& fields, std::string_view assignment) {
  const size_t equals = assignment.find('=');
  const std::string name(assignment.substr(0, equals));
  const ConfigField* field = find(fields, name);
  if (field == nullptr) {
    throw Error("--set " + std::string(assignment), "", "there is no setting '" + name + "'",
                remedyForUnknown(fields, name));
  }
  if (equals == std::string_view::npos || !assign(*field, assignment.substr(equals + 1))) {
    throw Error("--set " + std::string(assignment), "", name + " requires " + typeName(*field),
                "write " + name + "=VALUE");
  }
}

namespace {

std::string formatValue(bool value) {
  return value ? "true" : "false";
}
std::string formatValue(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}
std::string formatValue(const NumberOrAuto& value) {
  return value ? formatValue(*value) : std::string(kAuto);
}
std::string formatValue(const std::string& value) {
  return value;
}
template <class T>
std::string formatValue(T whole) {
  return fmt::format("{}", whole);
}

}  // namespace

bool ConfigField::isAuto() const {
  const auto* number = std::get_if<NumberOrAuto*>(&value);
  return number != nullptr && !(*number)->has_value();
}

std::string configValueText(const ConfigField& field) {
  return std::visit([](const auto* value) { return formatValue(*value); }, field.value);
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
                  remedyForUnknown(fields, key.str()));
    }
    const bool read = std::visit(
        [&node = node](auto* value) {
          using T = std::remove_pointer_t<decltype(value)>;
          if (node.is_boolean() != std::is_same_v<T, bool>) return false;  // toml++ converts between the two
          if constexpr (std::is_same_v<T, NumberOrAuto>) {
            *value = node.template value<double>();
            return value->has_value() || node.template value<std::string>() == kAuto;
          } else {
            const auto parsed = node.template value<T>();
            if (parsed) *value = *parsed;
            return parsed.has_value();
          }
        },
        field->value);
    if (!read) {
      throw Error(path.string(), place, fmt::format("{} requires {}", key.str(), typeName(*field)),
                  "correct the value");
    }
  }
}

namespace {

void requireWithin(std::string_view name, double value, const ConfigBounds& bounds) {
  if (bounds.isBounded && !(value >= bounds.low && value <= bounds.high)) {
    throw Error(fmt::format("--set {}={}", name, value), "", "is out of range",
                fmt::format("use {} from {} to {}", name, bounds.low, bounds.high));
  }
}

void requireAllowedValue(std::string_view name, int value, const ConfigBounds& bounds) {
  if (!bounds.sizes.empty() && std::find(bounds.sizes.begin(), bounds.sizes.end(), value) == bounds.sizes.end()) {
    throw Error(fmt::format("--set {}={}", name, value), "", "is not one of the allowed sizes",
                fmt::format("use one of {}", fmt::join(bounds.sizes, ", ")));
  }
  if (value % bounds.divisor != 0) {
    throw Error(fmt::format("--set {}={}", name, value), "", fmt::format("is not a multiple of {}", bounds.divisor),
                fmt::format("use {}={}", name, (value + bounds.rounding) / bounds.divisor * bounds.divisor));
  }
}

void requireAllowedValue(std::string_view name, const std::string& value,
                         const std::vector<std::string_view>& choices) {
  if (choices.empty() || std::find(choices.begin(), choices.end(), value) != choices.end()) return;
  throw Error(fmt::format("--set {}={}", name, value), "", "is not one of the allowed values",
              fmt::format("use one of: {}", fmt::join(choices, ", ")));
}

void requireWithinBounds(const ConfigField& field) {
  const ConfigBounds& bounds = field.bounds;
  if (const auto* number = std::get_if<int*>(&field.value)) {
    requireWithin(field.name, **number, bounds);
    requireAllowedValue(field.name, **number, bounds);
  } else if (const auto* large = std::get_if<int64_t*>(&field.value)) {
    requireWithin(field.name, static_cast<double>(**large), bounds);
  } else if (const auto* real = std::get_if<double*>(&field.value)) {
    requireWithin(field.name, **real, bounds);
  } else if (const auto* optional = std::get_if<NumberOrAuto*>(&field.value)) {
    if (**optional) requireWithin(field.name, ***optional, bounds);
  } else if (const auto* text = std::get_if<std::string*>(&field.value)) {
    requireAllowedValue(field.name, **text, bounds.choices);
  }
}

}  // namespace

void requireWithinBounds(const std::vector<ConfigField>& fields) {
  for (const bool dependent : {false, true}) {
    for (const ConfigField& field : fields) {
      if (field.bounds.isDependent == dependent) requireWithinBounds(field);
    }
  }
}

}  // namespace tessera
