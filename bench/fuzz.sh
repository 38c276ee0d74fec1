#!/usr/bin/env bash
# Runs every decoder of untrusted bytes under libFuzzer with ASan and UBSan, ten minutes each; fails at the first finding.
#   bench/fuzz.sh [SECONDS]
set -euo pipefail
source "$(dirname "$0")/setup.sh"
tests/fuzz/run.sh "${1:-600}" | tee "$out/fuzz.txt"
