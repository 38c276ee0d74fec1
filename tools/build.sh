#!/usr/bin/env bash
# Configures and builds a preset:   tools/build.sh PRESET [TARGET ...]
set -euo pipefail
cd "$(dirname "$0")/.."
preset=${1:?usage: tools/build.sh PRESET [TARGET ...]}
shift
export CMAKE_CXX_COMPILER_LAUNCHER=ccache
# Otherwise ccache caches no source with precompiled headers, which the tests use.
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros}
cmake --preset "$preset" --log-level=WARNING >/dev/null
cmake --build --preset "$preset" ${1:+--target "$@"}
