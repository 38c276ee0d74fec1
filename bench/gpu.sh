#!/usr/bin/env bash
# Packs the build into a bundle that runs on x86-64 Linux with nothing but a GPU driver: the programs, the libraries that they need,
# the Vulkan loader, a synthetic city, and the glibc that the programs need, for machines with an older one. Then runs it here. On
# another machine: tar -xzf, ./run.sh.
#   [BUILD=build/release] [ONLY_PACK=1] bench/gpu.sh        settings of the run: bench/gpu_run.sh
#   JUDGE="gpu.json ..." bench/gpu.sh                       compares what runs on a GPU (and bench/tiny_cuda_nn.sh there)
#                                                           measured with the required values
set -euo pipefail
source "$(dirname "$0")/setup.sh"
# judge FILE...: the files are of one GPU, whose rows may have been run one at a time. A missing measurement is a failure.
judge() {
  local all=$out/gpu-all.json number
  jq -s 'add + {failed: map(.failed) | add}' "$@" > "$all"
  # Accepts only runs that were not cut off and were all on a GPU; the tiny-cuda-nn comparison records neither.
  jq -se 'map(select(has("tiny_cuda_nn") | not)) | length > 0 and all(.[]; .is_gpu and has("ended"))' "$@" > /dev/null ||
    die "$*: not measured on a GPU, or cut off"
  holds_of() { # WHAT EXPRESSION BOUND
    number=$(jq "($2) // -1" "$all")
    verdict "$1" "$number" '>=' "$3"
  }
  rows='[(.compute.operations // [])[] | select(.operation | test($o)) | select(.shape | test($s))]'
  least() { # OPERATION SHAPE MEMBER: in percent
    jq --arg o "$1" --arg s "$2" "$rows | map(.$3) | min // -0.01 | . * 1000 | round / 10" "$all"
  }
  echo "GPU: $(jq -r .compute.device "$all"), commit $(jq -r .commit "$all")"
  holds_of "tests of operations and drawing that pass" .values_passed 200
  verdict "those that fail" "$(jq '.values_failed | if . == null then 1 else length end' "$all")" '<=' 0
  holds_of "fox held out, field, dB" .fox_field_psnr 27
  verdict "operations that were timed" \
    "$(jq '[(.compute.operations // [])[].operation | select(. != "Mlp both")] | unique | length' "$all")" '>=' 48
  sizes=$(jq -r '[(.compute.operations // [])[] | select(.operation | test("^(Mlp|HashGrid)"))
    | .shape | capture("(?<n>[0-9]+) samples$").n | tonumber] | unique | .[]' "$all")
  for samples in ${sizes:-0}; do
    verdict "hash grids, $samples samples, % of the gather rate" "$(least '^HashGrid' " $samples samples\$" share)" '>=' 50
    verdict "networks, $samples samples, % of arithmetic or memory" "$(least '^Mlp' " $samples samples\$" share_of_both)" '>=' 30
  done
  holds_of "hash at two levels, frames per second at $(jq .city_hash_2_frames.width "$all") wide" .city_hash_2_frames.frames_per_second 108
  holds_of "volume, frames per second" .city_volume_frames.frames_per_second 100
  # The time of tiny-cuda-nn relative to ours.
  if [ "$(jq 'has("tiny_cuda_nn")' "$all")" = true ]; then
    compared=$(jq -r '(.compute.operations // []) as $ours | .tiny_cuda_nn.operations[] | . as $theirs
      | [$ours[] | select(.operation == $theirs.operation and .shape == $theirs.shape).seconds][0] as $seconds
      | "\(.operation) \(.shape)\t\(if $seconds then .seconds / $seconds * 1000 | round / 1000 else -1 end)"' "$all")
    while IFS=$'\t' read -r what number; do
      verdict "$what, times tiny-cuda-nn's rate" "$number" '>=' 0.7
    done <<< "$compared"
  else
    echo "beside tiny-cuda-nn: not measured (bench/tiny_cuda_nn.sh)"
  fi
  verdict "steps that failed" "$(jq '.failed | length' "$all")" '<=' 0
}
# shellcheck disable=SC2086
[ -z "${JUDGE:-}" ] || { judge $JUDGE; finish; exit 0; }
need_tessera
build=${BUILD:-build/release}
tests=("$build"/src/compute/tessera_devices_test "$build"/src/compute/vulkan/tessera_compute_vulkan_test "$build"/tests/tessera_gpu_drawing_test)
for test in "${tests[@]}"; do
  [ -x "$test" ] || die "$test: not built; configure with TESSERA_VULKAN=ON and TESSERA_TESTS=ON"
done
commit=$(git rev-parse --short HEAD 2> /dev/null || echo unknown)
work=$out/gpu
bundle=$work/tessera-gpu-$commit
rm -rf "$bundle"
mkdir -p "$bundle"/{bin,lib,lib-c,lib-c++,lib-gl}
[ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2 --size 400x300
cp -r "$work/city" "$bundle/city"
rm -r "$bundle/city/depths"  # four fifths of the city's size, and nothing here reads them
jq -c 'del(.frames[].depth_file_path)' "$work/city/transforms.json" > "$bundle/city/transforms.json"
for program in "$tessera" "${tests[@]}"; do
  strip -o "$bundle/bin/$(basename "$program")" "$program"
done
# glibc and the C++ library are packed separately: the driver is linked to the machine's, which may be newer.
ldd "$tessera" "${tests[@]}" | awk '$3 ~ /^\// { print $3 }' | sort -u | while read -r library; do
  case "$(basename "$library")" in
    libc.so.* | libm.so.* | libdl.so.* | libpthread.so.* | librt.so.* | ld-linux*) ;;  # packed below, as a whole
    libstdc++.so.* | libgcc_s.so.*) cp -L "$library" "$bundle/lib-c++/" ;;
    *) cp -L "$library" "$bundle/lib/" ;;
  esac
done
glibc=$(dirname "$(ldd "$tessera" | awk '$1 == "libc.so.6" { print $3 }')")
for library in libc.so.6 libm.so.6 libmvec.so.1 libdl.so.2 libpthread.so.0 librt.so.1 libresolv.so.2 libutil.so.1 ld-linux-x86-64.so.2; do
  cp -L "$glibc/$library" "$bundle/lib-c/"
done
# installed LIBRARY PACKAGE: prints its path.
installed() {
  local path
  path=$(ldconfig -p | awk -v name="$1" '$1 == name && /x86-64/ { path = $NF } END { print path }')
  [ -n "$path" ] || die "$1: not installed (apt-get install $2)"
  echo "$path"
}
cp -L "$(installed libvulkan.so.1 libvulkan1)" "$bundle/lib/"
# NVIDIA's driver loads these even if nothing is shown, and machines without a screen often lack them.
for library in libGLdispatch.so.0=libglvnd0 libEGL.so.1=libegl1 libGLX.so.0=libglx0 libGL.so.1=libgl1 libX11.so.6=libx11-6 \
  libXext.so.6=libxext6 libxcb.so.1=libxcb1 libXau.so.6=libxau6 libXdmcp.so.6=libxdmcp6 libbsd.so.0=libbsd0 libmd.so.0=libmd0; do
  cp -L "$(installed "${library%=*}" "${library#*=}")" "$bundle/lib-gl/"
done
install -m 755 bench/gpu_run.sh "$bundle/run.sh"
cp LICENSE "$bundle/"
echo "$commit" > "$bundle/commit"
find "$bundle/bin" "$bundle/lib" "$bundle/lib-gl" -type f -exec objdump -T {} + 2> /dev/null |
  grep -o 'GLIBC_2\.[0-9]*' | sort -Vu | tail -1 | sed 's/GLIBC_//' > "$bundle/glibc"
tar -C "$work" --sort=name -c "$(basename "$bundle")" | gzip -9 > "$bundle.tar.gz"
megabytes=$(awk -v b="$(stat -c %s "$bundle.tar.gz")" 'BEGIN { printf "%.1f", b / 1e6 }')
echo "$bundle.tar.gz: needs a driver, and brings its own glibc for machines whose is older than $(cat "$bundle/glibc")"
verdict "megabytes of the bundle" "$megabytes" '<=' 60
[ -n "${ONLY_PACK:-}" ] || "$bundle/run.sh" "$work"
finish
