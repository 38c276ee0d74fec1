#!/usr/bin/env bash
# City-on-Web on the processor: a city of 2x2 blocks and real nadir photographs, trained, baked and judged. Resumable: captures
# and models stay in build/bench/volume, and what is there is not made again; remove a folder to repeat its row.
#   [ROWS="city beach"] [MINUTES=15] [TESSERA_SHARED_DATA=DIR] bench/volume.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
work=$out/volume
minutes=${MINUTES:-15}
mkdir -p "$work"

# trained MODEL CAPTURE ARGUMENTS...: unless it is there; goes on with one that was interrupted.
trained() {
  local model=$work/$1 capture=$work/$2
  shift 2
  [ -e "$model.done" ] && return
  "$tessera" train "$capture" "$model" --resume "$@"
  touch "$model.done"
}
baked() {
  [ -e "$work/$2/tileset.json" ] || "$tessera" bake "$work/$1" "$work/$2" --capture "$work/$3"
}
# judged WHAT CAPTURE: its held-out PSNR, from the file if it was judged before.
judged() {
  [ -s "$work/$1.json" ] ||
    "$tessera" eval "$work/$1" "$work/$2" --json "$work/$1.json" --report "$work/$1.html" > /dev/null
  jq -r '.psnr * 100 | round / 100' "$work/$1.json"
}
difference() { awk -v a="$1" -v b="$2" 'BEGIN { d = a - b; print d < 0 ? -d : d }'; }
shortfall() { awk -v a="$1" -v b="$2" 'BEGIN { print a - b }'; }

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
}

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
