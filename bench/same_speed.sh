#!/usr/bin/env bash
# Tests that a refactoring costs no speed: two programs train and render alternately in one run, and so do two builds of the viewer
# if they are named. Prints the ratios of each pair (after / before) and fails if the best of one is below 0.97 of the best of the
# other: disturbances on a machine can only slow a program down.
#   BEFORE_PROGRAM=... AFTER_PROGRAM=... [BEFORE_VIEWER=... AFTER_VIEWER=...] [ROUNDS=9] [STEPS=120] [ROWS="..."] \
#     bench/same_speed.sh FOLDER
# FOLDER is what bench/same_bytes.sh kept (KEEP): its city, and the scenes that the first program baked from it. Viewers are what
# tools/build-web.sh makes (web/dist) from each commit. ROWS: train_field, train_volume, ... instead of all.
set -euo pipefail
source "$(dirname "$0")/setup.sh"
folder=$(cd "${1:?usage: bench/same_speed.sh FOLDER}" && pwd)
rounds=${ROUNDS:-9} steps=${STEPS:-120}
before=$(realpath "${BEFORE_PROGRAM:?}") after=$(realpath "${AFTER_PROGRAM:?}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Prints the steps per second of a training run, from its last line.
train() {
  local program=$1 method=$2
  shift 2
  rm -rf "$work/model"
  local json seconds
  json=$(alone "$program" train "$folder/city" "$work/model" --method "$method" --steps "$steps" --seed 7 --json \
    --checkpoint-seconds 1000000 --device cpu "$@" 2> /dev/null | tail -1)
  seconds=$(grep -o '"seconds": [0-9.]*' <<< "$json" | grep -o '[0-9.]*$')
  awk -v s="$steps" -v t="$seconds" 'BEGIN { print s / t }'
}
train_field() { train "$1" field --set samples_per_step=8192 --set samples_per_micro_batch=2048; }
train_volume() { train "$1" volume --blocks 2x2 --set lod_step_fraction=0 --set texels_per_step=131072; }
train_hash() { train "$1" hash --blocks 2x2 --set lod_step_fraction=0 --set samples_per_step=16384; }

frames() {
  alone "$1" bench frames "$folder/before/$2.scene" --views "$folder/city" --size 320x240 --seconds 4 --device cpu --json - \
    2> /dev/null | grep -o '"frames_per_second": [0-9.]*' | grep -o '[0-9.]*$'
}
frames_volume() { frames "$1" volume; }
frames_hash() { frames "$1" hash; }

for what in ${ROWS-train_field train_volume train_hash frames_volume frames_hash}; do
  ratios=() allBefore=() allAfter=() was="" is=""
  for ((round = 0; round < rounds; ++round)); do
    # They take turns at being first, because the machine may be colder then.
    if ((round % 2 == 0)); then
      was=$($what "$before") is=$($what "$after")
    else
      is=$($what "$after") was=$($what "$before")
    fi
    allBefore+=("$was") allAfter+=("$is")
    ratios+=("$(awk -v a="$is" -v b="$was" 'BEGIN { printf "%.4f", a / b }')")
  done
  bestBefore=$(printf '%s\n' "${allBefore[@]}" | sort -g | tail -1) bestAfter=$(printf '%s\n' "${allAfter[@]}" | sort -g | tail -1)
  median=$(printf '%s\n' "${ratios[@]}" | sort -g | sed -n "$(((rounds + 1) / 2))p")
  echo "$what: ${ratios[*]}, median $median; the best $bestBefore before, $bestAfter after, a second"
  verdict "$what, after / before" "$(awk -v a="$bestAfter" -v b="$bestBefore" 'BEGIN { printf "%.4f", a / b }')" '>=' 0.97
done
if [ -n "${BEFORE_VIEWER:-}" ]; then
  TESSERA=$after SCENES="$folder/before/volume.scene $folder/before/hash.scene" VIEWS=$folder/city
  BEFORE_VIEWER=$(realpath "$BEFORE_VIEWER") AFTER_VIEWER=$(realpath "${AFTER_VIEWER:?}")
  export TESSERA SCENES VIEWS BEFORE_VIEWER AFTER_VIEWER
  (cd web && xvfb-run -a -s "-screen 0 1280x1024x24 -noreset" npx vitest run bench/same-speed.ts \
    --config vitest.bench.config.ts --disable-console-intercept) || failures=$((failures + 1))
fi
finish
