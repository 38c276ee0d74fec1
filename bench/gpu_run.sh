#!/usr/bin/env bash
# Measures what a GPU can do with tessera: run.sh of the bundle that bench/gpu.sh packs. Needs only the GPU's driver. Writes
# gpu.json, and the output to gpu.txt; ends with status 1 if something failed.
#   ./run.sh [OUT]        default: the folder that contains this script
#   ROWS="values compute fox cities"      some of them
#   DEVICE=vulkan:1       a device other than the best one (bin/tessera info devices)
#   FOX=DIR               a capture of the fox photographs, for the row `fox`
#   CITY=DIR              a capture other than the bundle's city of 2x2 blocks
#   GLIBC=packed          use the bundle's glibc, which is otherwise used only if the machine's is too old
#   SECONDS_OF_TRAINING=60 SIZE=1920x1080 SAMPLES="65536 1048576" STREAMED=1048576
#   LENGTH="--steps 3" VOLUME="--set max_rays=128" HASH=... FIELD=... MESH=...    instead of the seconds; further flags of train
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
out=$(mkdir -p "${1:-$here}" && cd "${1:-$here}" && pwd)
device=${DEVICE:-vulkan} seconds=${SECONDS_OF_TRAINING:-60} size=${SIZE:-1920x1080}
work=$(mktemp -d) && trap 'rm -rf "$work"' EXIT

# Uses the machine's own glibc and C++ library if they are new enough, because its driver may need exactly those. Other programs of
# the machine do not see the bundle's.
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

# Returns whether there is a GPU, not only a Vulkan driver for the CPU.
has_gpu() {
  tessera info devices 2> /dev/null | awk '/^vulkan:[0-9]/ { next_is = 1 }
    /^  name/ { if (next_is && !/llvmpipe|SwiftShader/) found = 1; next_is = 0 } END { exit !found }'
}
# In a container, NVIDIA's driver often lacks the file that registers it with the Vulkan loader.
register_driver() {
  local library
  has_gpu && return
  [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] || return 1
  for library in libGLX_nvidia.so.0 libEGL_nvidia.so.0; do
    printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "%s", "api_version": "1.2.0"}}\n' "$library" > "$work/icd.json"
    export VK_DRIVER_FILES=$work/icd.json VK_ICD_FILENAMES=$work/icd.json
    has_gpu && return
    unset VK_DRIVER_FILES VK_ICD_FILENAMES
  done
  return 1
}
# It may also lack libraries that the driver loads: those of the bundle take their place.
if ! register_driver; then
  mkdir "$work/gl"
  for library in "$here"/lib-gl/*; do
    PATH=$PATH:/sbin:/usr/sbin ldconfig -p | awk -v name="${library##*/}" '$1 == name && /x86-64/ { found = 1 } END { exit !found }' || ln -s "$library" "$work/gl/"
  done
  given=$given:$work/gl
  register_driver
fi

# Writes what is known so far, so that nothing is lost if the script is stopped.
write() {
  local i
  {
    echo "{"
    for i in "${!members[@]}"; do printf '  %s%s\n' "${members[$i]}" "$([ "$i" -lt $((${#members[@]} - 1)) ] && echo ,)"; done
    echo "}"
  } > "$out/gpu.json.part" && mv "$out/gpu.json.part" "$out/gpu.json"
}
# json NAME FILE: adds a member to gpu.json; null if the file does not exist.
members=()
json() { members+=("\"$1\": $(if [ -s "$2" ]; then cat "$2"; else echo null; fi)"); }
number() { members+=("\"$1\": ${2:-null}"); }
quoted() { printf '"%s"' "$(printf '%s' "$1" | tr -d '\000-\037' | sed 's/[\\"]/\\&/g')"; }
# psnr FILE: prints the PSNR in the output of `eval --json`.
psnr() { sed -n 's/^ *"psnr": *\([0-9.]*\).*/\1/p' "$1" 2> /dev/null | head -1; }
step() { write; echo "== $*"; }
# try NAME COMMAND...: prints the last line of its output, and records its status in gpu.json if it failed.
failed=()
try() {
  local name=$1 status=0
  shift
  "$@" > "$work/said.txt" 2>&1 || status=$?
  tail -n 1 "$work/said.txt"
  [ "$status" -eq 0 ] && return
  tail -n 5 "$work/said.txt"
  failed+=("$(quoted "$name: status $status, $(tail -n 1 "$work/said.txt")")")
}
case $device in vulkan:*) export TESSERA_GPU=${device#vulkan:} ;; esac  # for the tests
# Methods and settings by name: hash-2 is `hash` with two levels of features, as in the paper's figures.
declare -A method=([volume]=volume [hash]=hash [hash-2]=hash [field]=field [mesh]=mesh)
declare -A more=([volume]=${VOLUME:-} [hash]=${HASH:-} [hash-2]="--set fine_levels=2 ${HASH:-}" [field]=${FIELD:-} [mesh]=${MESH:-})
city=${CITY:-$here/city}
read -ra samples <<< "${SAMPLES:-65536 1048576}"
length=${LENGTH:---minutes $(awk -v s="$seconds" 'BEGIN { print s / 60 }')}

values() {
  step "every operation against the reference, and scenes drawn by the GPU against the CPU"
  local program filter status all=0
  local -A only=([tessera_devices_test]='*vulkan*' [tessera_compute_vulkan_test]='*' [tessera_gpu_drawing_test]='*')
  for program in "${!only[@]}"; do
    filter=${only[$program]} status=0
    TESSERA_REQUIRE_VULKAN=1 start "$program" --gtest_brief=1 --gtest_filter="$filter" >> "$work/values.txt" 2>&1 || status=$?
    [ "$status" -eq 0 ] || failed+=("$(quoted "values, $program: status $status")")
    all=$((all > status ? all : status))
  done
  number values_status "$all"
  grep -E '^\[  (PASSED|FAILED|SKIPPED)' "$work/values.txt"
  number values_passed "$(awk '/^\[  PASSED  \] [0-9]+ test/ { sum += $4 } END { print sum + 0 }' "$work/values.txt")"
  members+=("\"values_failed\": [$(sed -n 's/^\[  FAILED  \] \([^ ,]*\).*/"\1"/p' "$work/values.txt" | sort -u | paste -sd, -)]")
  cp "$work/values.txt" "$out/values.txt"
}

compute() {
  step "rates beside the GPU's own limits"
  try compute tessera bench compute --device "$device" --samples "${samples[@]}" --streamed "${STREAMED:-1048576}" --json "$work/compute.json"
  json compute "$work/compute.json"
  step "a training step"
  try step tessera bench train --device "$device" --samples "${samples[0]}" --json "$work/step.json"
  json step "$work/step.json"
}

fox() {
  local name blocks
  [ -n "${FOX:-}" ] || return
  local -A blocks_of=([field]="" [hash]="--blocks 1x1 --set background_block=border" [mesh]="--blocks 1x1")
  for name in field hash mesh; do
    step "fox, $name, $length"
    blocks=${blocks_of[$name]}
    # shellcheck disable=SC2086
    try "fox $name" tessera train "$FOX" "$work/fox-$name" --method "$name" $blocks $length --device "$device" ${more[$name]}
    try "fox $name" tessera eval "$work/fox-$name" "$FOX" --device "$device" --json "$work/fox-$name.json"
    number "fox_${name}_psnr" "$(psnr "$work/fox-$name.json")"
  done
}

cities() {
  local name key
  for name in volume hash hash-2 mesh; do
    step "a city of 2x2 blocks, $name, $length, and its scene"
    key=city_${name//-/_}
    # shellcheck disable=SC2086
    try "$name" tessera train "$city" "$work/$name" --method "${method[$name]}" --blocks 2x2 $length --device "$device" \
      $([ "$name" = mesh ] || echo "--set lod_step_fraction=0") ${more[$name]}
    # Baking with a Vulkan driver for the CPU would take an hour.
    try "$name" tessera bake "$work/$name" "$work/$name.scene" --capture "$city" --device "$(has_gpu && echo "$device" || echo cpu)"
    try "$name" tessera eval "$work/$name.scene" "$city" --device "$device" --json "$work/$name.json"
    number "${key}_psnr" "$(psnr "$work/$name.json")"
    try "$name" tessera bench frames "$work/$name.scene" --views "$city" --device "$device" --size "$size" --json "$work/$name-frames.json"
    json "${key}_frames" "$work/$name-frames.json"
  done
}

{
  tessera info devices
  has_gpu || echo "NO GPU: what follows was measured with a Vulkan driver for the CPU"
  members+=("\"is_gpu\": $(has_gpu && echo true || echo false)")
  members+=("\"libraries\": $(quoted "$libraries")")
  members+=("\"commit\": $(quoted "$(cat "$here/commit")")" "\"machine\": $(quoted "$(uname -srm)")"
    "\"processor\": $(quoted "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1)")"
    "\"devices\": $(quoted "$(tessera info devices | sed -n 's/^  name *//p' | paste -sd';')")" "\"length\": $(quoted "$length")")
  for row in ${ROWS:-values compute fox cities}; do
    case $row in values | compute | fox | cities) "$row" ;; *) failed+=("$(quoted "ROWS: there is no $row")") ;; esac
  done
  members+=("\"failed\": [$(IFS=,; echo "${failed[*]-}")]" "\"ended\": true")
  write
  exit $((${#failed[@]} > 0))
} 2>&1 | tee "$out/gpu.txt"
status=${PIPESTATUS[0]}
[ -s "$out/gpu.json" ] && echo "wrote $out/gpu.json"
exit "$status"
