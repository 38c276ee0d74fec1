#!/usr/bin/env bash
# Times ./quickstart.sh --no-serve with packages installed and everything built: at most 8 minutes, held-out PSNR of at least 24 dB,
# and a report must be written.
#   bench/quickstart.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
rm -rf out/quickstart  # otherwise it would resume the existing model
started=$(date +%s)
./quickstart.sh --no-serve 2>&1 | tee "$out/quickstart.txt"
seconds=$(($(date +%s) - started))
psnr=$(grep -oE 'PSNR [0-9.]+' "$out/quickstart.txt" | tail -n 1 | cut -d' ' -f2)
report=$(awk '$1 == "report:" { path = $2 } END { print path }' "$out/quickstart.txt")
verdict "quickstart, seconds" "$seconds" '<=' 480
verdict "quickstart, held-out PSNR in dB" "${psnr:-0}" '>=' 24
[ -n "$report" ] && [ -s "$report" ] || die "no report was written"
echo "report: $report"
finish
