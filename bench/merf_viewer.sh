#!/usr/bin/env bash
# Compares frames of our viewer with those of MERF's own, both in Debian's Chromium with Mesa's OpenGL on the CPU: one block of a
# city is trained, baked and exported for it, and rendered from twenty pinhole cameras at 480x270. Resumable, as volume.sh is;
# images of both are in build/bench/merf_viewer/pictures. MERF_VIEWER is the folder merf/webviewer of google-research, with the
# downloads in third_party that its README lists.
#   MERF_VIEWER=DIR [MINUTES=10] bench/merf_viewer.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
: "${MERF_VIEWER:?names no folder; it must be merf/webviewer of https://github.com/google-research/google-research}"
MERF_VIEWER=$(realpath "$MERF_VIEWER")
for file in index.html fragment.glsl; do
  [ -e "$MERF_VIEWER/$file" ] || die "$MERF_VIEWER: has no $file; it must be merf/webviewer of google-research"
done
for file in three.js OrbitControls.js PointerLockControls.js zlib.js png.js stats.min.js; do
  [ -e "$MERF_VIEWER/third_party/$file" ] || die "$MERF_VIEWER/third_party: has no $file; merf/README.md says from where"
done
export MERF_VIEWER
work=$out/merf_viewer
minutes=${MINUTES:-10}
settings "MINUTES=$minutes"
[ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
trained model city --method volume --blocks 1x1 --set background_block=border --minutes "$minutes"
baked model scene city
MERF_NEAR=$("$tessera" export "$work/scene" "$work/export" --format merf --json | jq .near)
TESSERA=$(realpath "$tessera")
export MERF_NEAR TESSERA MERF_WORK=$PWD/$work
tools/install-debian-packages.sh --browser
tools/build-web.sh
cd web && xvfb-run -a -s "-screen 0 1280x1024x24 -noreset" npx vitest run bench/merf.ts --config vitest.bench.config.ts --disable-console-intercept 2>&1 |
  tee "../$out/merf_viewer.txt"
