#!/usr/bin/env bash
# How many of a build's objects are recompiled when an operation's header changes: those that include it, directly or not, according
# to the compiler. A new operation in a header of its own costs its users, the devices' tables and the op test. Measured in the
# preset dev, which compiles each source separately; in release up to eight are joined, and a header costs whole groups.
#   bench/rebuild_cost.sh [BUILD_FOLDER [HEADER...]]     default: build/dev, which is built in full; all operations
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:-build/dev}
shift $(($# > 0 ? 1 : 0))
headers=("$@")
if [ ${#headers[@]} -eq 0 ]; then
  mapfile -t headers < <(grep -l '^TESSERA_OPERATION(' src/compute/*.h)
  headers+=(src/compute/operations.h src/compute/device.h)
fi
ninja -C "$build" -t deps | awk -v headers="${headers[*]}" '
  /^[^ ].*: #deps/ { isObject = $1 ~ /\.o:$/; objects += isObject; next }
  isObject && NF == 1 { name = $1; sub(/^.*\/src\/compute\//, "src/compute/", name); ++users[name] }
  END {
    count = split(headers, names, " ")
    for (i = 1; i <= count; ++i) printf "%-32s %4d of %d objects\n", names[i], users[names[i]], objects
  }'
