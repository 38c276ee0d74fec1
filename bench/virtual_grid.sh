#!/usr/bin/env bash
# The gain of evaluating each distinct texel of a step once instead of every corner of every sample: one block of a city is trained
# both ways on the same rays and samples for the same number of steps. Prints samples per second of whole training steps, and
# held-out PSNR.
#   [STEPS=1000] [RAYS=1024] bench/virtual_grid.sh [CAPTURE]     default: a city of 1x1 made here
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
steps=${STEPS:-1000} rays=${RAYS:-1024}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
capture=${1:-$work/city}
[ -e "$capture" ] || "$tessera" synth city "$capture" --blocks 1x1 --size 320x240

# A fixed number of rays, and capacity for 20 corners of 16 samples of each ray and of the 4096 points of the sparsity loss, so that
# neither way takes fewer rays than the other. Corners of several blocks cannot be told apart, hence one block.
trained() {
  "$tessera" train "$capture" "$work/$1" --method volume --blocks 1x1 --steps "$steps" --seed 1 --json \
    --set background_block=border --set lod_step_fraction=0 --set share_texels="$1" --set first_rays="$rays" \
    --set max_rays="$rays" --set texels_per_step=$((20 * (16 * rays + 4096))) > "$work/$1.json"
  "$tessera" eval "$work/$1" "$capture" --json "$work/$1.eval.json" > /dev/null
  texels=$(tail -n 1 "$work/$1/metrics.jsonl" | jq '.texels_per_second / .samples_per_second * 100 | round / 100')
  echo "share_texels=$1: $(rate "$1") M samples/s, $(psnr "$1") dB, at last $texels evaluations a sample"
}
rate() { jq '.samples_per_second / 1e6 * 1000 | round / 1000' "$work/$1.json"; }
psnr() { jq '.psnr * 100 | round / 100' "$work/$1.eval.json"; }

trained true
trained false
times=$(awk -v a="$(rate true)" -v b="$(rate false)" 'BEGIN { printf "%.2f", a / b }')
lost=$(awk -v a="$(psnr true)" -v b="$(psnr false)" 'BEGIN { printf "%.2f", b - a }')
jq -n --argjson steps "$steps" --argjson rays "$rays" --slurpfile shared "$work/true.json" --slurpfile each "$work/false.json" \
  --slurpfile sharedEval "$work/true.eval.json" --slurpfile eachEval "$work/false.eval.json" \
  '{steps: $steps, rays: $rays, shared: ($shared[0] + {held_out_psnr: $sharedEval[0].psnr}),
    each_corner: ($each[0] + {held_out_psnr: $eachEval[0].psnr})}' > "$out/virtual_grid.json"
verdict "distinct texels, samples per second against each corner's" "$times" '>=' 1
verdict "distinct texels, held-out PSNR lost in dB" "$lost" '<=' 0.2
finish
