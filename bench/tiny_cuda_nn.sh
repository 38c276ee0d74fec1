#!/usr/bin/env bash
# Times networks and hash grids of the shapes that `tessera bench compute` times, with tiny-cuda-nn on an NVIDIA GPU, for comparison
# with what bench/gpu.sh measured there (JUDGE="gpu.json tiny_cuda_nn.json" bench/gpu.sh). Needs CUDA's compiler.
#   TINY_CUDA_NN=DIR [SAMPLES="65536 1048576"] bench/tiny_cuda_nn.sh [OUT.json]
# DIR: a checkout of https://github.com/NVlabs/tiny-cuda-nn with its submodules (written for 6ee3546).
set -euo pipefail
source "$(dirname "$0")/setup.sh"
from=${TINY_CUDA_NN:?names no checkout of tiny-cuda-nn}
[ -e "$from/dependencies/cutlass/CMakeLists.txt" ] || die "$from: no checkout of tiny-cuda-nn with its submodules"
command -v nvcc > /dev/null || die "nvcc: not installed (CUDA's compiler)"
json=${1:-$out/tiny_cuda_nn.json}
cmake -S bench/tiny_cuda_nn -B "$out/tiny_cuda_nn" -DTINY_CUDA_NN="$(cd "$from" && pwd)" -DCMAKE_BUILD_TYPE=Release
cmake --build "$out/tiny_cuda_nn" --parallel "$(nproc)" --target tiny_cuda_nn
read -ra samples <<< "${SAMPLES:-65536 1048576}"
"$out/tiny_cuda_nn/tiny_cuda_nn" "$json" "${samples[@]}"
echo "wrote $json"
