#!/usr/bin/env bash
# Training with memory for a quarter of the decoded photos, beside one run without a limit and one on a single photo: memory above
# the one-photo run within the budget + 20 %, steps per second within 15 % and held-out PSNR within 0.2 dB of the unlimited run. The
# single photo is the same capture imported again with every other photo held out, so that everything else that takes memory is the
# same.
#   [STEPS=2000] bench/photo_budget.sh [CAPTURE]     default: a city of 48 photos at 1200x900, made here (a few minutes)
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
steps=${STEPS:-2000}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
capture=${1:-$work/city}
[ -e "$capture" ] || "$tessera" synth city "$capture" --blocks 1x1 --photos 48 --size 1200x900 --samples 2

# The names of all training photos except the first.
jq -r '(.test_filenames // []) as $test | [.frames[].file_path] | (map(select(. as $f | $test | index([$f]) | not))[0]) as $kept
       | .[] | select(. != $kept)' "$capture/transforms.json" > "$work/held_out.txt"
"$tessera" import "$capture" "$work/single" --holdout "list:$work/held_out.txt"
[ "$("$tessera" info "$work/single" --json | jq .train)" = 1 ] || die "the one-photo capture does not train on one photo"

# Bytes of all decoded training photos: three channels, and a fourth where there are masks.
info=$("$tessera" info "$capture" --json)
masks=$(jq '[.frames[] | select(.mask_path != null)] | length' "$capture/transforms.json")
decoded=$(jq --argjson masks "$masks" '.train * .cameras[0].width * .cameras[0].height * (if $masks > 0 then 4 else 3 end)' <<< "$info")
budget=$(awk -v d="$decoded" 'BEGIN { printf "%.3f", d / 4 / 1048576 }')
echo "decoded training photos: $(awk -v d="$decoded" 'BEGIN { printf "%.1f", d / 1048576 }') MiB, budget $budget MiB"

# run NAME CAPTURE [FLAGS]: trains; writes the peak memory in MiB and the median speed of the second half to NAME.json.
run() {
  local name=$1 from=$2
  shift 2
  "$tessera" train "$from" "$work/$name" --method field --steps "$steps" --seed 1 "$@"
  jq -s '{peak_mib: (map(.peak_rss_bytes) | max / 1048576),
          steps_per_second: (.[length / 2 | floor:] | map(.steps_per_second) | sort | .[length / 2 | floor])}' \
    "$work/$name/metrics.jsonl" > "$work/$name.json"
}
judge() {
  "$tessera" eval "$work/$1" "$capture" --json "$work/eval.json"
  jq --slurpfile eval "$work/eval.json" '. + {psnr: $eval[0].psnr}' "$work/$1.json" > "$work/next.json"
  mv "$work/next.json" "$work/$1.json"
}
run one "$work/single"
run all "$capture"
run quarter "$capture" --set photo_budget_mib="$budget"
judge all
judge quarter
jq -n --argjson budget "$budget" --slurpfile one "$work/one.json" --slurpfile all "$work/all.json" \
  --slurpfile quarter "$work/quarter.json" \
  '{budget_mib: $budget, one_photo: $one[0], unlimited: $all[0], quarter: $quarter[0]}' > "$out/photo_budget.json"

figure() { jq -r "$1 * 1000 | round / 1000" "$out/photo_budget.json"; }
echo "peak memory in MiB: one photo $(figure .one_photo.peak_mib), unlimited $(figure .unlimited.peak_mib)," \
  "budget $(figure .quarter.peak_mib)"
verdict "memory above the one-photo run, MiB" "$(figure '(.quarter.peak_mib - .one_photo.peak_mib)')" '<=' \
  "$(figure '(1.2 * .budget_mib)')"
verdict "steps per second relative to unlimited" \
  "$(figure '(.quarter.steps_per_second / .unlimited.steps_per_second)')" '>=' 0.85
verdict "held-out PSNR below unlimited, dB" "$(figure '(.unlimited.psnr - .quarter.psnr)')" '<=' 0.2
finish
