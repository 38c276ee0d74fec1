#!/usr/bin/env bash
# Packs what was built into a bundle that runs on x86-64 Linux with nothing but a graphics card's driver, and a glibc as new as
# that of the machine that it was built on, which it names: the programs, the libraries that they need, the Vulkan loader, a made city. Then runs it here.
# On another machine: unpack it, ./run.sh.
#   [BUILD=build/release] [ONLY_PACK=1] bench/gpu.sh        settings of the run: bench/gpu_run.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
build=${BUILD:-build/release}
test=$build/src/compute/tessera_devices_test
[ -x "$test" ] || die "$test: not built; configure with TESSERA_VULKAN=ON and TESSERA_TESTS=ON"
commit=$(git rev-parse --short HEAD 2> /dev/null || echo unknown)
work=$out/gpu
bundle=$work/tessera-gpu-$commit
rm -rf "$bundle"
mkdir -p "$bundle"/{bin,lib,lib-c++}
[ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2 --size 400x300
cp -r "$work/city" "$bundle/city"
for program in "$tessera" "$test"; do
  strip -o "$bundle/bin/$(basename "$program")" "$program"
done
# All but glibc, which must be the machine's, as its driver is. The C++ library apart: the driver may bring a newer one.
ldd "$tessera" "$test" | awk '$3 ~ /^\// { print $3 }' | sort -u | while read -r library; do
  case "$(basename "$library")" in
    libc.so.* | libm.so.* | libdl.so.* | libpthread.so.* | librt.so.* | ld-linux*) ;;
    libstdc++.so.* | libgcc_s.so.*) cp -L "$library" "$bundle/lib-c++/" ;;
    *) cp -L "$library" "$bundle/lib/" ;;
  esac
done
loader=$(ldconfig -p | awk '/libvulkan\.so\.1 / && /x86-64/ { path = $NF } END { print path }')
[ -n "$loader" ] || die "libvulkan.so.1: not installed (apt-get install libvulkan1)"
cp -L "$loader" "$bundle/lib/libvulkan.so.1"
cp bench/gpu_run.sh "$bundle/run.sh"
cp LICENSE "$bundle/"
echo "$commit" > "$bundle/commit"
find "$bundle" -type f \( -path '*/bin/*' -o -path '*/lib*/*' \) -exec objdump -T {} + 2> /dev/null |
  grep -o 'GLIBC_2\.[0-9]*' | sort -Vu | tail -1 | sed 's/GLIBC_//' > "$bundle/glibc"
tar -C "$work" --sort=name -cJf "$bundle.tar.xz" "$(basename "$bundle")"
megabytes=$(awk -v b="$(stat -c %s "$bundle.tar.xz")" 'BEGIN { printf "%.1f", b / 1e6 }')
echo "$bundle.tar.xz: needs glibc $(cat "$bundle/glibc") or later, and a driver"
verdict "megabytes of the bundle" "$megabytes" '<=' 60
[ -n "${ONLY_PACK:-}" ] || "$bundle/run.sh" "$work"
finish
