// Settings as plain structs. A struct lists its fields once; that list is the flag, the default, the help text, the
// `--set` key and the line in config.toml.
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

// A number that is found out where none is given: `auto` as text.
using NumberOrAuto = std::optional<double>;

using ConfigValue = std::variant<bool, int, int64_t, double, NumberOrAuto, std::string>;

struct ConfigField {
  std::string_view name;  // snake_case
  std::string_view help;
  std::variant<bool*, int*, int64_t*, double*, NumberOrAuto*, std::string*> value;
  ConfigBounds bounds = {};
  std::optional<ConfigValue> ownDefault = {};  // where it is not that of the struct that declares the setting

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

// Throws Error naming the first setting that is out of its bounds, of those whose bounds depend on no other setting
// before those whose do.
void requireWithinBounds(const std::vector<ConfigField>& fields);

// key=value. Throws Error naming the key (with the nearest known one) or the value that does not parse.
void setConfigField(const std::vector<ConfigField>& fields, std::string_view assignment);

// Flat TOML in the order of the fields, each line with its help as a comment.
std::string configToToml(const std::vector<ConfigField>& fields);

// Reads keys that are fields; unknown keys and wrong types are Errors naming `path` and the line.
void configFromToml(const std::vector<ConfigField>& fields, const fs::path& path);

std::string configValueText(const ConfigField& field);

}  // namespace tessera
