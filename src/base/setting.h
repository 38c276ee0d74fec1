// SETTING declares a setting in one statement: the member of a struct with its default, and the key, the help text and
// the bounds of its ConfigField.
//
//   struct RaySettings {
//     SETTING(int, firstRays, 512, "first_rays", "rays of the first step", within(1, maxRays).dependent());
//   };
//
// declares `int firstRays = 512` and `ConfigField firstRaysSetting()`. The bounds are an expression of ConfigBounds
// without its `ConfigBounds::` prefix. A struct with settings, its own and inherited ones, lists them in the order of
// config.toml (`fields()`), and overrides there what differs from the inherited declaration:
// `firstRaysSetting().byDefault(1024).within(16, maxRays)`. Its constructor calls setOwnDefaults(fields()).
#pragma once

#include "base/config.h"

#define SETTING(type, member, standard, key, help, ...)           \
  ConfigField member##Setting() {                                 \
    return {key, help, &(member), ConfigBounds::__VA_ARGS__, {}}; \
  }                                                               \
  type member = standard
