#!/usr/bin/env bash
# Held-out PSNR on the Brighton Beach flight at 400x225 after ten minutes, for three seeds; fails if one is below 19.1 dB.
#   TESSERA_SHARED_DATA=DIR [SEEDS="1 2 3"] [MINUTES=10] [LPIPS=FILE] bench/brighton.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
photographs brighton_beach 4 19.1
