#!/usr/bin/env bash
# What a graphics card can do with tessera: run.sh of the bundle that bench/gpu.sh packs. Needs the card's driver and
# nothing else. Writes gpu.json, and what was said into gpu.txt.
#   ./run.sh [OUT]        default: the folder that this lies in
#   DEVICE=vulkan:1       another device than the best (bin/tessera info devices)
#   FOX=DIR               a capture of the fox photographs, for the row of 60 s
#   GLIBC=packed          the bundle's glibc, which is otherwise used where the machine's is too old
#   SECONDS_OF_TRAINING=60 SIZE=1920x1080 SAMPLES=65536 STREAMED=1048576 VALUES=1
#   LENGTH="--steps 3" VOLUME="--set most_rays=128" HASH=... FIELD=...    instead of the seconds; more of train's flags
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
out=$(mkdir -p "${1:-$here}" && cd "${1:-$here}" && pwd)
device=${DEVICE:-vulkan} seconds=${SECONDS_OF_TRAINING:-60} size=${SIZE:-1920x1080}
work=$(mktemp -d) && trap 'rm -rf "$work"' EXIT

# The machine's own glibc and C++ library where they are new enough: its driver may need those very ones. Other programs
# of the machine see none of the bundle's.
given=${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
start() { # PROGRAM ARGUMENT...
  local program=$here/bin/$1
  shift
  case $libraries in
    machine) LD_LIBRARY_PATH=$here/lib$given "$program" "$@" ;;
    c++) LD_LIBRARY_PATH=$here/lib-c++:$here/lib$given "$program" "$@" ;;
    packed) "$here/lib-c/ld-linux-x86-64.so.2" --library-path "$here/lib-c:$here/lib-c++:$here/lib$given" "$program" "$@" ;;
  esac
}
tessera() { start tessera "$@"; }
[ "${GLIBC:-}" = packed ] && choices=packed || choices="machine c++ packed"
for libraries in $choices; do tessera --version > /dev/null 2>&1 && break; done
tessera --version > /dev/null || { echo "run.sh: the programs do not start here" >&2; exit 1; }

# Whether there is a card, and not only a driver for the processor.
card() {
  tessera info devices 2> /dev/null | awk '/^vulkan:[0-9]/ { next_is = 1 }
    /^  name/ { if (next_is && !/llvmpipe|SwiftShader/) found = 1; next_is = 0 } END { exit !found }'
}
# NVIDIA's driver in a container often comes without the file that names it.
if ! card && [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]; then
  for library in libGLX_nvidia.so.0 libEGL_nvidia.so.0; do
    printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "%s", "api_version": "1.2.0"}}\n' "$library" > "$work/icd.json"
    export VK_DRIVER_FILES=$work/icd.json VK_ICD_FILENAMES=$work/icd.json
    card && break
    unset VK_DRIVER_FILES VK_ICD_FILENAMES
  done
fi

# What is known so far, so that nothing is lost where this is stopped.
write() {
  local i
  {
    echo "{"
    for i in "${!members[@]}"; do printf '  %s%s\n' "${members[$i]}" "$([ "$i" -lt $((${#members[@]} - 1)) ] && echo ,)"; done
    echo "}"
  } > "$out/gpu.json.part" && mv "$out/gpu.json.part" "$out/gpu.json"
}
# json NAME FILE: one more member of gpu.json; of a file that is not there, null.
members=()
json() { members+=("\"$1\": $(if [ -s "$2" ]; then cat "$2"; else echo null; fi)"); }
number() { members+=("\"$1\": ${2:-null}"); }
quoted() { printf '"%s"' "$(printf '%s' "$1" | tr -d '\000-\037' | sed 's/[\\"]/\\&/g')"; }
# psnr FILE: of `eval --json`.
psnr() { sed -n 's/^ *"psnr": *\([0-9.]*\).*/\1/p' "$1" 2> /dev/null | head -1; }
step() { write; echo "== $*"; }
case $device in vulkan:*) export TESSERA_GPU=${device#vulkan:} ;; esac  # of the tests
declare -A more=([volume]=${VOLUME:-} [hash]=${HASH:-} [field]=${FIELD:-})

{
  tessera info devices
  card || echo "NO CARD: what follows is of a driver for the processor"
  members+=("\"is_card\": $(card && echo true || echo false)")
  members+=("\"libraries\": $(quoted "$libraries")")
  members+=("\"commit\": $(quoted "$(cat "$here/commit")")" "\"machine\": $(quoted "$(uname -srm)")"
    "\"processor\": $(quoted "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1)")"
    "\"devices\": $(quoted "$(tessera info devices | sed -n 's/^  name *//p' | paste -sd';')")")

  if [ "${VALUES:-1}" = 1 ]; then
    step "every operation against the reference"
    TESSERA_REQUIRE_VULKAN=1 start tessera_devices_test --gtest_brief=1 --gtest_filter='*vulkan*' > "$work/values.txt" 2>&1
    number values_status $?
    grep -E '^\[  (PASSED|FAILED)' "$work/values.txt"
    number values_passed "$(sed -n 's/^\[  PASSED  \] \([0-9]*\) test.*/\1/p' "$work/values.txt" | head -1)"
    members+=("\"values_failed\": [$(sed -n 's/^\[  FAILED  \] \([^ ,]*\).*/"\1"/p' "$work/values.txt" | sort -u | paste -sd, -)]")
    cp "$work/values.txt" "$out/values.txt"
  fi

  step "rates beside the card's own limits"
  tessera bench compute --device "$device" --samples "${SAMPLES:-65536}" --streamed "${STREAMED:-1048576}" --json "$work/compute.json"
  json compute "$work/compute.json"
  step "a training step"
  tessera bench train --device "$device" --samples "${SAMPLES:-65536}" --json "$work/step.json"
  json step "$work/step.json"

  length=${LENGTH:---minutes $(awk -v s="$seconds" 'BEGIN { print s / 60 }')}
  members+=("\"length\": $(quoted "$length")")
  for method in volume hash; do
    step "a city of 2x2 blocks, $method, $length, and its scene"
    # shellcheck disable=SC2086
    tessera train "$here/city" "$work/$method" --method "$method" --blocks 2x2 $length --device "$device" \
      --set level_share=0 ${more[$method]} 2>&1 | tail -1
    tessera bake "$work/$method" "$work/$method.scene" --capture "$here/city" 2>&1 | tail -1
    tessera eval "$work/$method.scene" "$here/city" --device "$device" --json "$work/$method.json" 2>&1 | tail -1
    number "city_${method}_psnr" "$(psnr "$work/$method.json")"
    tessera bench frames "$work/$method.scene" --views "$here/city" --device "$device" --size "$size" --json "$work/$method-frames.json"
    json "city_${method}_frames" "$work/$method-frames.json"
  done

  if [ -n "${FOX:-}" ]; then
    for method in field hash; do
      step "fox, $method, $length"
      blocks=$([ "$method" = hash ] && echo "--blocks 1x1 --set surround=border")
      # shellcheck disable=SC2086
      tessera train "$FOX" "$work/fox-$method" --method "$method" $blocks $length --device "$device" ${more[$method]} 2>&1 | tail -1
      tessera eval "$work/fox-$method" "$FOX" --device "$device" --json "$work/fox-$method.json" 2>&1 | tail -1
      number "fox_${method}_psnr" "$(psnr "$work/fox-$method.json")"
    done
  fi
  write
} 2>&1 | tee "$out/gpu.txt"
[ -s "$out/gpu.json" ] && echo "wrote $out/gpu.json"
