#!/usr/bin/env bash
# City-on-Web on the CPU: a city of 2x2 blocks and real nadir photographs, trained, baked and evaluated. Resumable: captures and
# models stay in build/bench/volume, and what exists is not made again; remove city* or beach* there to repeat a row.
#   [ROWS="city beach"] [MINUTES=15] [TESSERA_SHARED_DATA=DIR] bench/volume.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
work=$out/volume
minutes=${MINUTES:-15}
settings "MINUTES=$minutes"

city() {
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-volume city --method volume --blocks 2x2 --minutes "$minutes"
  trained city-field city --method field --minutes "$minutes"
  baked city-volume city-scene city
  local model scene field
  model=$(judged city-volume city) scene=$(judged city-scene city) field=$(judged city-field city)
  echo "city 2x2 after $minutes min: field $field dB, volume $model dB, its scene $scene dB"
  verdict "city 2x2, held-out PSNR of the baked scene in dB" "$scene" '>=' 22
  verdict "city 2x2, field less the scene in dB" "$(shortfall "$field" "$scene")" '<=' 2
  verdict "city 2x2, scene and model apart by dB" "$(difference "$model" "$scene")" '<=' 0.15
  "$tessera" info "$work/city-scene" --json > "$work/city-info.json"
  verdict "city 2x2, memory of level 1 as a share of the finest's" "$(of_level_0 bytes_in_memory)" '<=' 0.3
  verdict "city 2x2, bytes on disk of level 1 likewise" "$(of_level_0 bytes_on_disk)" '<=' 0.3
  verdict "city 2x2, finest level less level 1 in dB" "$(shortfall "$scene" "$(judged city-scene city 1)")" '<=' 1
}
of_level_0() { jq -r ".level_1.$1 / .level_0.$1 * 1000 | round / 1000" "$work/city-info.json"; }

beach() {
  local data=${TESSERA_SHARED_DATA:?names no folder; it must hold brighton_beach/}/brighton_beach model scene
  [ -e "$work/beach/transforms.json" ] || "$tessera" import "$data" "$work/beach" --downscale 4 --holdout every:8
  trained beach-volume beach --method volume --minutes "$minutes"
  baked beach-volume beach-scene beach
  model=$(judged beach-volume beach) scene=$(judged beach-scene beach)
  echo "brighton_beach after $minutes min: volume $model dB, its scene $scene dB"
  verdict "brighton_beach, scene and model apart by dB" "$(difference "$model" "$scene")" '<=' 0.15
}

for row in ${ROWS:-city beach}; do "$row"; done
finish
