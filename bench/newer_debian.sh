#!/usr/bin/env bash
# Builds and tests tessera on a newer Debian in a chroot: newer compilers, libraries and Mesa. From Debian 13 on, glslang and
# Vulkan's headers support VK_KHR_cooperative_matrix; of Mesa's drivers for the CPU, that of sid (26.2) does.
#   [SUITE=trixie] [MIRROR=http://deb.debian.org/debian] [TARGETS=all] [TESTS=REGEX] bench/newer_debian.sh
# Needs root, debootstrap, and 6 GB in build/bench.
set -euo pipefail
source "$(dirname "$0")/setup.sh"
suite=${SUITE:-trixie}
[ "$(id -u)" -eq 0 ] || die "makes a root folder: run it as root"
command -v debootstrap > /dev/null || die "apt-get install debootstrap"
root=$PWD/$out/debian-$suite
if [ ! -e "$root/made" ]; then
  rm -rf --one-file-system "$root"
  debootstrap --variant=minbase "$suite" "$root" "${MIRROR:-http://deb.debian.org/debian}"
  touch "$root/made"
fi
mkdir -p "$root/tessera" "$root/build" "$root/data"

# The mounts are private to this process and disappear with it.
export TARGETS=${TARGETS:-all} TESTS=${TESTS:-.} root
unshare --mount --propagation private bash -euo pipefail -c '
  mount --bind . "$root/tessera"
  mount -t proc proc "$root/proc"
  if [ -n "${TESSERA_SHARED_DATA:-}" ]; then mount --bind "$TESSERA_SHARED_DATA" "$root/data"; fi
  exec chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 TARGETS="$TARGETS" TESTS="$TESTS" \
    ${TESSERA_SHARED_DATA:+TESSERA_SHARED_DATA=/data} bash -euo pipefail -c "
      /tessera/tools/install-debian-packages.sh
      apt-get install -y --no-install-recommends xvfb
      cmake -S /tessera -B /build -G Ninja -DCMAKE_BUILD_TYPE=Release
      nice ninja -k 0 -C /build \$TARGETS
      cd /build
      TESSERA_VULKAN_VALIDATION=1 TESSERA_REQUIRE_VULKAN=1 ctest -R \"\$TESTS\" -j \$(nproc) --output-on-failure
      [ ! -x apps/tessera/tessera ] || apps/tessera/tessera info devices"
'
