#!/usr/bin/env bash
# Held-out PSNR on the fox photographs at 270x480 after ten minutes, for three seeds; fails if one is below 27.2 dB.
#   TESSERA_SHARED_DATA=DIR [SEEDS="1 2 3"] [MINUTES=10] [LPIPS=FILE] bench/fox.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
photographs fox 2 27.2
