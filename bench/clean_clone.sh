#!/usr/bin/env bash
# Times ./test.sh in a fresh clone of HEAD without a compiler cache, including package installation and the build: at most 20
# minutes on 2 cores. Prints how long each part took. Real photographs are found through TESSERA_SHARED_DATA, as always.
#   bench/clean_clone.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
rm -rf "$out/clone"
git clone --quiet . "$out/clone"
export CCACHE_DISABLE=1
log=$PWD/$out/clean_clone.txt
started=$(date +%s)
(cd "$out/clone" && ./test.sh 2>&1) | while IFS= read -r line; do echo "$(($(date +%s) - started)) $line"; done > "$log" ||
  { tail -n 40 "$log" >&2; die "the tests did not pass"; }
seconds=$(($(date +%s) - started))
reached() { awk -v what="$1" 'index($0, what) { print $1; exit }' "$log"; }
built=$(reached 'Test project') tested=$(reached 'Total Test time')
echo "packages and build $built s, C++ tests $((tested - built)) s, the viewer's build and tests $((seconds - tested)) s"
verdict "./test.sh in a clean clone, seconds" "$seconds" '<=' 1200
finish
