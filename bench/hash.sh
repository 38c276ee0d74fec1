#!/usr/bin/env bash
# NGP-RT's models (`--method hash`) on the processor: hand-held photographs (fox at 270x480) and a made city of 2x2 blocks.
#   photographs  ten minutes on fox, and ten of `field`: at most 1 dB below it
#   ablation     the paper's table 3, equal steps, held-out PSNR of seeds: attention (separate, from place to place) against
#                the sum of levels and against a network for each sample; multiply-accumulates of each
# Resumable: all is kept in build/bench/hash, and what is there is not made again.
#   TESSERA_SHARED_DATA=DIR [ROWS="photographs ablation"] [SEEDS="1 2 3"] [STEPS=1500] [MINUTES=10] bench/hash.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
data=${TESSERA_SHARED_DATA:?names no folder; it must hold fox/}
[ -d "$data/fox" ] || die "$data/fox: no such folder"
work=$out/hash
seeds=${SEEDS:-1 2 3}
steps=${STEPS:-1500} minutes=${MINUTES:-10}
settings "STEPS=$steps MINUTES=$minutes"
[ -e "$work/fox/transforms.json" ] || "$tessera" import "$data/fox" "$work/fox" --downscale 2 --holdout every:8
[ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2 --size 400x300

# One unbounded block, as in the paper, about photographs from all around; four and their surround in the city.
declare -A blocks=([fox]="--blocks 1x1 --set surround=border" [city]="--blocks 2x2")

photographs() {
  trained fox-hash fox --method hash ${blocks[fox]} --minutes "$minutes"
  trained fox-field fox --method field --minutes "$minutes"
  local hash field
  hash=$(judged fox-hash fox) field=$(judged fox-field fox)
  echo "fox, $minutes minutes: $hash dB, field $field dB"
  verdict "hash less field at equal time, held-out PSNR in dB" "$(shortfall "$hash" "$field")" '>=' -1
}

arithmetic() { "$tessera" info "$work/$1" --json | jq .multiply_accumulates_per_sample; }

# gain CAPTURE ONE OTHER: of seeds, mean and the ends of its 95 % interval.
gain() {
  local seed gains=""
  for seed in $seeds; do
    gains+=" $(shortfall "$(jq .psnr "$work/$1-$2-$seed.json")" "$(jq .psnr "$work/$1-$3-$seed.json")")"
  done
  interval $gains
}

ablation() {
  local capture way seed mean low high
  declare -A ways=([attention]="--set aggregation=attention" [sum]="--set aggregation=sum" [mlp]="--set aggregation=mlp")
  for capture in fox city; do
    for seed in $seeds; do
      for way in attention sum mlp; do
        trained "$capture-$way-$seed" "$capture" --method hash ${blocks[$capture]} ${ways[$way]} --steps "$steps" \
          --seed "$seed"
        echo "$capture, $way, seed $seed: $(judged "$capture-$way-$seed" "$capture") dB"
      done
    done
    read -r mean low high <<< "$(gain "$capture" attention sum)"
    echo "$capture: attention less the sum $mean dB, 95 % interval $low to $high (seeds $seeds)"
    verdict "$capture: attention less the sum, held-out PSNR in dB" "$mean" '>=' 0.2
    verdict "the lower end of its 95 % interval" "$low" '>=' 0
    read -r mean low high <<< "$(gain "$capture" attention mlp)"
    echo "$capture: attention less the network $mean dB, 95 % interval $low to $high (seeds $seeds)"
    verdict "$capture: attention less a network for each sample, held-out PSNR in dB" "$mean" '>=' -0.4
  done
  local field=fox-field
  [ -e "$work/$field/manifest.json" ] || field=fox-field-begun
  [ -e "$work/$field/manifest.json" ] || trained "$field" fox --method field --steps 1
  echo "multiply-accumulates a sample: attention $(arithmetic "fox-attention-${seeds%% *}")," \
    "mlp $(arithmetic "fox-mlp-${seeds%% *}"), field $(arithmetic "$field")"
  verdict "attention's arithmetic as a share of field's" \
    "$(awk -v a="$(arithmetic "fox-attention-${seeds%% *}")" -v b="$(arithmetic "$field")" 'BEGIN { print a / b }')" '<=' 0.1
}

for row in ${ROWS:-photographs ablation}; do "$row"; done
finish
