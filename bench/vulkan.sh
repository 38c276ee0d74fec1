#!/usr/bin/env bash
# Training with Vulkan: on a GPU, or with Mesa's driver for the CPU, which takes hours for the first row.
#   agree    300 steps of 2^14 samples on fox and on a synthetic city, with `cpu` and `vulkan`, three representations: PSNR of the
#            training photos, rendered on the CPU, at most 0.2 dB apart
#   resume   killed on vulkan and resumed on cpu, and the reverse
#   loader   without a Vulkan loader, and without a driver: cpu trains, vulkan prints one line that says what to install
# Resumable: everything is kept in build/bench/vulkan, and what exists is not made again.
#   TESSERA_SHARED_DATA=DIR [ROWS="agree resume loader"] [CAPTURES="fox city"] [METHODS="field volume hash"] bench/vulkan.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
data=${TESSERA_SHARED_DATA:?names no folder; it must hold fox/}
[ -d "$data/fox" ] || die "$data/fox: no such folder"
work=$out/vulkan
steps=300
settings "STEPS=$steps"
[ -e "$work/fox/transforms.json" ] || "$tessera" import "$data/fox" "$work/fox" --downscale 2 --holdout every:8
[ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2 --size 400x300

# Steps of 2^14 samples, without anything that takes longer than them.
declare -A blocks=([fox]="--blocks 1x1" [city]="--blocks 2x2")
flags() { # METHOD CAPTURE
  case "$1" in
    field) echo "--set samples_per_step=16384 --set occupancy_resolution=64" ;;
    hash) echo "${blocks[$2]} --set lod_step_fraction=0 --set samples_per_step=16384 --set occupancy_resolution=64" ;;
    volume) echo "${blocks[$2]} --set lod_step_fraction=0 --set first_rays=512 --set max_rays=512" ;;
  esac
}

# fitted MODEL: prints its PSNR on its training photos.
fitted() {
  [ -s "$work/$1.json" ] || "$tessera" eval "$work/$1" "$work/$2" --split train --json "$work/$1.json" > /dev/null
  jq .psnr "$work/$1.json"
}

agree() {
  local capture method device
  for capture in ${CAPTURES:-fox city}; do
    for method in ${METHODS:-field volume hash}; do
      for device in cpu vulkan; do
        # shellcheck disable=SC2046
        trained "$capture-$method-$device" "$capture" --method "$method" $(flags "$method" "$capture") --steps "$steps" \
          --device "$device"
      done
      local one other
      one=$(fitted "$capture-$method-cpu" "$capture") other=$(fitted "$capture-$method-vulkan" "$capture")
      echo "$capture, $method: cpu $one dB, vulkan $other dB"
      verdict "$capture, $method: difference of training PSNR in dB" "$(difference "$one" "$other")" '<=' 0.2
    done
  done
}

# killed MODEL DEVICE: trains, and kills the run as soon as it has saved something.
killed() {
  rm -rf "${work:?}/$1" "$work/$1.done"
  "$tessera" train "$work/fox" "$work/$1" --method field --steps 120 --set samples_per_step=4096 --set occupancy_resolution=32 \
    --device "$2" --checkpoint-seconds 0.1 > /dev/null 2>&1 &
  local training=$!
  until [ -e "$work/$1/manifest.json" ]; do
    kill -0 "$training" 2> /dev/null || die "$work/$1: training ended before it was killed"
    sleep 0.1
  done
  kill -9 "$training"
  wait "$training" 2> /dev/null || true
}

resume() {
  local from to
  for from in vulkan cpu; do
    to=$([ "$from" = cpu ] && echo vulkan || echo cpu)
    killed "killed-on-$from" "$from"
    echo "killed on $from at step $(jq .step "$work/killed-on-$from/manifest.json")"
    "$tessera" train "$work/fox" "$work/killed-on-$from" --resume --device "$to" 2>&1 | tail -1
    verdict "steps after resuming on $to" "$(jq .step "$work/killed-on-$from/manifest.json")" '>=' 120
  done
}

# without COMMAND...: runs it where no Vulkan loader can be found. Needs root or user namespaces.
without_loader() {
  unshare --mount --map-root-user bash -c '
    for library in $(ldconfig -p | grep -o "/.*libvulkan\.so.*"); do mount --bind /dev/null "$library"; done
    exec "$@"' - "$@"
}

loader() {
  local try=("$tessera" train "$work/fox" "$work/loader" --method field --steps 2 --set samples_per_step=1024)
  local said status
  for missing in without_loader "env VK_DRIVER_FILES=/nonexistent VK_ICD_FILENAMES=/nonexistent"; do
    rm -rf "$work/loader"
    $missing "${try[@]}" --device cpu > /dev/null
    verdict "$missing: steps on cpu" "$(jq .step "$work/loader/manifest.json")" '>=' 2
    rm -rf "$work/loader"
    $missing "${try[@]}" --device auto > /dev/null
    verdict "$missing: steps on auto" "$(jq .step "$work/loader/manifest.json")" '>=' 2
    rm -rf "$work/loader"
    status=0
    said=$($missing "${try[@]}" --device vulkan 2>&1 > /dev/null) || status=$?
    echo "$missing: $said"
    verdict "$missing: exit status on vulkan" "$status" '<=' 1
    verdict "$missing: lines that say so" "$(echo "$said" | grep -c '^tessera: error: .*install')" '>=' 1
  done
}

for row in ${ROWS:-agree resume loader}; do "$row"; done
finish
