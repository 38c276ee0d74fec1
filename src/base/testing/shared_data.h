// For tests: photographs and weights that are not part of the project, in the folder that TESSERA_SHARED_DATA names.
// Tests are skipped without them, or fail with TESSERA_REQUIRE_DATA=1 in the environment (CI).
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "base/file.h"

namespace tessera {

// Returns the path of a folder of the shared data, whether or not it exists.
inline fs::path sharedData(const std::string& name) {
  const char* root = std::getenv("TESSERA_SHARED_DATA");
  return (root != nullptr ? fs::path(root) : fs::path("TESSERA_SHARED_DATA")) / name;
}

inline bool sharedDataIsRequired() {
  const char* value = std::getenv("TESSERA_REQUIRE_DATA");
  return value != nullptr && std::string(value) == "1";
}

#define SKIP_WITHOUT_SHARED_DATA(name)                                                             \
  if (!fs::is_directory(sharedData(name))) {                                                       \
    ASSERT_FALSE(sharedDataIsRequired()) << sharedData(name) << " is missing, but it is required"; \
    GTEST_SKIP() << sharedData(name) << " is missing";                                             \
  }

}  // namespace tessera
