// A setting in one statement: a member of a struct with its default, and the key, the help text and the bounds of its
// ConfigField.
//
//   struct RaySettings {
//     SETTING(int, firstRays, 512, "first_rays", "rays of the first step", within(1, mostRays).dependent());
//   };
//
// declares `int firstRays = 512` and `ConfigField firstRaysSetting()`. The bounds are a ConfigBounds, without its name.
// Whoever has settings, of its own and of such structs that it inherits from, lists them in the order of config.toml
// (`fields()`), and says there what differs: `firstRaysSetting().byDefault(1024).within(16, mostRays)`. Its constructor
// calls setOwnDefaults(fields()).
#pragma once

#include "base/config.h"

#define SETTING(type, member, standard, key, help, ...)           \
  ConfigField member##Setting() {                                 \
    return {key, help, &(member), ConfigBounds::__VA_ARGS__, {}}; \
  }                                                               \
  type member = standard
