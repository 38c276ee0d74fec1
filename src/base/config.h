// Settings are plain structs. A struct lists its fields once; from that list come the flag, the default, the help text,
// the `--set` key and the line in config.toml.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/check.h"
#include "base/config_bounds.h"
#include "base/file.h"

namespace tessera {

// A number, or nothing where the program chooses the value itself, which is written as `auto`.
using NumberOrAuto = std::optional<double>;

using ConfigValue = std::variant<bool, int, int64_t, double, NumberOrAuto, std::string>;

struct ConfigField {
  std::string_view name;  // snake_case
  std::string_view help;
  std::variant<bool*, int*, int64_t*, double*, NumberOrAuto*, std::string*> value;
  ConfigBounds bounds = {};
  std::optional<ConfigValue> ownDefault = {};  // set where it differs from the default of the declaring struct

  bool isAuto() const;
  bool isSameTypeAs(const ConfigField& other) const { return value.index() == other.value.index(); }

  ConfigField within(double low, double high) && {
    bounds.low = low;
    bounds.high = high;
    return std::move(*this);
  }
  template <class T>
  ConfigField byDefault(T standard) && {
    std::visit(
        [&](const auto* member) {
          using Member = std::remove_const_t<std::remove_pointer_t<decltype(member)>>;
          if constexpr (std::is_convertible_v<T, Member>) ownDefault = static_cast<Member>(standard);
        },
        value);
    CHECK(ownDefault.has_value());
    return std::move(*this);
  }
};

// Writes each field's own default into its member.
void setOwnDefaults(const std::vector<ConfigField>& fields);

// Throws Error naming the first setting that is out of its bounds. Settings whose bounds depend on other settings are
// checked after all those whose bounds do not.
void requireWithinBounds(const std::vector<ConfigField>& fields);

// Sets one field from the text key=value. Throws Error naming an unknown key, together with the nearest known one, or
// a value that does not parse.
void setConfigField(const std::vector<ConfigField>& fields, std::string_view assignment);

// Returns flat TOML with the settings in the order of the fields, each line with its help text as a comment.
std::string configToToml(const std::vector<ConfigField>& fields);

// Reads the settings of a TOML file into the fields. Throws Error naming `path` and the line for unknown keys and wrong
// types.
void configFromToml(const std::vector<ConfigField>& fields, const fs::path& path);

std::string configValueText(const ConfigField& field);

}  // namespace tessera
