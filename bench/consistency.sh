#!/usr/bin/env bash
# City-on-Web's ablation (table 5) on the CPU, in a synthetic city of 2x2 blocks. All models take the same number of steps with the
# same number of rays; baked scenes are evaluated.
#   consistency  blocks trained together against blocks trained separately and merged. Each separate model has a background
#                block of its own (which covers only what is behind its box) and a quarter of the rays, all of which pass
#                through its block (and as many points of the sparsity loss per block: 4096 in five, 1638 in two). The
#                merged model uses the background block of the joint one.
#   resolution   four blocks against one block of their size together, with twice the resolution along each axis, tables
#                four times as large, and every distance that settings measure in blocks halved.
# Resumable: everything is kept in build/bench/consistency, and what exists is not made again.
#   [ROWS="consistency resolution"] [SEEDS="1 2 3"] [STEPS=1500] [RAYS=4096] [CITY="--size 400x300"] bench/consistency.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
programs=$(dirname "$tessera")/../../bench
for program in merge_blocks border_error; do
  [ -x "$programs/$program" ] || die "$programs/$program: not built; run: cmake --build --preset release"
done
work=$out/consistency
seeds=${SEEDS:-1 2 3}
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
value() { jq -r "$2 | . * pow(10; ${3:-3}) | round / pow(10; ${3:-3})" "$work/$1"; }
border() {
  local of=$1-border.json
  echo "$1: $(value "$1-scene.json" .psnr 2) dB; mean squared error at walls $(value "$of" .border.mse 5)," \
    "elsewhere in blocks $(value "$of" .interior.mse 5), ratio $(value "$of" .mse_ratio), of roots $(value "$of" .rmse_ratio)"
}
consistency() {
  local seed block apart gains="" ratios="" mean low high ratio
  for seed in $seeds; do
    joint "$seed"
    apart=()
    for block in 0 1 2 3; do
      grid "block-$block" ".grid.origin = .blocks[$block].centre | .grid.columns = 1 | .grid.rows = 1"
      volume "apart-$seed-$block" "$seed" $((rays / 4)) --grid "$work/block-$block.json" --set blocks_only=true \
        --set sparsity_points=1638
      apart+=("$work/apart-$seed-$block")
    done
    [ -e "$work/merged-$seed/manifest.json" ] ||
      "$programs/merge_blocks" "$work/joint-$seed" "$work/merged-$seed" "${apart[@]}"
    scene "joint-$seed"
    scene "merged-$seed"
    border "joint-$seed"
    border "merged-$seed"
    gains+=" $(shortfall "$(jq .psnr "$work/joint-$seed-scene.json")" "$(jq .psnr "$work/merged-$seed-scene.json")")"
    ratios+=" $(jq .rmse_ratio "$work/joint-$seed-border.json")"
  done
  read -r mean low high <<< "$(interval $gains)"
  read -r ratio _ <<< "$(interval $ratios)"
  echo "together less apart: $mean dB, 95 % interval $low to $high (seeds $seeds)"
  verdict "blocks trained together less apart, held-out PSNR of the scenes in dB" "$mean" '>=' 0.3
  verdict "the lower end of its 95 % interval" "$low" '>=' 0
  verdict "trained together: error at walls as a share of that in the blocks, mean of seeds" "$ratio" '<=' 1.05
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
  grid whole '.grid.edge *= 2 | .grid.columns = 1 | .grid.rows = 1'
  volume "$one" "$seed" "$rays" --grid "$work/whole.json" --set voxels=256 --set planes=1024 --set grid_log2_size=19 \
    --set grid_finest=1024 --set proposal_log2_size=16 --set proposal_finest=256 --set near=0.025 \
    --set full_gradient_distance=0.5
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

for row in ${ROWS:-consistency resolution}; do "$row"; done
finish
