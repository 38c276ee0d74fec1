#!/usr/bin/env bash
# Runs the whole test suite under AddressSanitizer with UBSan, and under ThreadSanitizer.
#   bench/sanitizers.sh [PRESET ...]     default: asan tsan
set -euo pipefail
source "$(dirname "$0")/setup.sh"
[ $# -gt 0 ] || set -- asan tsan
: > "$out/sanitizers.txt"
for preset in "$@"; do
  cmake --preset "$preset" > /dev/null
  cmake --build --preset "$preset"
  status=0
  ctest --preset "$preset" --parallel "$(nproc)" > "$out/$preset.log" 2>&1 || status=$?
  echo "$preset: $(grep -E 'tests passed|No tests' "$out/$preset.log" || echo 'did not run'), log $out/$preset.log" |
    tee -a "$out/sanitizers.txt"
  [ "$status" -eq 0 ] || { tail -n 40 "$out/$preset.log" >&2; exit "$status"; }
done
