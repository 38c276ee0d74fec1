// Settings as plain structs. A struct lists its fields once; that list is the flag, the default, the help text, the
// `--set` key and the line in config.toml.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/file.h"

namespace tessera {

// A number that is found out where none is given: `auto` as text.
using NumberOrAuto = std::optional<double>;

struct ConfigField {
  std::string_view name;  // snake_case
  std::string_view help;
  std::variant<bool*, int*, int64_t*, double*, NumberOrAuto*, std::string*> value;

  bool isAuto() const;
};

// key=value. Throws Error naming the key (with the nearest known one) or the value that does not parse.
void setConfigField(const std::vector<ConfigField>& fields, std::string_view assignment);

// Flat TOML in the order of the fields, each line with its help as a comment.
std::string configToToml(const std::vector<ConfigField>& fields);

// Reads keys that are fields; unknown keys and wrong types are Errors naming `path` and the line.
void configFromToml(const std::vector<ConfigField>& fields, const fs::path& path);

std::string configValueText(const ConfigField& field);

}  // namespace tessera
