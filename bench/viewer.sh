#!/usr/bin/env bash
# The viewer in Debian's Chromium with Mesa's OpenGL on the CPU: ten held-out views of a city of 2x2 blocks against the renderer on
# the CPU; a city of 4x4 blocks until its first image, and in a flight of 600 steps with a quarter of the finest level's memory.
# Uses the scenes that volume.sh (ROWS=city) and levels.sh leave in build/bench.
#   bench/viewer.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
export SMALL_SCENE=$PWD/$out/volume/city-scene SMALL_CAPTURE=$PWD/$out/volume/city LARGE_SCENE=$PWD/$out/levels/scene
TESSERA=$(realpath "$tessera")
export TESSERA
for folder in "$SMALL_SCENE" "$LARGE_SCENE"; do
  [ -e "$folder/tileset.json" ] || die "$folder: no scene; run bench/volume.sh (ROWS=city) and bench/levels.sh"
done
FINEST_BYTES=$("$tessera" info "$LARGE_SCENE" --json | jq .level_0.bytes_in_memory)
export FINEST_BYTES
tools/install-debian-packages.sh --browser
tools/build-web.sh
cd web && xvfb-run -a -s "-screen 0 1280x1024x24 -noreset" npx vitest run bench/viewer.ts --config vitest.bench.config.ts --disable-console-intercept 2>&1 |
  tee "../$out/viewer.txt"
