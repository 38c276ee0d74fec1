#!/usr/bin/env bash
# Builds and runs every test, C++ and web. Tests of real photographs skip by name unless TESSERA_SHARED_DATA names their
# folder.
#   ./test.sh [PRESET]      release (default), dev, asan or tsan
set -euo pipefail
cd "$(dirname "$0")"
preset=${1:-release}
tools/install-debian-packages.sh --browser --colmap
tools/build.sh "$preset"
ctest --preset "$preset" --parallel "$(nproc)" --output-on-failure
tools/build-web.sh
export TESSERA=$PWD/build/$preset/apps/tessera/tessera
(cd web && xvfb-run -a -s "-screen 0 1280x1024x24 -noreset" npm test --silent)
