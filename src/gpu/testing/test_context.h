// For tests: opens a context, or skips the test if the machine has no Vulkan loader or no driver. With
// TESSERA_REQUIRE_VULKAN=1 in the environment (CI), that is a failure instead.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "base/error.h"
#include "gpu/context.h"

namespace tessera {

inline bool vulkanIsRequired() {
  const char* value = std::getenv("TESSERA_REQUIRE_VULKAN");
  return value != nullptr && std::string(value) == "1";
}

// Returns null if there is no loader or no driver. Throws any other failure.
inline std::shared_ptr<GpuContext> openForTest(const GpuOptions& options = {}) {
  try {
    return GpuContext::open(options);
  } catch (const Error& error) {
    const bool isThere =
        error.reason() != "no Vulkan driver is installed" && error.reason() != "no Vulkan loader is installed";
    if (vulkanIsRequired() || isThere) throw;
    return nullptr;
  }
}

#define SKIP_WITHOUT_VULKAN(context) \
  if (!(context)) GTEST_SKIP() << "no Vulkan driver is installed (mesa-vulkan-drivers has one for the CPU)"

}  // namespace tessera
