#!/usr/bin/env bash
# Meshes with neural textures (`--method mesh`) on the CPU.
#   traversal    rays per second on a grid of octahedra against Embree, which collects all hits of the same rays on the same
#                triangles in order of distance: a synthetic grid, and trained models if there are any (those that MODEL names,
#                and those in build/bench/mesh); and how long Embree takes for a new hierarchy after a step has moved the vertices
#   city         a city of 2x2 blocks, 15 minutes with coarse field and final stage: held-out PSNR of the baked scene and of its
#                levels, beside `field` in the same time; bytes, triangles and time of baking; its contents as glTF files
#   final        the same city in the same time without the final stage, and what each step from its model to contents loses
#   holes        200 fresh views of that city from other heights: the share of pixels in which the scene's blocks have a hole, at the
#                finest level and with levels mixed
#   fallback     the ordinary glTF meshes in the contents of that scene's finest level, in Blender, assimp and three.js: they load with
#                the same numbers of triangles; and held-out views of three.js and Blender, without mipmaps and antialiasing, against
#                the scene without view dependence (every hit has the base colour of its texels), the scene as it is, an
#                implementation by Embree of what glTF says, and photos without distortion. Where no triangle covers a pixel, the
#                scene's sky is put in. Needs blender, python3-numpy, assimp-utils and chromium of Debian
#   yardstick    that scene against the city's true triangles with as many texels, coloured by the training photos: an ideal
#                photogrammetric mesh
#   fox, beach   real photographs, 10 minutes each: held-out PSNR of the baked scene
# Resumable: everything is kept in build/bench/mesh, and what exists is not made again; remove traversal-* there to repeat a row.
#   [ROWS="traversal city final holes fallback yardstick fox beach"] [MODEL=DIR] [CAPTURE=DIR] [TESSERA_SHARED_DATA=DIR] bench/mesh.sh
# CAPTURE: the capture of MODEL, if it is not where its blocks.json says.
set -euo pipefail
source "$(dirname "$0")/setup.sh"
work=$out/mesh
mkdir -p "$work"

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
    if [ -e "$manifest" ] && [ "$(jq -r .method "$manifest")" = mesh ]; then
      traced "$(basename "$(dirname "$manifest")")" "$(dirname "$manifest")"
    fi
  done
}

# chained MODEL CAPTURE: what each step from the model to its contents loses, with patches of 8 and of 16 texels.
chained() {
  local program=build/release/bench/mesh_chain edge file
  [ -x "$program" ] || die "$program: not built; run: tools/build.sh release mesh_chain"
  for edge in 8 16; do
    file=$work/chain-$1-$edge.json
    if [ ! -s "$file" ]; then
      "$program" "$work/$1" "$work/$2" "$edge" > "$file.part"
      mv "$file.part" "$file"
    fi
    jq -r --arg edge "$edge" '"patches of \($edge) texels: model \(.model.psnr), faces kept \(.kept_faces.psnr), " +
      "8 bits \(.texels_of_8_bits.psnr), opaque from 0.8 \(.["opaque_from_0.8"].psnr), " +
      "BC4 \(.bc4_fast.psnr), exhaustive \(.bc4_exhaustive.psnr) dB; \(.triangles) triangles, " +
      "\(.texel_bytes_bc4 / 1e6) MB of texels in BC4; extraction \(.extraction_seconds) s, baking \(.bake_seconds) s"' "$file"
  done
}

# scene MODEL CAPTURE: bakes the model, and prints what its scene has and how it looks.
scene() {
  local seconds=$SECONDS level
  if [ ! -e "$work/$1.scene/tileset.json" ]; then
    "$tessera" bake "$work/$1" "$work/$1.scene" --capture "$work/$2" --json > "$work/$1.bake.json"
    jq --argjson seconds $((SECONDS - seconds)) '. + {seconds: $seconds}' "$work/$1.bake.json" > "$work/$1.part"
    mv "$work/$1.part" "$work/$1.bake.json"
  fi
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

city() {
  need_tessera
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  trained city-field city --method field --minutes 15
  echo "city 2x2 after 15 min: field $(judged city-field city) dB, mesh $(judged city-mesh city) dB"
  scene city-mesh city
  valid city-mesh.scene
  verdict "city 2x2, held-out PSNR of the scene in dB" "$(judged city-mesh.scene city 0)" '>=' 24
  verdict "city 2x2, field less the scene in dB" "$(shortfall "$(judged city-field city)" "$(judged city-mesh.scene city 0)")" '<=' 1.5
}

final() {
  need_tessera
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  trained city-mesh city --method mesh --minutes 15
  scene city-mesh city
  trained city-plain city --method mesh --minutes 15 --set final_share=0
  scene city-plain city
  verdict "city 2x2, gain of the final stage in dB" \
    "$(shortfall "$(judged city-mesh.scene city 0)" "$(judged city-plain.scene city 0)")" '>=' 0.3
  chained city-plain city
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
  for error in 1.5 12; do
    "$program" "$work/city-mesh.scene" "$work/fresh" "$error" > "$work/holes-$error.json"
    verdict "city 2x2, levels $(jq -c .levels "$work/holes-$error.json"): share of pixels with a hole" \
      "$(jq .share "$work/holes-$error.json")" '<=' 0.001
  done
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
    "\($a) against \(.key): \(.value.psnr) dB, SSIM \(.value.ssim)"' "$folder/compared.json"
  for name in three blender; do
    psnr=$(jq --arg name "$name" '.[$name].plain.psnr * 100 | round / 100' "$folder/compared.json")
    verdict "$name, PSNR against the scene without view dependence in dB" "$psnr" '>=' 25
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
    .[$name] | "\($name): \(.psnr) dB, SSIM \(.ssim), of surfaces in the box \(.psnr_in_box) dB")' "$file"
  verdict "city 2x2, the scene less an ideal photogrammetric mesh in dB" \
    "$(shortfall "$(jq .scene.psnr "$file")" "$(jq .mean.psnr "$file")")" '>=' 0
}

# photos NAME DOWNSCALE BOUND ARGUMENTS...: the same for real photographs.
photos() {
  need_tessera
  local name=$1 downscale=$2 bound=$3
  shift 3
  [ -e "$work/$name/transforms.json" ] || "$tessera" import \
    "${TESSERA_SHARED_DATA:?names no folder; it must hold $name/}/$name" "$work/$name" --downscale "$downscale" --holdout every:8
  trained "$name-mesh" "$name" --method mesh --minutes 10 "$@"
  echo "$name after 10 min: mesh $(judged "$name-mesh" "$name") dB"
  scene "$name-mesh" "$name"
  verdict "$name, held-out PSNR of the scene in dB" "$(judged "$name-mesh.scene" "$name" 0)" '>=' "$bound"
}
fox() { photos fox 2 27.2 --blocks 1x1; }
beach() { photos brighton_beach 4 19.1; }

for row in ${ROWS:-traversal city final holes fallback yardstick fox beach}; do "$row"; done
finish
