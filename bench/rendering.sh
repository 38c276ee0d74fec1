#!/usr/bin/env bash
# Rendering a scene of blocks on the CPU.
#   skipping  held-out views of a trained city of 2x2, with and without empty-space skipping: the very same samples, at
#             least five times fewer steps, the same image to 1/255. Uses the scene of bench/volume.sh if that has been run
#   flight    600 images over all blocks of a city of 4x4, barely trained, with a cache of a quarter of the finest level:
#             never over the budget, never without the coarsest level, and whenever all requested tiles are in memory, the same
#             image as with a cache without a budget
# Resumable: captures, models and scenes stay in build/bench/rendering, and what exists is not made again.
#   [ROWS="skipping flight"] [MINUTES=4] bench/rendering.sh [SCENE CAPTURE]     both rows of this scene instead
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
[ $# -eq 0 ] || [ $# -eq 2 ] || die "usage: bench/rendering.sh [SCENE CAPTURE]"
work=$out/rendering minutes=${MINUTES:-4}
settings "MINUTES=$minutes"

# made BLOCKS SIZE STRIDE ARGUMENTS...: sets $scene and $capture of a city trained with these arguments and baked with that stride.
made() {
  local blocks=$1 size=$2 stride=$3
  shift 3
  scene=$work/$blocks.scene capture=$work/$blocks.city
  [ -e "$capture/transforms.json" ] ||
    "$tessera" synth city "$capture" --blocks "$blocks" --size "$size" --samples 1
  trained "$blocks.model" "$blocks.city" --method volume --blocks "$blocks" "$@"
  [ -e "$scene/tileset.json" ] || "$tessera" bake "$work/$blocks.model" "$scene" --stride "$stride" --effort 0
}

skipping() {
  scene=$out/volume/city-scene capture=$out/volume/city
  if [ -n "${1:-}" ]; then
    scene=$1 capture=$2
  elif [ ! -e "$scene/tileset.json" ]; then
    made 2x2 320x240 1 --minutes "$minutes" --set lod_step_fraction=0
  fi
  alone "$tessera" bench render "$scene" --views "$capture" --json "$out/skipping.json"
  value() { jq "$1" "$out/skipping.json"; }
  echo "rays per second, M: $(value '.skipping.skipping.rays_per_second / 1e3 | round / 1000') with skipping," \
    "$(value '.skipping.whole.rays_per_second / 1e3 | round / 1000') without"
  verdict "skipping, samples more or fewer than without" "$(value '.skipping.whole.samples - .skipping.skipping.samples | fabs')" '<=' 0
  verdict "skipping, times fewer steps" "$(value '.skipping.whole.steps / .skipping.skipping.steps * 100 | round / 100')" '>=' 5
  verdict "skipping, images apart by, in 1/255" "$(value '.skipping.largest_difference * 255')" '<=' 1
}

flight() {
  if [ -n "${1:-}" ]; then scene=$1; else made 4x4 160x120 4 --steps 60; fi
  alone "$tessera" bench render "$scene" --flight --steps 600 --share 0.25 --json "$out/flight.json"
  value() { jq "$1" "$out/flight.json"; }
  verdict "cache, most held as a share of its budget" "$(value '.cache.share.max_bytes / .cache.share.budget_bytes * 1000 | round / 1000')" '<=' 1
  verdict "cache, evictions" "$(value .cache.share.evictions)" '>=' 1
  verdict "cache for all, images with all that the view asks for" "$(value .cache.all.steps_in_full)" '>=' "$(value .cache.steps)"
  local run name
  for run in share all; do
    name=$([ $run = share ] && echo cache || echo "cache for all")
    verdict "$name, images over its budget" "$(value ".cache.$run.steps_over_budget")" '<=' 0
    verdict "$name, images without the coarsest level" "$(value ".cache.$run.steps_without_coarsest")" '<=' 0
    verdict "$name, images of a cut that is no partition" "$(value ".cache.$run.steps_without_partition")" '<=' 0
    verdict "$name, unlike without a budget, of $(value ".cache.$run.steps_in_full") images where all was there" \
      "$(value ".cache.$run.steps_unlike_unbounded")" '<=' 0
  done
}

for row in ${ROWS:-skipping flight}; do "$row" "$@"; done
finish
