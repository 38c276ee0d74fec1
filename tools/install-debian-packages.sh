#!/usr/bin/env bash
# Installs what building and testing tessera needs on Debian 12. Run as root or with sudo. Does nothing if everything is installed.
#   tools/install-debian-packages.sh [--browser] [--colmap] [--fuzz] [--bench]
set -euo pipefail

packages=(
  ca-certificates g++ cmake ninja-build ccache pkg-config
  libhwy-dev libeigen3-dev libembree-dev libmeshoptimizer-dev
  libjpeg62-turbo-dev libspng-dev libwebp-dev libopenexr-dev libexif-dev
  libcli11-dev libfmt-dev libspdlog-dev nlohmann-json3-dev libtomlplusplus-dev
  libgeographiclib-dev libassimp-dev libsqlite3-dev
  libboost-dev zlib1g-dev
  libvulkan-dev libvulkan-volk-dev mesa-vulkan-drivers vulkan-validationlayers glslang-tools
  libglfw3-dev libimgui-dev
  libgtest-dev
  ffmpeg
)
command -v npm > /dev/null || packages+=(nodejs npm)
for argument in "$@"; do
  case "$argument" in
    --browser) packages+=(chromium xvfb xauth) ;;
    --colmap) packages+=(colmap) ;;
    --fuzz) packages+=(clang-14 libclang-rt-14-dev) ;;
    --bench) packages+=(jq python3 libtorch-dev libopenblas0-pthread vulkan-tools) ;;
    *) echo "usage: $0 [--browser] [--colmap] [--fuzz] [--bench]" >&2; exit 2 ;;
  esac
done

missing=()
for package in "${packages[@]}"; do
  dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "tessera: error: packages are missing (${missing[*]}): run as root or install sudo" >&2; exit 1; }
  as_root=(sudo)
fi
echo "installing: ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
