#!/usr/bin/env bash
# City-on-Web's levels of detail: a city of 4x4 blocks with its two coarser levels (2x2 blocks and one), baked; compares each
# level's blocks with those of the next finer level. Resumable: what is in build/bench/levels is not made again.
#   [STEPS=3000] [RAYS=4096] [SIZE=400x300] bench/levels.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
work=$out/levels
steps=${STEPS:-3000} rays=${RAYS:-4096} size=${SIZE:-400x300}
settings "STEPS=$steps RAYS=$rays SIZE=$size"

[ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 4x4 --size "$size"
trained model city --method volume --blocks 4x4 --steps "$steps" --set first_rays="$rays" --set max_rays="$rays" \
  --set texels_per_step=$((256 * rays))
baked model scene city
"$tessera" info "$work/scene" --json > "$work/info.json"
# of LEVEL EXPRESSION: prints a level's value as a ratio to the next finer one's.
of() { jq -r "(.level_$1.$2 / .level_$(($1 - 1)).$2) * 1000 | round / 1000" "$work/info.json"; }

for level in 0 1 2; do
  psnr=$(judged scene city "$level")
  echo "level $level: $(jq -r ".level_$level | \"\(.bytes_in_memory) bytes in memory, \(.bytes_on_disk) on disk\"" "$work/info.json"), $psnr dB"
  if [ "$level" -gt 0 ]; then
    verdict "level $level, memory as a share of level $((level - 1))'s" "$(of "$level" bytes_in_memory)" '<=' 0.3
    verdict "level $level, bytes on disk likewise" "$(of "$level" bytes_on_disk)" '<=' 0.3
    verdict "level $level, held-out PSNR below level $((level - 1))'s in dB" "$(shortfall "$finer" "$psnr")" '<=' 1
  fi
  finer=$psnr
done
finish
