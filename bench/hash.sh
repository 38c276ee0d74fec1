#!/usr/bin/env bash
# NGP-RT's models (`--method hash`) on the CPU: hand-held photographs (fox at 270x480) and a synthetic city of 2x2 blocks.
#   photographs  ten minutes on fox, and ten of `field`: at most 1 dB below it
#   scene        the scene baked from fox's model: held-out PSNR, size, samples per ray with and without the distance grids,
#                frames per second beside `field`, multiply-accumulates of both
#   ablation     the paper's table 3 with equal steps, held-out PSNR over seeds: attention (separate, varying in space) against
#                the sum of levels and against a network for each sample
#   distortion   the weight of the distortion loss that `auto` determines, against three given ones
#   browser      ten held-out views of the scenes of fox and the city in Debian's Chromium, against the renderer on the CPU
# Resumable: everything is kept in build/bench/hash, and what exists is not made again.
#   TESSERA_SHARED_DATA=DIR [ROWS="photographs scene ablation distortion browser"] [SEEDS="1 2 3"] [STEPS=1500] [MINUTES=10] bench/hash.sh
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

# One unbounded block, as in the paper, for photographs from all around; four and a background block in the city.
declare -A blocks=([fox]="--blocks 1x1 --set background_block=border" [city]="--blocks 2x2")

photographs() {
  trained fox-hash fox --method hash ${blocks[fox]} --minutes "$minutes"
  trained fox-field fox --method field --minutes "$minutes"
  local hash field
  hash=$(judged fox-hash fox) field=$(judged fox-field fox)
  echo "fox, $minutes minutes: $hash dB, field $field dB"
  verdict "hash less field at equal time, held-out PSNR in dB" "$(shortfall "$hash" "$field")" '>=' -1
}

# said FILE EXPRESSION: evaluates a jq expression on the output of a benchmark of the scene.
said() { jq -r "$2" "$work/$1.json"; }

scene() {
  baked fox-hash fox.scene fox
  local model seen bytes parameters
  model=$(jq .psnr "$work/fox-hash.json") seen=$(judged fox.scene fox > /dev/null; jq .psnr "$work/fox.scene.json")
  verdict "the model less its scene, held-out PSNR in dB" "$(shortfall "$model" "$seen")" '<=' 0.1
  verdict "field less the scene, held-out PSNR in dB" "$(shortfall "$(jq .psnr "$work/fox-field.json")" "$seen")" '<=' 0.4
  bytes=$("$tessera" info "$work/fox.scene" --json | jq .level_0.bytes_on_disk)
  parameters=$("$tessera" info "$work/fox-hash" --json | jq .parameters_per_block)
  echo "fox.scene: $bytes bytes, its model $parameters numbers"
  verdict "bytes of the scene as a share of the model's numbers at four bytes" \
    "$(awk -v b="$bytes" -v p="$parameters" 'BEGIN { print b / (4 * p) }')" '<=' 0.3
  alone "$tessera" bench render "$work/fox.scene" --views "$work/fox" --json "$work/skipping.json"
  local counts='.skipping | (.by_cells.steps - .skipping.steps)'
  echo "marching points a ray: $(said skipping '.skipping | .by_cells.steps / .rays') by occupancy alone," \
    "$(said skipping '.skipping | .skipping.steps / .rays') with distances; samples" \
    "$(said skipping '.skipping | .skipping.samples / .rays')"
  verdict "samples with distances less those without" "$(said skipping '.skipping | .skipping.samples - .by_cells.samples')" '<=' 0
  verdict "samples without distances less those with" "$(said skipping '.skipping | .by_cells.samples - .skipping.samples')" '<=' 0
  verdict "points saved as a share of all" "$(said skipping "$counts / .by_cells.steps")" '>=' 0.4
  verdict "points saved as a share of those in empty space" \
    "$(said skipping "$counts / (.by_cells.steps - .by_cells.samples)")" '>=' 0.4
  verdict "rays a second with distances against without" \
    "$(said skipping '.skipping | .skipping.rays_per_second / .by_cells.rays_per_second')" '>=' 1.02
  alone "$tessera" bench render "$work/fox.scene" --views "$work/fox" --against "$work/fox-field" --json "$work/against.json"
  said against '.against | to_entries[] | select(.key != "device" and .key != "culled_psnr_against_unculled") |
    "\(.key): \(.value.frames_per_second) frames a second, \(.value.densities_per_ray) densities and " +
    "\(.value.samples_per_ray) samples a ray"'
  echo "images of field, culled against not: $(said against .against.culled_psnr_against_unculled) dB"
  verdict "frames a second against field's with the same culling" "$(said against .against.field_culled.times)" '>=' 4
  verdict "frames a second against field's with its own occupancy" "$(said against .against.field.times)" '>=' 4
  arithmetic
}

info() { "$tessera" info "$work/$1" --json | jq ".$2"; }
ratio() { awk -v a="$1" -v b="$2" 'BEGIN { printf "%.3f\n", a / b }'; }
# Multiply-accumulates with and without the view-dependent network, which `hash` evaluates per ray and `field` per sample; per ray
# with the samples that the rays of held-out views have.
arithmetic() {
  local hash field hash_network field_network
  hash=$(info fox-hash multiply_accumulates_per_sample) field=$(info fox-field multiply_accumulates_per_sample)
  hash_network=$(info fox-hash view_dependent_multiply_accumulates_per_ray)
  field_network=$(info fox-field view_dependent_multiply_accumulates_per_sample)
  local samples of_field densities per_ray_hash per_ray_field
  samples=$(said against .against.scene.samples_per_ray)
  of_field=$(said against .against.field_culled.samples_per_ray)
  densities=$(said against .against.field_culled.densities_per_ray)
  echo "multiply-accumulates per sample without the view-dependent network: hash $hash, field $field, $(ratio "$hash" "$field")"
  per_ray_hash=$(awk -v a="$hash" -v n="$hash_network" -v s="$samples" 'BEGIN { print a + n / s }')
  echo "per sample with it: hash $per_ray_hash ($hash_network a ray), field $((field + field_network))," \
    "$(ratio "$per_ray_hash" $((field + field_network)))"
  verdict "hash without it as a share of field with it (as in the paper)" "$(ratio "$hash" $((field + field_network)))" '<=' 0.1
  per_ray_hash=$(awk -v a="$hash" -v s="$samples" 'BEGIN { print a * s }')
  per_ray_field=$(awk -v a="$field" -v d="$densities" 'BEGIN { print a * d }')
  echo "per ray without it: hash $per_ray_hash, field $per_ray_field, $(ratio "$per_ray_hash" "$per_ray_field")"
  per_ray_hash=$(awk -v a="$per_ray_hash" -v n="$hash_network" 'BEGIN { print a + n }')
  per_ray_field=$(awk -v a="$per_ray_field" -v n="$field_network" -v s="$of_field" 'BEGIN { print a + n * s }')
  echo "per ray with it: hash $per_ray_hash, field $per_ray_field, $(ratio "$per_ray_hash" "$per_ray_field")"
}

# gain CAPTURE ONE OTHER: prints the mean over seeds and the ends of its 95 % interval.
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
          --seed "$seed" --set lod_step_fraction=0
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
}

distortion() {
  local capture file weight best
  for capture in fox city; do
    file=$work/$capture-auto/distortion.json
    trained "$capture-auto" "$capture" --method hash ${blocks[$capture]} --set distortion_weight=auto --steps "$steps" --set lod_step_fraction=0
    echo "$capture: $(judged "$capture-auto" "$capture") dB with distortion=$(jq .chosen "$file"); after" \
      "$(jq -r '"\(.steps) steps " + ([.probes[] | "\(.distortion): \(if .psnr then .psnr * 100 | round / 100 else "no" end) dB"] | join(", "))' "$file")"
    best=0
    for weight in 0.001 0.01 0.03; do
      trained "$capture-distortion-$weight" "$capture" --method hash ${blocks[$capture]} --set distortion_weight="$weight" --steps "$steps" \
        --set lod_step_fraction=0
      echo "$capture, $weight: $(judged "$capture-distortion-$weight" "$capture") dB"
      best=$(jq "[.psnr, $best] | max" "$work/$capture-distortion-$weight.json")
    done
    verdict "$capture: the best of three weights less the one found out, held-out PSNR in dB" \
      "$(shortfall "$best" "$(jq .psnr "$work/$capture-auto.json")")" '<=' 0.1
  done
}

browser() {
  trained fox-hash fox --method hash ${blocks[fox]} --minutes "$minutes"
  baked fox-hash fox.scene fox
  trained city-attention-1 city --method hash ${blocks[city]} --set aggregation=attention --steps "$steps" --seed 1 --set lod_step_fraction=0
  baked city-attention-1 city.scene city
  tools/install-debian-packages.sh --browser
  tools/build-web.sh
  local place=$PWD/$work
  export SCENES="$place/fox.scene $place/fox $place/city.scene $place/city" OUT=$place/browser
  TESSERA=$(realpath "$tessera")
  export TESSERA
  (cd web && xvfb-run -a -s "-screen 0 1280x1024x24 -noreset" npx vitest run bench/hash.ts --config vitest.bench.config.ts --disable-console-intercept) || failures=$((failures + 1))
}

for row in ${ROWS:-photographs scene ablation distortion browser}; do "$row"; done
finish
