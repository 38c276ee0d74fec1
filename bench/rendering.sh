#!/usr/bin/env bash
# Drawing a scene of blocks on the processor. Skipping empty space: the very same samples, at least five times fewer steps,
# the same picture to 1/255. A flight of 600 pictures over all blocks with a cache of a quarter of the finest level: never
# over the budget, never without the coarsest level, and the picture that an unbounded cache gives wherever all that the
# view asks for is there.
#   [STEPS=2000] bench/rendering.sh [SCENE CAPTURE]     default: a city of 4x4 made here; STEPS train it
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
if [ $# -eq 0 ]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  scene=$work/scene capture=$work/city
  "$tessera" synth city "$capture" --blocks 4x4 --size 160x120 --samples 1
  "$tessera" train "$capture" "$work/model" --method volume --blocks 4x4 --steps "${STEPS:-2000}"
  "$tessera" bake "$work/model" "$scene" --capture "$capture"
else
  [ $# -eq 2 ] || die "usage: bench/rendering.sh [SCENE CAPTURE]"
  scene=$1 capture=$2
fi
alone "$tessera" bench render "$scene" --views "$capture" --flight --steps 600 --share 0.25 --json "$out/rendering.json"

value() { jq "$1" "$out/rendering.json"; }
echo "rays per second, M: $(value '.skipping.skipping.rays_per_second / 1e4 | round / 100') with skipping," \
  "$(value '.skipping.whole.rays_per_second / 1e4 | round / 100') without"
verdict "samples evaluated without skipping more or fewer than with" \
  "$(value '.skipping.whole.samples - .skipping.skipping.samples | fabs')" '<=' 0
verdict "steps without skipping, times those with" "$(value '.skipping.whole.steps / .skipping.skipping.steps * 100 | round / 100')" '>=' 5
verdict "pictures with and without skipping apart, in 1/255" "$(value '.skipping.largest_difference * 255')" '<=' 1
verdict "cache, most bytes held as a share of the budget" "$(value '.cache.share.most_bytes / .cache.share.budget_bytes * 10000 | round / 10000')" '<=' 1
for run in share all; do
  verdict "cache of $run, steps over budget" "$(value ".cache.$run.steps_over_budget")" '<=' 0
  verdict "cache of $run, steps without the coarsest level" "$(value ".cache.$run.steps_without_coarsest")" '<=' 0
  verdict "cache of $run, steps whose cut is no partition" "$(value ".cache.$run.steps_without_partition")" '<=' 0
  verdict "cache of $run, steps unlike an unbounded cache's of $(value ".cache.$run.steps_in_full") where all was there" \
    "$(value ".cache.$run.steps_unlike_unbounded")" '<=' 0
done
verdict "cache of all, steps where all was there" "$(value .cache.all.steps_in_full)" '>=' "$(value .cache.steps)"
verdict "cache of share, evictions" "$(value .cache.share.evictions)" '>=' 1
finish
