#!/usr/bin/env bash
# On a machine with a graphics card: which card, the device tests on it (a missing driver fails them), and the rates of
# the operations that the Vulkan device has.
#   [BUILD=build/release] bench/gpu.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
build=${BUILD:-build/release}
{
  vulkaninfo --summary 2> /dev/null | grep -E 'deviceName|driverName|driverInfo|apiVersion' || die "vulkaninfo: no Vulkan device"
  for test in "$build"/src/gpu/tessera_gpu_test "$build"/src/compute/tessera_devices_test \
    "$build"/src/compute/vulkan/tessera_compute_vulkan_test; do
    [ -x "$test" ] || die "$test: not built; configure with TESSERA_VULKAN=ON and TESSERA_TESTS=ON"
    TESSERA_REQUIRE_VULKAN=1 "$test" --gtest_brief=1 | tail -n 3 | sed "s|^|$(basename "$test"): |"
  done
  "$tessera" bench compute --device vulkan --json "$out/gpu.json"
} | tee "$out/gpu.txt"
