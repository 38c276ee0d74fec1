#!/usr/bin/env bash
# Meshes with neural textures (`--method mesh`) on the CPU.
#   traversal    rays per second on a grid of octahedra against Embree, which collects all hits of the same rays on the same
#                triangles in order of distance: a synthetic grid, and trained models if there are any (those that MODEL names,
#                and those in build/bench/mesh); and how long Embree takes for a new hierarchy after a step has moved the vertices
#   city         a city of 2x2 blocks, 15 minutes with coarse field and final stage: held-out PSNR of the baked scene and of its
#                levels, beside `field` in the same time; bytes, triangles and time of baking; its contents as glTF files; the bytes
#                of a block with stored and with inferred maps
#   levels       that scene's coarser levels in views whose pixels match their texels: photos of half the size for level 1, of a
#                quarter for level 2, against the next finer level in the same views; triangles relative to the next finer level
#   final        one block of the city with and without the final stage, in the same time, without coarser levels, three seeds;
#                the whole city likewise, with coarser levels, once; what each step from its model to contents loses, how many faces
#                are kept, and what opacities of 0 and 1 alone would lose
#   holes        200 fresh views of that city from other heights: the share of pixels in which the scene's blocks have a hole, at the
#                finest level and with levels mixed
#   losses       one block with both losses and with the first alone, three seeds: PSNR of the scenes without the final stage, also
#                without the distortion loss, with the final stage, and without seven more additions to the paper
#   alpha        the city's scene with the opacities of texels as trained, and with 1 from 0.5 on and else 0: held-out PSNR of all
#                pixels, and of those of trees and of water
#   preset       one block with other numbers of cells, texels, table entries, features and layers than those of `cpu`, in the
#                same time, with the first seed: held-out PSNR, SSIM and LPIPS, triangles, bytes
#   quads        one block of octahedra and of MobileNeRF's quads, in the same time, three seeds, also by the pixels of roofs and of
#                wires alone; and with equal numbers of triangles, without the final stage
#   depth        one block with and without the loss of depths at sparse points, and with a weight of 0.03 in place of 1, three
#                seeds: errors of depth, PSNR
#   views        brighton_beach with and without views between the photos, three seeds, in the same time and with equal steps
#   traffic      one block of a city with cars that move, in the same time, three seeds: with their masks, with `transient=auto`
#                and without masks, in the held-out photos of the same city without cars; how well the masks that training makes
#                match the true ones
#   borders      the error of the city's scene near walls between blocks against that elsewhere, and the same of a scene with one
#                block in place of four
#   processes    four blocks as four processes and one after another: equal bytes
#   killed       killed at ten random moments or more, at least one in the final stage and one in the extraction of
#                triangles, and baking at three: equal bytes
#   memory       peak memory of baking six blocks, of rendering their model, and of both for one block
#   vulkan       300 steps with `vulkan` against `cpu`: PSNR of the training photos
#   frames       images of that scene on a GPU, or on a Vulkan driver for the CPU, against those on the CPU: exact ones, the
#                mean of 64 dithered frames, and each frame of a flight
#   browser      that scene in Debian's Chromium with Mesa's OpenGL on the CPU: images against those on the CPU, distances between
#                picked places against the truth, frame time and triangles of each level, and frame time of `volume` of the same
#                place (trained for as long, unless build/bench/mesh/city-volume.scene exists)
#   maps         that scene with stored and with inferred maps, without ordinary meshes, through Vulkan: images, bytes that are
#                read, memory, and seconds until the image is complete, inferred on the CPU and on the GPU
#   flight       a city of 4x4 blocks, barely trained, in a flight of 600 steps with a quarter of the finest level's memory, through
#                Vulkan with stored and with inferred maps, and in the browser with stored ones: never over the budget, never
#                blank; the memory of the scene of `maps` with room for everything, and its first image in the browser, on networks
#                of several speeds
#   mobilenerf   only with JAX3D: that scene as `tessera export --format mobilenerf` writes it, in the viewer of MobileNeRF's authors, in
#                the same browser at that viewer's own size, 1256x828: images against those on the CPU, the frame times of both viewers
#                in turns, and bytes. JAX3D is a copy of https://github.com/google-research/jax3d, whose page
#                jax3d/projects/mobilenerf/view_unbounded.html is shown unchanged, with three.js of its time (npm's three 0.151.3)
#   fallback     the ordinary glTF meshes in the contents of that scene's finest level, in Blender, assimp and three.js: they load with
#                the same numbers of triangles; and held-out views of three.js and Blender, without mipmaps and antialiasing, against
#                the scene without view dependence (every hit has the base colour of its texels), the scene as it is, an
#                implementation by Embree of what glTF says, and photos without distortion. Where no triangle covers a pixel, the
#                scene's sky is put in. Needs blender, python3-numpy, assimp-utils and chromium of Debian
#   gltf         that scene's finest level as `tessera export --format gltf` writes it, in one file: errors of glTF-Validator, and
#                Blender and three.js as for `fallback`
#   yardstick    that scene against the city's true triangles with as many texels, coloured by the training photos: an ideal
#                photogrammetric mesh
#   fox, beach   real photographs, 10 minutes each: held-out PSNR of the baked scene
# What a pixel shows is known from the generator of the city (mesh_classes.cpp).
# Resumable: everything is kept in build/bench/mesh, and what exists is not made again; remove traversal-* there to repeat a row.
#   [ROWS="traversal city levels …"] [SEEDS="1 2 3"] [MODEL=DIR] [CAPTURE=DIR] [TESSERA_SHARED_DATA=DIR] bench/mesh.sh
#   JAX3D=DIR ROWS=mobilenerf [VIEWS=5] [ONLY=images|frames] bench/mesh.sh
# CAPTURE: the capture of MODEL, if it is not where its blocks.json says.
set -euo pipefail
source "$(dirname "$0")/setup.sh"
work=$out/mesh
mkdir -p "$work"
[ -z "$lpips" ] || export LPIPS=$lpips  # for the programs of this folder

# traced NAME ARGUMENTS...: compares the traversals once, prints the results, and checks that they are comparable.
traced() {
  local program=build/release/bench/octahedra_embree file=$work/traversal-$1.json
  shift
  if [ ! -s "$file" ]; then
    [ -x "$program" ] || die "$program: not built; run: tools/build.sh release octahedra_embree"
    alone "$program" "$@" 2> "$file.log" > "$file.part" || die "$(tail -n 1 "$file.log")"
    rm "$file.log"
    mv "$file.part" "$file"
  fi
  jq -r '.cases[] | (.orders[].table, .table)' "$file"
  local name order share ratio
  while IFS=$'\t' read -r name order share ratio; do
    verdict "$name, $order: share of rays with the same faces as by Embree" "$share" '>=' 0.999
    verdict "$name, $order: rays per second, relative to Embree's" "$ratio" '>=' 1
  done < <(jq -r '.cases[] | .name as $name | .orders[] |
    [$name, .order, .agreement.share_with_equal_faces, (.ratio * 100 | round / 100)] | @tsv' "$file")
}

traversal() {
  traced synthetic synthetic
  [ -z "${MODEL:-}" ] || traced "$(basename "$MODEL")" "$MODEL" ${CAPTURE:+"$CAPTURE"}
  local manifest
  for manifest in "$work"/*/manifest.json; do
    case "$(basename "$(dirname "$manifest")")" in tiny-*) continue ;; esac
    if [ -e "$manifest" ] && [ "$(jq -r .method "$manifest")" = mesh ]; then
      traced "$(basename "$(dirname "$manifest")")" "$(dirname "$manifest")"
    fi
  done
}

# chained MODEL CAPTURE: what each step from the model to its contents loses, with patches of 8, 12 and 16 texels. The checks are
# those of the default, 12.
chained() {
  local program=build/release/bench/mesh_chain edge file
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_chain"
  for edge in 8 12 16; do
    file=$work/chain-$1-$edge.json
    if [ ! -s "$file" ]; then
      "$program" "$work/$1" "$work/$2" "$edge" > "$file.part"
      mv "$file.part" "$file"
    fi
    if [ "$edge" -eq 12 ]; then
      verdict "$1, share of the faces in the blocks that are kept" "$(jq .kept_share "$file")" '<=' 0.05
      verdict "$1, faces kept for each cell with some" "$(jq .kept_per_cell "$file")" '<=' 6
      verdict "$1, loss by dropped faces in dB" "$(shortfall "$(jq .model.psnr "$file")" "$(jq .kept_faces.psnr "$file")")" '<=' 0.5
      verdict "$1, loss by texels of 8 bits, $edge along an edge, in dB" \
        "$(shortfall "$(jq .kept_faces.psnr "$file")" "$(jq .texels_of_8_bits.psnr "$file")")" '<=' 0.35
      verdict "$1, loss by BC4 in dB" \
        "$(shortfall "$(jq '.["opaque_from_0.8"].psnr' "$file")" "$(jq .bc4_fast.psnr "$file")")" '<=' 0.1
    fi
    jq -r --arg edge "$edge" '"patches of \($edge) texels: model \(.model.psnr), faces seen \(.seen_faces.psnr), kept \(.kept_faces.psnr), " +
      "8 bits \(.texels_of_8_bits.psnr), opacities of 0 and 1 alone \(.["binarised_at_0.5"].psnr), " +
      "as stored, opaque from 0.8 \(.["opaque_from_0.8"].psnr) with \(.["opaque_from_0.8"].hits_per_ray) hits a ray, " +
      "BC4 \(.bc4_fast.psnr), exhaustive \(.bc4_exhaustive.psnr // "not tried") dB; \(.triangles) triangles, " +
      "\(.texel_bytes_bc4 / 1e6) MB of texels in BC4, \(.texel_bytes_rgba / 1e6) MB in three RGBA8 textures; extraction \(.extraction_seconds) s, baking \(.bake_seconds) s"' "$file"
  done
}

# counted MODEL CAPTURE: bakes the model, and saves what its scene has.
counted() {
  local seconds=$SECONDS
  if [ ! -e "$work/$1.scene/tileset.json" ]; then
    "$tessera" bake "$work/$1" "$work/$1.scene" --capture "$work/$2" --json > "$work/$1.bake.json"
    jq --argjson seconds $((SECONDS - seconds)) '. + {seconds: $seconds}' "$work/$1.bake.json" > "$work/$1.part"
    mv "$work/$1.part" "$work/$1.bake.json"
  fi
}

# scene MODEL CAPTURE: bakes the model, and prints what its scene has and how it looks.
scene() {
  local level
  counted "$1" "$2"
  for level in $(jq -r '.levels | keys[]' "$work/$1.bake.json"); do
    judged "$1.scene" "$2" "$level" > /dev/null
    jq -r --argjson level "$level" --slurpfile eval "$work/$1.scene-lod$level.json" '.levels[$level] | "level \($level): " +
      "\(.triangles) triangles, \(.bytes_on_disk / 1e6) MB on disk with an ordinary mesh, \(.bytes_in_memory / 1e6) MB in memory; " +
      "PSNR \($eval[0].psnr), SSIM \($eval[0].ssim), LPIPS \($eval[0].lpips)"' "$work/$1.bake.json"
  done
  verdict "$1, seconds of baking" "$(jq .seconds "$work/$1.bake.json")" '<=' 300
}

# valid SCENE: checks the contents with Khronos' glTF-Validator.
valid() {
  local errors
  [ -d web/node_modules/gltf-validator ] || tools/build-web.sh --packages-only
  errors=$(node bench/validate_gltf.mjs "$work/$1")
  verdict "$1, errors of glTF-Validator" "$errors" '<=' 0
}

# block_bytes SCENE: the bytes of the largest block of a city of 2x2 blocks: of all tiles in it, and of what they share.
block_bytes() {
  jq '.extensions.TESSERA_scene as $scene | ($scene.grid.columns / 2) as $edge |
    [.root | recurse(.children[]?) | .extensions.TESSERA_scene.cells as $cells | (.contents // [.content // empty])[] |
      .extensions.TESSERA_scene | select(.background_block | not) | {cells: $cells, bytes, resources}] as $contents |
    [range(2) as $j | range(2) as $i | [$contents[] |
      select(.cells[0] >= $i * $edge and .cells[2] <= ($i + 1) * $edge and
             .cells[1] >= $j * $edge and .cells[3] <= ($j + 1) * $edge)] |
      ([.[].bytes] | add) + ([.[].resources // [] | .[]] | unique | map($scene.resources[.].bytes) | add // 0)] | max' \
    "$work/$1/tileset.json"
}

# level_bytes SCENE [LEVEL]: the megabytes of the contents of a level with the background block, or of all levels.
level_bytes() {
  jq --argjson level "${2:-null}" '[.root | recurse(.children[]?) | (.extensions.TESSERA_scene.level // 0) as $tile |
    (.contents // [.content // empty])[] | .extensions.TESSERA_scene |
    select($level == null or (if .background_block then .level // 0 else $tile end) == $level) | .bytes] | add / 1e6' \
    "$work/$1/tileset.json"
}

# maps MODEL CAPTURE: what a block takes on disk with stored and with inferred maps, without ordinary meshes.
maps() {
  local kind
  for kind in stored inferred; do
    [ -e "$work/$1.$kind/tileset.json" ] ||
      "$tessera" bake "$work/$1" "$work/$1.$kind" --capture "$work/$2" --fallback 0 --maps "$kind" > /dev/null
    echo "$1, largest block, $kind maps: $(block_bytes "$1.$kind") bytes on disk"
  done
  valid "$1.inferred"
  verdict "$1, bytes of the largest block with inferred maps" "$(block_bytes "$1.inferred")" '<=' 15000000
}

city() {
  need_tessera
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  trained city-field city --method field --minutes 15
  echo "city 2x2 after 15 min: field $(judged city-field city) dB, mesh $(judged city-mesh city) dB"
  scene city-mesh city
  valid city-mesh.scene
  maps city-mesh city
  verdict "city 2x2, held-out PSNR of the scene in dB" "$(judged city-mesh.scene city 0)" '>=' 24
  verdict "city 2x2, field less the scene in dB" "$(shortfall "$(judged city-field city)" "$(judged city-mesh.scene city 0)")" '<=' 1.5
}

# block: one block of a city, for comparisons.
block() {
  need_tessera
  [ -e "$work/block/transforms.json" ] || "$tessera" synth city "$work/block" --blocks 1x1 --photos 26 --size 320x240
}

# seeded NAME ARGUMENTS...: trains that block for 5 minutes with each seed, bakes it, and prints the PSNR of each scene. There are no
# coarser levels, which take different times with and without a final stage.
seeded() { seeded_on block block "$1" --blocks 1x1 --minutes 5 --set mesh_levels=1 "${@:2}"; }

# seeded_on CAPTURE JUDGED NAME ARGUMENTS...: trains on one capture with each seed, bakes, and prints the PSNR of each scene in the
# held-out photos of another (or the same).
seeded_on() {
  local capture=$1 other=$2 name=$3 seed
  shift 3
  for seed in ${SEEDS:-1 2 3}; do
    trained "$name-$seed" "$capture" --method mesh --seed "$seed" "$@" >&2
    counted "$name-$seed" "$capture" >&2
    judged "$name-$seed.scene" "$other" 0
  done
}

# by_seed FUNCTION ARGUMENTS...: calls the function with one seed after another, so that trainings that are compared follow one
# another: the speed of a machine changes over hours.
by_seed() {
  local seed
  for seed in ${SEEDS:-1 2 3}; do SEEDS=$seed "$@" > /dev/null; done
}

# gained WHAT NAME OTHER FIELD [NAME_OF_FILES]: prints the mean of the differences of a number between the same seeds of two
# trainings, with its 95 % interval; `gain` is the mean.
gained() {
  local seed differences=()
  for seed in ${SEEDS:-1 2 3}; do
    differences+=("$(jq -n --slurpfile a "$work/$2-$seed${5:-.scene-lod0}.json" \
      --slurpfile b "$work/$3-$seed${5:-.scene-lod0}.json" "(\$a[0]$4) - (\$b[0]$4)")")
  done
  local mean low high
  read -r mean low high < <(interval "${differences[@]}")
  echo "$1: $mean, 95 % interval $low to $high (${differences[*]})"
  gain=$mean lowest=$low
}

with_and_without_final() {
  seeded final
  seeded plain --set final_share=0
}

final() {
  block
  by_seed with_and_without_final
  local with without
  with=$(seeded final)
  without=$(seeded plain --set final_share=0)
  echo "one block, 5 min: with the final stage" $with "dB, without" $without "dB"
  gained "gain of the final stage, SSIM" final plain .ssim
  gained "gain of the final stage in dB" final plain .psnr
  verdict "one block, gain of the final stage in dB" "$gain" '>=' 0.3
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  trained city-plain city --method mesh --minutes 15 --set final_share=0
  scene city-plain city
  verdict "city 2x2, gain of the final stage in dB" \
    "$(shortfall "$(judged city-mesh.scene city 0)" "$(judged city-plain.scene city 0)")" '>=' 0.3
  chained city-plain city
}

both_and_first() { # BOTH FIRST ARGUMENTS...
  seeded "$1" "${@:3}"
  seeded "$2" --set opaque_loss=false "${@:3}"
}

# second_loss WHAT BOTH FIRST ARGUMENTS...: what the second loss gains with these settings; BOTH and FIRST name the models.
second_loss() {
  by_seed both_and_first "${@:2}"
  local both first
  both=$(seeded "$2" "${@:4}")
  first=$(seeded "$3" --set opaque_loss=false "${@:4}")
  echo "one block, 5 min, $1: both losses" $both "dB, the first alone" $first "dB"
  local seed name
  for seed in ${SEEDS:-1 2 3}; do
    for name in "$2" "$3"; do classified "$name-$seed" block binarised --binarised; done
  done
  gained "$1, gain of the second loss, SSIM" "$2" "$3" .ssim
  gained "$1, gain of the second loss with opacities of 0 and 1 alone in dB" "$2" "$3" "[0].all.psnr" .binarised
  gained "$1, gain of the second loss in dB" "$2" "$3" .psnr
}

losses() {
  block
  second_loss "without the final stage" plain first --set final_share=0
  verdict "one block, gain of the second loss in dB" "$gain" '>=' 0.5
  second_loss "without the distortion loss, too, as in the paper" foggy foggy-first --set final_share=0 --set distortion_weight=0
  second_loss "with the final stage" final final-first
  second_loss "without seven more additions to the paper" bare bare-first --set final_share=0 --set distortion_weight=0 \
    --set through_share=0 --set surface_start=false --set random_background=false --set dropped_share=0 --set network_l2=0
}

# classified NAME CAPTURE FILE [--binarised]: the error of the scene NAME.scene by what pixels show, in NAME.FILE.json.
classified() {
  local program=build/release/bench/mesh_classes file=$work/$1.$3.json
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_classes"
  [ -s "$file" ] || {
    "$program" ${4:+"$4"} "$work/$1.scene" "$work/$2" > "$file.part"
    mv "$file.part" "$file"
  }
}

alpha() {
  need_tessera
  local of
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  classified city-mesh city classes
  classified city-mesh city binarised --binarised
  for of in all trees water; do
    jq -r --arg of "$of" --slurpfile binarised "$work/city-mesh.binarised.json" '.[0][$of] as $stored |
      $binarised[0][0][$of] as $bits | "city 2x2, \($of), \($stored.pixels) pixels: opacities as trained \($stored.psnr) dB, " +
      "binarised at 0.5 \($bits.psnr) dB"' "$work/city-mesh.classes.json"
  done
  jq -r '.[0].photos | "city 2x2: SSIM \(.ssim), LPIPS \(.lpips)"' "$work/city-mesh.classes.json"
  jq -r '.[0].photos | "city 2x2, binarised: SSIM \(.ssim), LPIPS \(.lpips)"' "$work/city-mesh.binarised.json"
}

preset() {
  block
  local seed=1 name change
  while IFS=: read -r name change; do
    SEEDS=$seed seeded "$name" $change > /dev/null
    jq -r --arg change "${change#--set }" --slurpfile eval "$work/$name-$seed.scene-lod0.json" '.levels[0] |
      "\(if $change == "" then "preset cpu" else $change end): PSNR \($eval[0].psnr), SSIM \($eval[0].ssim), " +
      "LPIPS \($eval[0].lpips); \(.triangles) triangles, \(.bytes_on_disk / 1e6) MB on disk with an ordinary mesh"' \
      "$work/$name-$seed.bake.json"
  done <<< "final:
texels-8:--set patch_texels=8
texels-16:--set patch_texels=16
cells-48:--set mesh_cells=48 --set patch_texels=16
cells-96:--set mesh_cells=96 --set patch_texels=8
table-16:--set grid_log2_size=16
table-19:--set grid_log2_size=19
hidden-2:--set hidden=2
hidden-3:--set hidden=3
features-4:--set grid_levels=8 --set grid_features=4"
}

octahedra_and_quads() {
  seeded final
  seeded quads --set quads=true
}
octahedra_and_quads_without_final() {
  seeded plain --set final_share=0
  seeded quads-plain --set final_share=0 --set quads=true
}

quads() {
  block
  by_seed octahedra_and_quads
  local octahedra quads
  octahedra=$(seeded final)
  quads=$(seeded quads --set quads=true)
  echo "one block, 5 min: octahedra" $octahedra "dB, quads" $quads "dB"
  gained "octahedra less quads, SSIM" final quads .ssim
  gained "octahedra less quads in dB" final quads .psnr
  verdict "one block, octahedra less quads in dB, lower end of the interval" "$lowest" '>=' 0
  local seed faces name class
  for seed in ${SEEDS:-1 2 3}; do
    classified "final-$seed" block classes
    classified "quads-$seed" block classes
  done
  for class in roofs wires; do gained "octahedra less quads in pixels of $class, in dB" final quads "[0].$class.psnr" .classes; done
  by_seed octahedra_and_quads_without_final
  for seed in ${SEEDS:-1 2 3}; do
    faces=$(jq '.levels[0].triangles' "$work/plain-$seed.bake.json" "$work/quads-plain-$seed.bake.json" | sort -n | head -1)
    for name in plain quads-plain; do
      [ -s "$work/$name-$seed.faces.json" ] || {
        build/release/bench/mesh_chain "$work/$name-$seed" "$work/block" 8 "$faces" > "$work/faces.part"
        mv "$work/faces.part" "$work/$name-$seed.faces.json"
      }
    done
  done
  gained "octahedra less quads with equal numbers of triangles in dB" plain quads-plain '["opaque_from_0.8"].psnr' .faces
}

weights_of_depth() {
  seeded final
  seeded no-depth --set depth_weight=0
  seeded less-depth --set depth_weight=0.03
}

depth() {
  block
  by_seed weights_of_depth
  gained "gain of the loss of depths in dB" final no-depth .psnr
  gained "gain of its weight 1 over 0.03 in dB" final less-depth .psnr
  gained "median error of depth with weight 1, less that with 0.03" final less-depth .depth.median_absolute
  gained "median error of depth with the loss, less that without it" final no-depth .depth.median_absolute
  verdict "one block, error of depth with the loss less that without it" "$gain" '<=' 0
}

# judged_at_borders SCENE CAPTURE BLOCKS: prints the error at walls relative to that elsewhere.
judged_at_borders() {
  [ -s "$work/$1.border.json" ] || {
    build/release/bench/border_error "$work/$1" "$work/$2" "$work/$3/blocks.json" > "$work/border.part" ||
      die "border_error failed"
    mv "$work/border.part" "$work/$1.border.json"
  }
  jq -r .mse_ratio "$work/$1.border.json"
}

borders() {
  need_tessera
  [ -x build/release/bench/border_error ] || die "build/release/bench/border_error: not built; run: tools/build.sh release border_error"
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  trained city-single city --method mesh --minutes 15 --blocks 1x1 --set mesh_cells=128
  scene city-single city
  local four one
  four=$(judged_at_borders city-mesh.scene city city-mesh) one=$(judged_at_borders city-single.scene city city-mesh)
  echo "city 2x2, squared error at walls relative to that elsewhere: four blocks $four, one block $one"
  verdict "city 2x2, the same ratio of four blocks relative to that of one" "$(jq -n "$four / $one")" '<=' 1.05
}

# What does not scale with the number of steps, for trainings of a few hundred: vertices move, and cells become empty.
short_schedule=(--set vertex_start_steps=20 --set occupancy_start_steps=16 --set occupancy_every=4)

# Small trainings whose bytes are compared.
tiny_flags=(--method mesh --steps 120 --seed 7 --blocks 2x2 --set coarse_steps=60 --set samples_per_step=8192
  --set mesh_cells=32 --set background_cells=32 "${short_schedule[@]}")
tiny() { "$tessera" train "$work/tiny" "$work/$1" "${tiny_flags[@]}" "${@:2}"; } # MODEL ARGUMENTS...
tiny_city() {
  need_tessera
  [ -e "$work/tiny/transforms.json" ] || "$tessera" synth city "$work/tiny" --blocks 2x2 --photos 16 --size 160x120 --samples 2
  [ -e "$work/tiny-one/manifest.json" ] || {
    tiny tiny-one.part
    mv "$work/tiny-one.part" "$work/tiny-one"
  }
}
# sums MODEL: the bytes that the manifests of its parts name.
sums() {
  local part
  for part in "$1/coarse" "$1"/parts/*; do
    echo "$(basename "$part") $(sha256sum < "$(checkpoint "$part")")"
  done
}
# differing MODEL: how many parts differ from those of the training that was not interrupted, or are missing.
differing() {
  local expected actual
  expected=$(sums "$work/tiny-one") actual=$(sums "$1")
  [ "$(wc -l <<< "$expected")" -eq 6 ] || die "$work/tiny-one has not six parts"
  comm -3 <(sort <<< "$expected") <(sort <<< "$actual") | wc -l
}

processes() {
  tiny_city
  rm -rf "$work/tiny-four"
  tiny tiny-four --only-blocks coarse
  tiny tiny-four --resume --only-blocks background
  local block pids=()
  for block in block_0_0 block_1_0 block_0_1 block_1_1; do
    tiny tiny-four --resume --only-blocks "$block" --threads 1 &
    pids+=($!)
  done
  for block in "${pids[@]}"; do wait "$block" || die "a process failed"; done
  verdict "four processes, checkpoints that differ from those of one process" "$(differing "$work/tiny-four")" '<=' 0
}

# interrupted ARGUMENTS...: runs tessera, and kills it after a random part of `lasted` seconds, or, if `after` is not
# empty, soon after it has printed that; succeeds if it was killed.
interrupted() {
  "$tessera" "$@" > "$work/interrupted.log" 2>&1 &
  local pid=$! lasted=$lasted
  if [ -n "${after:-}" ]; then
    while kill -0 "$pid" 2> /dev/null && ! grep -q "$after" "$work/interrupted.log"; do sleep 0.01; done
    lasted=0.2
  fi
  sleep "$(awk -v l="$lasted" -v r="$RANDOM" 'BEGIN { printf "%.3f", 0.05 + l * r / 32768 }')"
  if kill -9 "$pid" 2> /dev/null; then
    wait "$pid" 2> /dev/null || true
    return 0
  fi
  wait "$pid" || die "it failed: $(tail -n 1 "$work/interrupted.log")"
  return 1
}

killed() {
  tiny_city
  local started=$SECONDS kills=0 lasted steps after last
  rm -rf "$work"/tiny-{killed,timed} "$work"/tiny-*.scene
  tiny tiny-timed
  lasted=$((SECONDS - started))
  rm -rf "$work/tiny-timed"
  local inFinalStage=0 inExtraction=0 extracting='looking for the triangles that photos show'
  while [ "$kills" -lt 10 ] || [ "$inFinalStage" -eq 0 ] || [ "$inExtraction" -eq 0 ]; do
    after=
    [ "$kills" -lt 9 ] || [ "$inExtraction" -gt 0 ] || after=$extracting
    if interrupted train "$work/tiny" "$work/tiny-killed" "${tiny_flags[@]}" --resume --checkpoint-seconds 0.3; then
      kills=$((kills + 1))
      steps=$({ cat "$work"/tiny-killed/parts/*/manifest.json 2> /dev/null || true; } | jq -s -c 'map(.step)')
      [ "$(jq 'any(.[]; . > 96 and . < 120)' <<< "$steps")" = false ] || inFinalStage=$((inFinalStage + 1))
      last=$(tail -n 1 "$work/interrupted.log" | tr '\r' '\n' | tail -n 1)
      case $last in *"$extracting"*) inExtraction=$((inExtraction + 1)) ;; esac
      echo "kill $kills; steps of parts: $steps; $last"
    else
      rm -rf "$work/tiny-killed"
    fi
    [ "$kills" -lt 60 ] || die "of 60 kills, $inFinalStage were in the final stage, and $inExtraction in the extraction"
  done
  after=
  tiny tiny-killed --resume
  echo "$inFinalStage of $kills kills in the final stage, $inExtraction in the extraction of triangles"
  verdict "killed $kills times, checkpoints that differ" "$(differing "$work/tiny-killed")" '<=' 0
  started=$SECONDS
  "$tessera" bake "$work/tiny-one" "$work/tiny-one.scene" --capture "$work/tiny"
  lasted=$((SECONDS - started)) kills=0
  while [ "$kills" -lt 3 ]; do
    if interrupted bake "$work/tiny-one" "$work/tiny-killed.scene" --capture "$work/tiny"; then
      kills=$((kills + 1))
    else
      rm -rf "$work/tiny-killed.scene"
    fi
  done
  "$tessera" bake "$work/tiny-one" "$work/tiny-killed.scene" --capture "$work/tiny"
  local same=0
  diff -rq -x report.html "$work/tiny-one.scene" "$work/tiny-killed.scene" || same=$?
  verdict "baking killed three times, status of diff" "$same" '<=' 0
}

# peak ARGUMENTS...: runs tessera, and prints its peak memory in MB. Needs the package `time` of Debian.
peak() {
  /usr/bin/time -f %M -o "$work/peak" "$tessera" "$@" > /dev/null
  awk '{ print $1 / 1000 }' "$work/peak"
}

memory() {
  need_tessera
  local blocks name
  local -A bake=() render=()
  for blocks in 1x1 3x2; do
    name=memory-$blocks
    [ -e "$work/$name-city/transforms.json" ] ||
      "$tessera" synth city "$work/$name-city" --blocks "$blocks" --photos 24 --size 200x150 --samples 1
    trained "$name" "$name-city" --method mesh --blocks "$blocks" --steps 100 --set coarse_steps=300 --set samples_per_step=16384
    rm -rf "$work/$name.scene"
    bake[$blocks]=$(peak bake "$work/$name" "$work/$name.scene" --capture "$work/$name-city")
    render[$blocks]=$(peak eval "$work/$name" "$work/$name-city")
    echo "$blocks blocks: baking ${bake[$blocks]} MB, rendering the model ${render[$blocks]} MB"
  done
  verdict "peak memory of baking six blocks relative to one" "$(jq -n "${bake[3x2]} / ${bake[1x1]}")" '<=' 1.5
}

vulkan() {
  block
  local device
  for device in cpu vulkan; do
    trained "vulkan-$device" block --method mesh --blocks 1x1 --steps 300 --set coarse_steps=300 \
      --set samples_per_step=16384 "${short_schedule[@]}" --device "$device"
    [ -s "$work/vulkan-$device.json" ] ||
      "$tessera" eval "$work/vulkan-$device" "$work/block" --split train --json "$work/vulkan-$device.json" > /dev/null
  done
  verdict "300 steps, difference of training PSNR in dB" \
    "$(difference "$(jq .psnr "$work/vulkan-cpu.json")" "$(jq .psnr "$work/vulkan-vulkan.json")")" '<=' 0.2
}

levels() {
  need_tessera
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  local level size finer coarser
  for level in 1 2; do
    size=$((400 >> level))x$((300 >> level))
    [ -e "$work/city-$size/transforms.json" ] || "$tessera" synth city "$work/city-$size" --blocks 2x2 --size "$size"
    for lod in $((level - 1)) "$level"; do
      [ -s "$work/city-$size-lod$lod.json" ] || "$tessera" eval "$work/city-mesh.scene" "$work/city-$size" --lod "$lod" \
        --json "$work/city-$size-lod$lod.json" ${lpips:+--lpips "$lpips"} > /dev/null
    done
    finer=$work/city-$size-lod$((level - 1)).json coarser=$work/city-$size-lod$level.json
    jq -r --arg level "$level" --slurpfile finer "$finer" '"level \($level) of matching pixels: PSNR \(.psnr) after " +
      "\($finer[0].psnr), SSIM \(.ssim) after \($finer[0].ssim), LPIPS \(.lpips) after \($finer[0].lpips)"' "$coarser"
    verdict "level $level, loss against the next finer level in dB" \
      "$(shortfall "$(jq .psnr "$finer")" "$(jq .psnr "$coarser")")" '<=' 1.5
    verdict "level $level, triangles relative to the next finer level" \
      "$(jq --argjson l "$level" '.levels[$l].triangles / .levels[$l - 1].triangles' "$work/city-mesh.bake.json")" '<=' 0.3
  done
}

holes() {
  need_tessera
  local program=build/release/bench/mesh_holes error
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_holes"
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  [ -e "$work/fresh/transforms.json" ] ||
    "$tessera" synth city "$work/fresh" --blocks 2x2 --photos 200 --altitudes 40,90 --size 200x150 --samples 1
  for error in 1.5 12 24 48; do
    "$program" "$work/city-mesh.scene" "$work/fresh" "$error" "$work/city" > "$work/holes-$error.json"
    jq -c . "$work/holes-$error.json"
    verdict "city 2x2, levels $(jq -c .levels "$work/holes-$error.json"): share of pixels with a hole" \
      "$(jq .share "$work/holes-$error.json")" '<=' 0.001
  done
}

frames() {
  need_tessera
  local program=build/release/bench/mesh_frames result=$work/frames.json
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_frames"
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  [ -s "$result" ] || "$program" "$work/city-mesh.scene" "$work/city" > "$result"
  jq -c . "$result"
  verdict "exact images, least PSNR of a held-out view" "$(jq .exact.least "$result")" '>=' 38
  verdict "the same through the photos' lens" "$(jq .exact_through_lens.least "$result")" '>=' 38
  verdict "mean of 64 frames" "$(jq '."64_frames".least' "$result")" '>=' 38
  verdict "frames of a flight" "$(jq .flight.with_blending.least "$result")" '>=' 30
  verdict "largest loss of a frame by blending, dB" "$(jq .flight.largest_loss_by_blending "$result")" '<=' 0.5
}

browser() {
  need_tessera
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  if [ ! -e "$work/city-volume.scene/tileset.json" ]; then
    trained city-volume city --method volume --minutes 15
    "$tessera" bake "$work/city-volume" "$work/city-volume.scene"
  fi
  tools/install-debian-packages.sh --browser
  tools/build-web.sh
  local root=$PWD
  (cd web && SCENE="$root/$work/city-mesh.scene" CAPTURE="$root/$work/city" VOLUME="$root/$work/city-volume.scene" OUT="$root/$work/browser" \
    TESSERA=$(realpath "$root/$tessera") xvfb-run -a -s "-screen 0 1280x1024x24 -noreset" \
    npx vitest run bench/mesh.ts --config vitest.bench.config.ts --disable-console-intercept)
}

# bothMaps MODEL NAME: scenes NAME-stored.scene and NAME-inferred.scene, without ordinary meshes.
bothMaps() {
  local kind
  for kind in stored inferred; do
    [ -e "$work/$2-$kind.scene/tileset.json" ] || "$tessera" bake "$work/$1" "$work/$2-$kind.scene" --maps "$kind" --fallback 0
  done
}

maps() {
  need_tessera
  local program=build/release/bench/mesh_flight result=$work/maps.json kind
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_flight"
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  bothMaps city-mesh city
  [ -s "$result" ] || "$program" "$work/city-stored.scene" "$work/city-inferred.scene" > "$result"
  jq -c . "$result"
  for kind in cpu gpu; do
    verdict "images with maps inferred on the $kind, least PSNR against stored maps" \
      "$(jq ".inferred_on_the_$kind.least_psnr" "$result")" '>=' 45
  done
}

flight() {
  need_tessera
  local program=build/release/bench/mesh_flight kind result
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_flight"
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  [ -e "$work/flight/transforms.json" ] ||
    "$tessera" synth city "$work/flight" --blocks 4x4 --size 160x120 --samples 1
  trained flight-model flight --method mesh --blocks 4x4 --steps 100 --set coarse_steps=300 --set grid_log2_size=14 \
    --set mesh_cells=32 --set background_cells=32 --set mesh_levels=3 --set occupancy_start_steps=16 --set occupancy_every=4 \
    --set vertex_start_steps=10 --set opacity_offset=-1 --set samples_per_step=16384 --set learning_rate=0.02 --set fitted_levels=false
  bothMaps flight-model flight
  trained city-mesh city --method mesh --minutes 15
  bothMaps city-mesh city
  for kind in stored inferred; do
    result=$work/flight-$kind.json
    [ -s "$result" ] || "$program" "$work/flight-$kind.scene" > "$result"
    jq -c . "$result"
    verdict "$kind maps, memory of contents at most, as a share of the budget" \
      "$(jq '.most_bytes_of_contents / .budget_bytes' "$result")" '<=' 1
    verdict "$kind maps, memory of buffers and images at most, as a share of all budgets" \
      "$(jq '.most_bytes_in_use / (.budget_bytes + .bytes_besides_contents)' "$result")" '<=' 1
    verdict "$kind maps, blank frames" "$(jq .blank_frames "$result")" '<=' 0
    verdict "$kind maps, evictions" "$(jq .evictions "$result")" '>=' 1
  done
  result=$work/memory.json
  [ -s "$result" ] || "$program" "$work/city-stored.scene" memory > "$result"
  jq -c . "$result"
  tools/install-debian-packages.sh --browser
  tools/build-web.sh
  local root=$PWD
  # flown LARGE_SCENE TEST
  flown() {
    (cd web && SMALL_SCENE="$root/$work/city-mesh.scene" SMALL_CAPTURE="$root/$work/city" LARGE_SCENE=$1 \
      FINEST_BYTES=$("$root/$tessera" info "$1" --json | jq .level_0.bytes_in_memory) \
      CONTENTS_ALONE=1 TESSERA=$(realpath "$root/$tessera") xvfb-run -a -s "-screen 0 1280x1024x24 -noreset" \
      npx vitest run bench/viewer.ts -t "$2" --config vitest.bench.config.ts --disable-console-intercept)
  }
  flown "$root/$work/city-stored.scene" "first picture"
  flown "$root/$work/flight-stored.scene" "600 steps"
}

# withoutMasks FROM TO: copies a capture without its masks.
withoutMasks() {
  rm -rf "$2.part"
  cp -r "$1" "$2.part"
  rm -r "$2.part/masks"
  jq 'del(.frames[].mask_path)' "$1/transforms.json" > "$2.part/transforms.json"
  mv "$2.part" "$2"
}

# masked_by HOW: trains on photos with cars: `given` masks, transient=auto (`auto`), or no masks (`none`).
masked_by() {
  local capture=traffic transient=none
  [ "$1" != given ] || capture=traffic-masked
  [ "$1" != auto ] || transient=auto
  seeded_on "$capture" traffic-clean "traffic-$1" --blocks 1x1 --minutes 5 --set transient="$transient"
}
all_masks() {
  local how
  for how in given auto none; do masked_by "$how"; done
}

traffic() {
  need_tessera
  local program=build/release/bench/mesh_transients file=$work/transients.json size="--blocks 1x1 --photos 60 --size 320x240"
  local name seed
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_transients"
  [ -e "$work/traffic-clean/transforms.json" ] || "$tessera" synth city "$work/traffic-clean" $size
  [ -e "$work/traffic-masked/transforms.json" ] || "$tessera" synth city "$work/traffic-masked" $size --traffic
  [ -e "$work/traffic/transforms.json" ] || withoutMasks "$work/traffic-masked" "$work/traffic"
  by_seed all_masks
  for name in given auto none; do
    echo "traffic, $name:" $(masked_by "$name") "dB"
    for seed in ${SEEDS:-1 2 3}; do classified "traffic-$name-$seed" traffic-clean classes; done
  done
  if [ ! -s "$file" ]; then
    "$program" "$work/traffic-auto-1" "$work/traffic" "$work/traffic-masked" "$work/traffic-clean" > "$file.part"
    mv "$file.part" "$file"
  fi
  jq -c . "$file"
  gained "traffic, gain of given masks over transient=auto in pixels of the ground, in dB" traffic-given traffic-auto \
    "[0].ground.psnr" .classes
  gained "traffic, gain of given masks over transient=auto in dB" traffic-given traffic-auto .psnr
  verdict "traffic, transient=auto against given masks, loss in dB" "$gain" '<=' 0.5
  gained "traffic, gain of transient=auto in pixels of the ground, in dB" traffic-auto traffic-none "[0].ground.psnr" .classes
  gained "traffic, gain of transient=auto in dB" traffic-auto traffic-none .psnr
  verdict "traffic, gain of transient=auto in dB" "$gain" '>=' 0
}

# pictures: renders the views of the fallback in all programs, and compares them.
pictures() {
  local program=build/release/bench/mesh_fallback folder=$work/fallback scene=$work/city-mesh.scene needed uri
  for needed in blender assimp "${TESSERA_CHROMIUM:-chromium}"; do
    command -v "$needed" > /dev/null ||
      die "$needed is missing: apt-get install --no-install-recommends blender python3-numpy assimp-utils chromium"
  done
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_fallback"
  [ -d web/node_modules/three ] || tools/build-web.sh --packages-only
  [ -e "$work/pinhole/transforms.json" ] || "$tessera" synth city "$work/pinhole" --blocks 2x2 --pinhole
  "$program" views "$scene" "$work/pinhole" "$folder"
  node bench/fallback_three.mjs "$scene" "$folder" > "$folder/three.json"
  blender -b --python-exit-code 1 --python bench/fallback_blender.py -- "$scene" "$folder" > "$folder/blender.log" 2>&1 ||
    die "$folder/blender.log: $(grep -i error "$folder/blender.log" | tail -n 1)"
  for uri in $(jq -r '.contents[].uri' "$folder/views.json"); do
    assimp info "$scene/$uri" | awk '/^Faces:/ { print $2 }'
  done | jq -s . > "$folder/assimp.json"
  "$program" compare "$scene" "$work/pinhole" "$folder" > "$folder/compared.part"
  mv "$folder/compared.part" "$folder/compared.json"
}

fallback() {
  need_tessera
  local folder=$work/fallback name psnr
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  [ -s "$folder/compared.json" ] || pictures
  for name in three blender assimp; do
    verdict "$name, contents with another number of triangles" "$(jq --slurpfile loaded "$folder/$name.json" \
      '[([.contents[].triangles], $loaded[0]) | to_entries[]] | group_by(.key) | map(select(.[0].value != .[1].value)) | length' \
      "$folder/views.json")" '<=' 0
  done
  jq -r 'to_entries[] | select(.key != "views") | .key as $a | .value | to_entries[] |
    "\($a) against \(.key): \(.value.psnr) dB, SSIM \(.value.ssim), LPIPS \(.value.lpips)"' "$folder/compared.json"
  for name in three blender; do
    psnr=$(jq --arg name "$name" '.[$name].plain.psnr * 100 | round / 100' "$folder/compared.json")
    verdict "$name, PSNR against the scene without view dependence in dB" "$psnr" '>=' 25
  done
}

gltf() {
  need_tessera
  local program=build/release/bench/mesh_fallback folder=$work/gltf scene=$work/city-mesh.scene name
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  [ -d web/node_modules/three ] || tools/build-web.sh --packages-only
  if [ ! -s "$folder/compared.json" ]; then
    [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_fallback"
    [ -e "$work/pinhole/transforms.json" ] || "$tessera" synth city "$work/pinhole" --blocks 2x2 --pinhole
    mkdir -p "$folder/exported"
    "$tessera" export "$scene" "$folder/exported/scene.glb" --format gltf
    "$program" views "$scene" "$work/pinhole" "$folder"
    jq '.contents = [{uri: "scene.glb", triangles: ([.contents[].triangles] | add)}]' "$folder/views.json" > "$folder/views.part"
    mv "$folder/views.part" "$folder/views.json"
    node bench/fallback_three.mjs "$folder/exported" "$folder" > "$folder/three.json"
    blender -b --python-exit-code 1 --python bench/fallback_blender.py -- "$folder/exported" "$folder" \
      > "$folder/blender.log" 2>&1 || die "$folder/blender.log: $(grep -i error "$folder/blender.log" | tail -n 1)"
    "$program" compare "$scene" "$work/pinhole" "$folder" > "$folder/compared.part"
    mv "$folder/compared.part" "$folder/compared.json"
  fi
  verdict "exported glTF, errors of glTF-Validator" "$(node bench/validate_gltf.mjs "$folder/exported")" '<=' 0
  for name in three blender; do
    verdict "$name, triangles of the exported glTF less those of the scene" \
      "$(jq --slurpfile loaded "$folder/$name.json" '$loaded[0][0] - .contents[0].triangles | fabs' "$folder/views.json")" '<=' 0
    verdict "$name, PSNR of the exported glTF against the scene without view dependence in dB" \
      "$(jq --arg name "$name" '.[$name].plain.psnr * 100 | round / 100' "$folder/compared.json")" '>=' 25
  done
}

yardstick() {
  need_tessera
  local program=build/release/bench/mesh_yardstick file=$work/yardstick.json
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_yardstick"
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  if [ ! -s "$file" ]; then
    "$program" "$work/city-mesh.scene" "$work/city" "$work/yardstick" > "$file.part"
    mv "$file.part" "$file"
  fi
  jq -r '"\(.texels) texels, \(.texels_per_pixel) along a pixel", (("scene", "mean", "sharpest", "sharpest_9_rays") as $name |
    .[$name] | "\($name): \(.psnr) dB, SSIM \(.ssim), LPIPS \(.lpips), of surfaces in the box \(.psnr_in_box) dB")' "$file"
  verdict "city 2x2, the scene less an ideal photogrammetric mesh in dB" \
    "$(shortfall "$(jq .scene.psnr "$file")" "$(jq .mean.psnr "$file")")" '>=' 0
}

mobilenerf() {
  need_tessera
  local html=jax3d/projects/mobilenerf/view_unbounded.html folder=$work/mobilenerf root=$PWD viewer
  [ -e "${JAX3D:?names no folder; it must be a copy of https://github.com/google-research/jax3d}/$html" ] || die "$JAX3D: has no $html"
  viewer=$(realpath "$JAX3D")
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  counted city-mesh city
  tools/install-debian-packages.sh --browser
  tools/build-web.sh
  mkdir -p "$folder"
  if [ ! -d "$folder/three" ]; then
    (cd "$folder" && npm pack --silent three@0.151.3 > /dev/null && tar xzf three-0.151.3.tgz && mv package three)
  fi
  if [ ! -s "$folder/export.json" ]; then
    "$tessera" export "$work/city-mesh.scene" "$folder/city_phone" --format mobilenerf --json > "$folder/export.part"
    mv "$folder/export.part" "$folder/export.json"
  fi
  jq -r '"exported: \(.triangles) triangles in \(.shapes) shapes, \(.bytes_on_disk / 1e6) MB; one network in place of \(.decoders) " +
    "decoders gives colours \(.refit.psnr) dB from theirs"' "$folder/export.json"
  echo "the scene on disk: finest level with background block $(level_bytes city-mesh.scene 0) MB, all levels $(level_bytes city-mesh.scene) MB," \
    "both with ordinary meshes, but without their textures"
  (cd web && SCENE="$root/$work/city-mesh.scene" EXPORTED="$root/$folder/city_phone" CAPTURE="$root/$work/city" JAX3D="$viewer" \
    THREE_OF_VIEWER="$root/$folder/three" OUT="$root/$folder/pictures" TESSERA=$(realpath "$root/$tessera") \
    xvfb-run -a -s "-screen 0 1280x1024x24 -noreset" \
    npx vitest run bench/mobilenerf.ts --config vitest.bench.config.ts --disable-console-intercept)
}

# imported NAME DOWNSCALE: real photographs.
imported() {
  need_tessera
  [ -e "$work/$1/transforms.json" ] || "$tessera" import \
    "${TESSERA_SHARED_DATA:?names no folder; it must hold $1/}/$1" "$work/$1" --downscale "$2" --holdout every:8
}

with_and_without_views() { # NAME ARGUMENTS...
  seeded_on brighton_beach brighton_beach "views-$1" "${@:2}"
  seeded_on brighton_beach brighton_beach "no-views-$1" "${@:2}" --set enough_photos=0
}

views() {
  imported brighton_beach 4
  local how name
  for how in "minutes 5" "steps 1000"; do
    name=${how% *}
    by_seed with_and_without_views "$name" --$how
    echo "brighton_beach, $how, with views:" $(seeded_on brighton_beach brighton_beach "views-$name" --$how) "dB"
    echo "brighton_beach, $how, without:" \
      $(seeded_on brighton_beach brighton_beach "no-views-$name" --$how --set enough_photos=0) "dB"
    gained "brighton_beach, $how, gain of views between the photos, SSIM" "views-$name" "no-views-$name" .ssim
    [ -z "$lpips" ] || gained "brighton_beach, $how, LPIPS with views less that without" "views-$name" "no-views-$name" .lpips
    gained "brighton_beach, $how, gain of views between the photos in dB" "views-$name" "no-views-$name" .psnr
    verdict "brighton_beach, $how, gain of views between the photos in dB, lower end of the interval" "$lowest" '>=' 0
  done
}

# photos NAME DOWNSCALE BOUND ARGUMENTS...: the same for real photographs.
photos() {
  local name=$1 downscale=$2 bound=$3
  shift 3
  imported "$name" "$downscale"
  trained "$name-mesh" "$name" --method mesh --minutes 10 "$@"
  echo "$name after 10 min: mesh $(judged "$name-mesh" "$name") dB"
  scene "$name-mesh" "$name"
  verdict "$name, held-out PSNR of the scene in dB" "$(judged "$name-mesh.scene" "$name" 0)" '>=' "$bound"
}
fox() { photos fox 2 27.2 --blocks 1x1; }
beach() { photos brighton_beach 4 19.1; }

for row in ${ROWS:-traversal city levels final holes losses alpha preset quads depth views traffic borders processes killed memory vulkan frames browser maps flight fallback gltf yardstick fox beach${JAX3D:+ mobilenerf}}; do
  "$row"
done
finish
