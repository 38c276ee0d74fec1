#!/usr/bin/env bash
# City-on-Web's ablation (table 5) on the CPU, in a synthetic city of 2x2 blocks: blocks trained jointly against blocks trained
# separately and merged. Baked scenes are evaluated. Each separate model has a background block of its own (which covers only what
# is behind its box), and all of its rays pass through its block. The merged model uses the background block of the joint one.
#   equal_rays   equal total rays: a separate block gets a quarter of the rays of a joint step (and as many points of the sparsity
#                loss per block: 4096 in five, 1638 in two), in as many steps
#   equal_steps  equal steps with equal rays per step, and equal points of the sparsity loss (4096, in two blocks instead of five):
#                the separate blocks together get four times the rays
#   seams        error at the walls between blocks relative to that in the blocks, of the joint models, and of single-block models
#                without walls as control: the content at the walls may be harder or easier than elsewhere
#   resolution   four blocks against one block of their size together, with twice the resolution along each axis, tables four times
#                as large, and every distance that settings measure in blocks halved (the control of `seams`)
# Resumable: everything is kept in build/bench/consistency, and what exists is not made again. LPIPS needs
# TESSERA_SHARED_DATA or LPIPS=FILE.
#   [ROWS="equal_rays equal_steps seams resolution"] [SEEDS="1 2 3 4 5"] [STEPS=1500] [RAYS=4096] [CITY="--size 400x300"]
#   bench/consistency.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
programs=$(dirname "$tessera")/../../bench
for program in merge_blocks border_error; do
  [ -x "$programs/$program" ] || die "$programs/$program: not built; run: cmake --build --preset release"
done
work=$out/consistency
seeds=${SEEDS:-1 2 3 4 5}
steps=${STEPS:-1500} rays=${RAYS:-4096}
settings "STEPS=$steps RAYS=$rays CITY='${CITY:-}'"
[ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2 ${CITY:-}

# volume MODEL SEED RAYS ARGUMENTS...: trains with a capacity for texels that no number of rays exceeds, so that the number of rays
# is constant.
volume() {
  local model=$1 seed=$2 number=$3
  shift 3
  trained "$model" city --method volume --seed "$seed" --steps "$steps" --set lod_step_fraction=0 \
    --set first_rays="$number" --set max_rays="$number" --set texels_per_step=$((512 * number)) "$@"
}
joint() { volume "joint-$1" "$1" "$rays" --blocks 2x2; }
# grid NAME JQ: writes $work/NAME.json, the joint blocks changed by JQ. The capture determines them, whatever the seed.
grid() { jq "$2" "$work/joint-${seeds%% *}/blocks.json" > "$work/$1.json"; }
# scene MODEL: bakes it, and evaluates the scene as a whole and along the walls of the joint blocks.
scene() {
  baked "$1" "$1-scene" city
  judged "$1-scene" city > /dev/null
  [ -s "$work/$1-border.json" ] ||
    "$programs/border_error" "$work/$1-scene" "$work/city" "$work/joint-${seeds%% *}/blocks.json" > "$work/border.partial"
  [ -s "$work/$1-border.json" ] || mv "$work/border.partial" "$work/$1-border.json"
}
# value FILE EXPRESSION [DIGITS]
value() { jq -r "$2 | if . == null then \"unknown\" else . * pow(10; ${3:-3}) | round / pow(10; ${3:-3}) end" "$work/$1"; }
border() {
  local of=$1-border.json
  echo "$1: $(value "$1-scene.json" .psnr 2) dB, LPIPS $(value "$1-scene.json" .lpips 4);" \
    "mean squared error at walls $(value "$of" .border.mse 5)," \
    "elsewhere in blocks $(value "$of" .interior.mse 5), ratio $(value "$of" .mse_ratio), of roots $(value "$of" .rmse_ratio)"
}
# separate PROTOCOL RAYS POINTS SEED: trains the blocks one by one with so many rays and points of the sparsity loss per step, and
# merges them.
separate() {
  local protocol=$1 number=$2 points=$3 seed=$4 block parts=()
  for block in 0 1 2 3; do
    grid "block-$block" ".grid.origin = .blocks[$block].centre | .grid.columns = 1 | .grid.rows = 1"
    volume "$protocol-$seed-$block" "$seed" "$number" --grid "$work/block-$block.json" --set blocks_only=true \
      --set sparsity_points="$points"
    parts+=("$work/$protocol-$seed-$block")
  done
  [ -e "$work/$protocol-$seed/manifest.json" ] ||
    "$programs/merge_blocks" "$work/joint-$seed" "$work/$protocol-$seed" "${parts[@]}"
}
# gains PROTOCOL KEY: prints what the joint scene of each seed has more of than the separate one.
gains() {
  local seed
  for seed in $seeds; do
    shortfall "$(jq "$2" "$work/joint-$seed-scene.json")" "$(jq "$2" "$work/$1-$seed-scene.json")"
  done
}
# against PROTOCOL RAYS POINTS: compares joint with separate training over all seeds.
against() {
  local seed model mean low high
  for seed in $seeds; do
    joint "$seed"
    separate "$1" "$2" "$3" "$seed"
    for model in "joint-$seed" "$1-$seed"; do
      scene "$model"
      border "$model"
    done
  done
  read -r mean low high <<< "$(interval $(gains "$1" .psnr))"
  echo "$1, joint less separate: $mean dB, 95 % interval $low to $high (seeds $seeds)"
  [ -z "$lpips" ] || echo "$1, LPIPS, joint less separate (lower is better): $(interval $(gains "$1" .lpips)) (mean, 95 % interval)"
}
equal_rays() {
  local mean low
  against separate $((rays / 4)) 1638
  read -r mean low _ <<< "$(interval $(gains separate .psnr))"
  verdict "joint less separate at equal total rays, held-out PSNR of the scenes in dB" "$mean" '>=' 0.3
  verdict "the lower end of its 95 % interval" "$low" '>=' 0
}
equal_steps() { against separate-steps "$rays" 4096; }

whole() {
  grid whole '.grid.edge *= 2 | .grid.columns = 1 | .grid.rows = 1'
  volume "whole-$1" "$1" "$rays" --grid "$work/whole.json" --set voxels=256 --set planes=1024 --set grid_log2_size=19 \
    --set grid_finest=1024 --set proposal_log2_size=16 --set proposal_finest=256 --set near=0.025 \
    --set full_gradient_distance=0.5
}
seams() {
  local seed model joint="" control="" ratio
  for seed in $seeds; do
    joint "$seed"
    whole "$seed"
    for model in "joint-$seed" "whole-$seed"; do
      scene "$model"
      border "$model"
    done
    joint+=" $(jq .rmse_ratio "$work/joint-$seed-border.json")"
    control+=" $(jq .rmse_ratio "$work/whole-$seed-border.json")"
  done
  read -r ratio _ <<< "$(interval $joint)"
  echo "root mean squared error at walls relative to that in the blocks: joint $(interval $joint)," \
    "one block without walls $(interval $control) (mean, 95 % interval; seeds $seeds)"
  verdict "joint: error at walls as a share of that in the blocks, mean of seeds" "$ratio" '<=' 1.05
}

# seconds SCENE: prints the seconds per frame of the median view (the first view loads the tiles).
seconds() {
  alone "$tessera" eval "$work/$1" "$work/city" --json "$work/seconds.json" --report "$work/seconds.html" > /dev/null
  jq '[.views[].seconds] | sort | .[length / 2 | floor]' "$work/seconds.json"
}
# share FOUR ONE EXPRESSION: prints the ratio of a value that `info` reports of the two scenes.
share() {
  awk -v a="$(jq "$3" "$work/$1-info.json")" -v b="$(jq "$3" "$work/$2-info.json")" 'BEGIN { printf "%.3f\n", a / b }'
}

resolution() {
  local seed=${seeds%% *} four one round fastest_four=1e9 fastest_one=1e9 what whole
  four=joint-$seed one=whole-$seed
  joint "$seed"
  whole "$seed"
  for what in "$four" "$one"; do
    scene "$what"
    border "$what"
    "$tessera" info "$work/$what-scene" --json > "$work/$what-info.json"
  done
  for round in 1 2 3; do
    fastest_four=$(awk -v a="$fastest_four" -v b="$(seconds "$four-scene")" 'BEGIN { print a < b ? a : b }')
    fastest_one=$(awk -v a="$fastest_one" -v b="$(seconds "$one-scene")" 'BEGIN { print a < b ? a : b }')
  done
  for what in "$four" "$one"; do
    echo "$what: $(jq -r '"blocks \(.level_0.bytes_in_memory) bytes in memory, \(.level_0.bytes_on_disk) on disk; " +
      "background block \(.background_block_0.bytes_in_memory) and \(.background_block_0.bytes_on_disk)"' "$work/$what-info.json")"
  done
  verdict "four blocks less one of twice the resolution, held-out PSNR in dB" \
    "$(shortfall "$(jq .psnr "$work/$four-scene.json")" "$(jq .psnr "$work/$one-scene.json")")" '>=' 0
  whole=.bytes_in_memory
  verdict "their memory as a share, without background blocks" "$(share "$four" "$one" .level_0$whole)" '<=' 1
  verdict "with background blocks" "$(share "$four" "$one" ".level_0$whole + .background_block_0$whole")" '<=' 1
  verdict "their bytes on disk as a share, without background blocks" "$(share "$four" "$one" .level_0.bytes_on_disk)" '<=' 1
  echo "a frame in $fastest_four s, of the one block in $fastest_one s"
  verdict "their time a frame as a share" \
    "$(awk -v a="$fastest_four" -v b="$fastest_one" 'BEGIN { printf "%.3f\n", a / b }')" '<=' 1
}

for row in ${ROWS:-equal_rays equal_steps seams resolution}; do "$row"; done
finish
