#!/usr/bin/env bash
# The training step beside the same step from libtorch's CPU operations (Debian: libtorch-dev, libopenblas0-pthread), both with two
# threads; fails below a ratio of 8. OpenBLAS is tried both with OPENBLAS_CORETYPE and with its own choice, and the best of all of
# libtorch's variants counts.
#   [SECONDS_EACH=4] bench/libtorch_step.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
build=build/bench-torch
cmake --preset release -B "$build" -DTESSERA_BENCH_LIBTORCH=ON -DTESSERA_TESTS=OFF -DTESSERA_VULKAN=OFF > /dev/null
cmake --build "$build" --target libtorch_step
seconds=${SECONDS_EACH:-4}
{
  alone "$build/bench/libtorch_step" "$seconds"
  if [ -n "${OPENBLAS_CORETYPE:-}" ]; then (unset OPENBLAS_CORETYPE; alone "$build/bench/libtorch_step" "$seconds"); fi
} | tee "$out/libtorch_step.txt"
alone "$tessera" bench train --threads 2 --seconds "$seconds" --json "$out/libtorch_step_ours.json" | tee -a "$out/libtorch_step.txt"
ours=$(jq .samples_per_second "$out/libtorch_step_ours.json")
theirs=$(awk '/^samples_per_second/ { if ($2 > best) best = $2 } END { print best }' "$out/libtorch_step.txt")
verdict "training step, times as fast as libtorch" "$(awk -v a="$ours" -v b="$theirs" 'BEGIN { printf "%.1f", a / b }')" '>=' 8 |
  tee -a "$out/libtorch_step.txt"
[ "$(awk -v a="$ours" -v b="$theirs" 'BEGIN { print (a >= 8 * b) }')" = 1 ] || exit 1
