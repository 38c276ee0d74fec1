#!/usr/bin/env bash
# Photographs without poses, as JPEG files alone, through `tessera run`.
#   brighton  18 nadir photographs: all get poses; minutes of each stage
#   fox       50 hand-held photographs without GPS and EXIF: at least 49 get poses
#   survey    a survey of a city of 2x2 blocks in 202 photographs of 800x600, GPS errors of 2 m and 0.5 m, one flight 15 m too high:
#             at least 98 % get poses; after the best similarity to the true ones 0.1 m, 0.05 degrees (medians, without a pose:
#             infinite) and 0.5 m (worst); scale, rotation and middle from GPS within twice the predicted standard errors
#   served    brighton_beach from photographs to the first tiles that a browser gets, in at most 25 minutes
#   exposure  brighton_beach at 400x225, ten minutes of `field`: exposures predicted from EXIF at least 0.4 dB above neutral, and on
#             the right halves of the views at most 0.2 dB below fitted ones
#   killed    brighton_beach to an evaluated scene of `volume`, killed 20 times, at least once in each stage: all photos get poses, at most
#             three minutes are repeated each time, training goes on from a checkpoint, no program survives, and the scene has the
#             bytes of an unbroken training
#   killed_survey  the poses of the survey, killed 10 times more than it has stages
#   against   brighton_beach at 400x225 and fox at 270x480, with the poses of `run` and with the poses that the data has: the scenes of
#             ten minutes of the default method, held-out PSNR at most 0.3 dB lower, mean of the seeds
#   methods   which method is best after ten minutes: scenes of brighton_beach, fox and a city of 2x2 blocks
#   reduced   by what photographs are best divided for ten minutes of training: 1, 2 and 4, judged in views divided by 2
#   jitter    a city whose photographs differ by half a stop: a scene of it, compared with the held-out views of the same city without
#             these differences, at most 0.3 dB below a scene of that one; with the exposures of EXIF shuffled, which train the same
#             weights, predicted exposures are refused, or at most 0.1 dB below neutral ones, in the photographs as they are
#   sizes     surveys of cities of 1x2 and 3x3 blocks with an overlap of 77 %, 122 and 487 photographs of 800x600: minutes and memory of
#             each stage up to georeferenced poses, the larger one in at most 90 minutes, and at most 1.5 times as long for each photo
#   untagged  the same photographs as in survey, without EXIF and XMP: at least 95 % get poses, none more than 1 m off
# Of each run: its time within twice what it had expected at the start, stages within 1.5 times, memory between half and all of it.
# Resumable: everything is kept in build/bench/photos, and what exists is not made again.
#   TESSERA_SHARED_DATA=DIR [ROWS="brighton fox served against methods reduced exposure jitter killed survey killed_survey sizes untagged"] \
#     [SEEDS="1 2 3"] [MINUTES=10] [STEPS=N] [METHOD=hash] bench/photos.sh
# With STEPS, trainings have that many steps instead of minutes, so that other programs do not matter; those of killed, 1500 if it is
# not given, which take several checkpoints.
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
data=${TESSERA_SHARED_DATA:?names no folder; it must hold brighton_beach/ and fox/}
for name in brighton_beach fox; do [ -d "$data/$name" ] || die "$data/$name: no such folder"; done
work=$out/photos
mkdir -p "$work"
length=(--minutes "${MINUTES:-10}") suffix=  # of what is kept, by the length of the training
[ "${MINUTES:-10}" = 10 ] || suffix=-$MINUTES-minutes
[ -z "${STEPS:-}" ] || length=(--steps "$STEPS") suffix=-$STEPS

# posed NAME PHOTOS: finds the poses, and prints minutes and memory of each stage.
posed() {
  local began=$SECONDS resumed=
  [ ! -e "$work/$1/run.json" ] || resumed=yes
  "$tessera" run "$2" "$work/$1" --until capture --holdout none
  echo "$1: $((SECONDS - began)) s, with what precedes the first stage"
  jq -r '.stages[] | select(.seconds >= 1) |
    "\(.name): \(.seconds / 6 | round / 10) min, \(.peak_bytes / 1048576 | round) MiB: \(.summary)"' "$work/$1/run.json"
  # What was done before is no longer expected, but known.
  if [ -z "$resumed" ]; then planned "$1"; else echo "$1: not compared with the plan, as it is not of one run"; fi
}
# planned NAME: what a run has taken against what it had expected. Times above 1 are longer than expected.
planned() {
  local run=$work/$1/run.json ratio
  ratio() { jq "$1" "$run"; }
  verdict "$1, time, of that expected at the start" "$(ratio '([.stages[].seconds] | add) / .expected.seconds')" '<=' 2
  verdict "$1, the same" "$(ratio '([.stages[].seconds] | add) / .expected.seconds')" '>=' 0.5
  verdict "$1, stages of more than 30 s against what was expected when they began, the worst ratio" \
    "$(ratio '[1, (.stages[] | select(.seconds > 30) | .seconds / .expected_seconds | if . < 1 then 1 / . else . end)] | max')" \
    '<=' 1.5
  verdict "$1, most memory, of that expected" "$(ratio '([.stages[].peak_bytes] | max) / .expected.peak_bytes')" '<=' 1
  verdict "$1, the same" "$(ratio '([.stages[].peak_bytes] | max) / .expected.peak_bytes')" '>=' 0.5
}
registered() { jq '.frames | length' "$work/$1/capture/transforms.json"; }

brighton() {
  posed brighton "$data/brighton_beach/images"
  verdict "brighton_beach, photos with poses of 18" "$(registered brighton)" '>=' 18
}

fox() {
  posed fox "$data/fox/images"
  verdict "fox, photos with poses of 50" "$(registered fox)" '>=' 49
}

# Tiles are asked for as soon as the address is printed; the viewer draws the coarsest ones at once.
served() {
  local began=$SECONDS log=$work/served.log address run
  rm -rf "$work/served" "$log"
  "$tessera" run "$data/brighton_beach/images" "$work/served" --serve 0 > "$log" 2>&1 &
  run=$!
  trap 'kill "$run" 2> /dev/null' EXIT
  until grep -qs "open http" "$log"; do
    kill -0 "$run" 2> /dev/null || die "$log: $(tail -1 "$log")"
    sleep 1
  done
  address=$(grep -o "http://[^ ]*" "$log")
  curl -sSf "${address}scene/tileset.json" | jq -r '.. | .uri? // empty' | head -1 > "$work/served.tile"
  curl -sSf "${address}scene/$(cat "$work/served.tile")" > /dev/null
  verdict "brighton_beach, minutes to the first tile" "$(jq -n "($SECONDS - $began) / 60")" '<=' 25
  kill -INT "$run"
  wait "$run"
  trap - EXIT
  planned served
  echo "brighton_beach, held-out PSNR: $(jq -r '"\(.psnr) dB, exposures \(.exposure)"' "$work/served/eval.json")"
}

# scene_of CAPTURE METHOD SEED VIEWS: trains, bakes, and compares the scene with the held-out photographs of the capture VIEWS;
# prints PSNR.
scene_of() {
  local name=$1-$2-$3$suffix
  trained "$name" "$1" --method "$2" "${length[@]}" --seed "$3" >&2
  [ -e "$work/$name.scene/tileset.json" ] || "$tessera" bake "$work/$name" "$work/$name.scene" --capture "$work/$1" >&2
  [ -s "$work/$name.json" ] || "$tessera" eval "$work/$name.scene" "$work/$4" --json "$work/$name.json" \
    --report "$work/$name.html" ${lpips:+--lpips "$lpips"} >&2
  jq .psnr "$work/$name.json"
}
# described NAME: of a scene that was evaluated.
described() {
  jq -r --arg name "$1" '"\($name): \(.psnr) dB, SSIM \(.ssim), LPIPS \(.lpips)"' "$work/$1.json"
  du -sm "$work/$1.scene" | awk '{ print "  " $1 " MB" }'
}
# imported NAME FOLDER DOWNSCALE
imported() {
  [ -e "$work/$1/transforms.json" ] || "$tessera" import "$2" "$work/$1" --downscale "$3" --holdout every:8
}

# Which method is the default of `run`.
methods() {
  local seed method capture
  imported brighton_beach-2 "$data/brighton_beach" 2
  imported fox-2 "$data/fox" 2
  [ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 2x2
  for seed in ${SEEDS:-1 2 3}; do
    for capture in ${CAPTURES:-brighton_beach-2 fox-2 city}; do
      for method in ${METHODS:-volume hash mesh}; do
        scene_of "$capture" "$method" "$seed" "$capture" > "$work/last"
        described "$capture-$method-$seed$suffix"
      done
    done
  done
}

# By what the photographs are divided, for the same minutes; judged in views that are divided by 2.
reduced() {
  local seed downscale name method=${METHOD:-hash}
  for seed in ${SEEDS:-1 2 3}; do
    for name in brighton_beach fox; do
      imported "$name-2" "$data/$name" 2
      for downscale in 1 2 4; do
        imported "$name-$downscale" "$data/$name" "$downscale"
        scene_of "$name-$downscale" "$method" "$seed" "$name-2" > "$work/last"
        described "$name-$downscale-$method-$seed$suffix"
      done
    done
  done
}

# against_poses NAME FOLDER DOWNSCALE
against_poses() {
  local seed own given differences=() method=${METHOD:-hash}
  [ -e "$work/$1-own/transforms.json" ] || {
    "$tessera" run "$2/images" "$work/$1-posed" --until capture --downscale "$3" --holdout every:8
    cp -r "$work/$1-posed/capture" "$work/$1-own"
  }
  imported "$1-given" "$2" "$3"
  # Every eighth photo is held out: the same ones, if none lacks a pose.
  held() { jq -r ".test_filenames[]" "$1" | sort; }
  verdict "$1, photos that only one of the captures holds out" \
    "$(diff <(held "$work/$1-own/transforms.json") <(held "$work/$1-given/transforms.json") | grep -c '^[<>]' || true)" '<=' 0
  for seed in ${SEEDS:-1 2 3}; do
    own=$(scene_of "$1-own" "$method" "$seed" "$1-own") given=$(scene_of "$1-given" "$method" "$seed" "$1-given")
    echo "$1, seed $seed: $own dB with the poses of run, $given dB with the given ones"
    differences+=("$(shortfall "$own" "$given")")
  done
  verdict "$1, poses of run less given ones, mean held-out PSNR in dB" \
    "$(printf '%s\n' "${differences[@]}" | jq -s 'add / length')" '>=' -0.3
}
against() {
  against_poses beach "$data/brighton_beach" 4
  against_poses fox "$data/fox" 2
}

# exposed MODEL HOW FILE ARGUMENTS...: prints the held-out PSNR with these exposures.
exposed() {
  [ -s "$work/$3.json" ] || "$tessera" eval "$work/$1" "$work/beach" --exposure "$2" --json "$work/$3.json" \
    --report "$work/$3.html" ${lpips:+--lpips "$lpips"} "${@:4}" > /dev/null
  jq .psnr "$work/$3.json"
}

exposure() {
  [ -e "$work/beach/transforms.json" ] ||
    "$tessera" import "$data/brighton_beach" "$work/beach" --downscale 4 --holdout every:8
  local seed model neutral predicted
  for seed in ${SEEDS:-1 2 3}; do
    model=beach-$seed$suffix
    trained "$model" beach --method field "${length[@]}" --seed "$seed"
    neutral=$(exposed "$model" neutral "$model-neutral")
    predicted=$(exposed "$model" predicted "$model-predicted")
    echo "brighton_beach, seed $seed: neutral $neutral dB, predicted $predicted dB;" \
      "neutral on the right halves $(exposed "$model" neutral "$model-neutral-right" --right-halves) dB"
    verdict "seed $seed, predicted less neutral, held-out PSNR in dB" "$(shortfall "$predicted" "$neutral")" '>=' 0.4
    verdict "seed $seed, fitted less predicted on the right halves, held-out PSNR in dB" \
      "$(shortfall "$(exposed "$model" fitted "$model-fitted")" \
        "$(exposed "$model" predicted "$model-right" --right-halves)")" '<=' 0.2
  done
}

jitter() {
  local seed capture steady=() jittered=()
  local city=(--blocks 1x1 --photos 72 --size 400x300)
  [ -e "$work/steady/transforms.json" ] || "$tessera" synth city "$work/steady" "${city[@]}"
  [ -e "$work/jittered/transforms.json" ] || "$tessera" synth city "$work/jittered" "${city[@]}" --exposure-jitter 0.5
  [ -e "$work/shuffled/transforms.json" ] || {
    cp -r "$work/jittered" "$work/shuffled.partial"
    # Each photo gets the exposure of another one.
    jq '[.frames[].tessera.exposure] as $all | reduce range($all | length) as $i
      (.; .frames[$i].tessera.exposure = $all[($i * 29 + 7) % ($all | length)])' "$work/jittered/transforms.json" > "$work/shuffled.partial/transforms.json"
    mv "$work/shuffled.partial" "$work/shuffled"
  }
  # The capture states the true exposures, which are those that import reads from EXIF.
  [ -e "$work/jittered-exif/transforms.json" ] || {
    rm -rf "$work/jittered-unexposed"
    cp -r "$work/jittered" "$work/jittered-unexposed"
    jq 'del(.frames[].tessera.exposure)' "$work/jittered/transforms.json" > "$work/jittered-unexposed/transforms.json"
    "$tessera" import "$work/jittered-unexposed" "$work/jittered-exif"
  }
  verdict "city with jitter, largest difference of an exposure by EXIF from the true one, in stops" \
    "$(jq -n --slurpfile exif "$work/jittered-exif/transforms.json" --slurpfile true "$work/jittered/transforms.json" '
      def exposures: [.[0].frames | sort_by(.file_path)[].tessera.exposure]; [$exif, $true | exposures] | transpose
      | map(.[0] - .[1] | fabs) | max')" '<=' 0.01
  local method=${METHOD:-hash}
  for seed in ${SEEDS:-1 2 3}; do
    steady+=("$(scene_of steady "$method" "$seed" steady)") jittered+=("$(scene_of jittered "$method" "$seed" steady)")
    echo "city, seed $seed: ${steady[-1]} dB, with jitter ${jittered[-1]} dB"
  done
  mean() { printf '%s\n' "$@" | jq -s 'add / length'; }
  verdict "city, trained with jitter less without, mean held-out PSNR in dB" \
    "$(shortfall "$(mean "${jittered[@]}")" "$(mean "${steady[@]}")")" '>=' -0.3
  # exposed_scene CAPTURE HOW: in the photographs as they are; 0 if the scene cannot predict exposures.
  exposed_scene() {
    local name=$1-$method-1$suffix
    "$tessera" eval "$work/$name.scene" "$work/$1" --exposure "$2" --json "$work/$name-$2.json" > "$work/$name-$2.log" 2>&1 || {
      grep -q "does not tell how colours follow exposures" "$work/$name-$2.log" ||
        die "$work/$name-$2.log: $(tail -1 "$work/$name-$2.log")"
      echo '{"psnr": 0}' > "$work/$name-$2.json"
    }
    jq .psnr "$work/$name-$2.json"
  }
  local shuffled neutral predicted
  shuffled=$(scene_of shuffled "$method" 1 steady)
  verdict "city, seed 1, trained with shuffled EXIF less with the true one, held-out PSNR in dB" \
    "$(shortfall "$shuffled" "$(jq .psnr "$work/jittered-$method-1$suffix.json")")" '>=' -0.1
  for capture in jittered shuffled; do
    neutral=$(exposed_scene "$capture" neutral)
    predicted=$(exposed_scene "$capture" predicted)
    echo "$capture, seed 1, photographs as they are: neutral $neutral dB, predicted $predicted dB (0: refused)"
    [ "$capture" = jittered ] || [ "$predicted" = 0 ] ||
      verdict "city, EXIF shuffled, predicted less neutral, PSNR in dB" "$(shortfall "$predicted" "$neutral")" '>=' -0.1
    [ "$capture" = shuffled ] ||
      verdict "city, predicted less neutral, PSNR in dB" "$(shortfall "$predicted" "$neutral")" '>=' 0
  done
}

# truth NAME BLOCKS OVERLAP: a survey with the true poses in NAME-truth, and its photographs alone, without them, in NAME-photos.
truth() {
  [ -e "$work/$1-truth/transforms.json" ] || "$tessera" synth city "$work/$1-truth" --blocks "$2" --overlap "$3" \
    --size 800x600 --gps-noise 2,0.5 --height-offsets 15
  mkdir -p "$work/$1-photos"
  cp -n "$work/$1-truth"/images/*.jpg "$work/$1-photos/"
}

# compared NAME TRUTH: the poses of a run against the true ones.
compared() { python3 bench/pose_errors.py "$work/$1" "$work/$2-truth" "$work/$1.json" > /dev/null; }
value() { jq "$2" "$work/$1.json"; }

# georeferenced NAME: scale, rotation and middle from GPS against the true ones.
georeferenced() {
  local what
  for what in scale rotation_degrees middle_metres; do
    verdict "$1, error of $what from GPS, in standard errors" \
      "$(value "$1" ".georeference.$what / .georeference.predicted.$what | fabs")" '<=' 2
  done
}

survey() {
  truth survey 2x2 75
  posed survey "$work/survey-photos"
  compared survey survey
  verdict "survey, share of photos with poses" "$(value survey '.registered / .photos')" '>=' 0.98
  verdict "survey, median error in metres" "$(value survey .shape.median_metres)" '<=' 0.1
  verdict "survey, median error in degrees" "$(value survey .shape.median_degrees)" '<=' 0.05
  verdict "survey, worst error in metres" "$(value survey .shape.worst_metres)" '<=' 0.5
  georeferenced survey
}

sizes() {
  truth few 1x2 77
  truth many 3x3 77
  local size
  for size in few many; do
    posed "$size" "$work/$size-photos"
    compared "$size" "$size"
    verdict "$size, share of $(value "$size" .photos) photos with poses" "$(value "$size" '.registered / .photos')" '>=' 0.98
    verdict "$size, worst error in metres" "$(value "$size" .shape.worst_metres)" '<=' 0.5
    georeferenced "$size"
  done
  # seconds NAME: from the first stage to poses in metres.
  seconds() { jq '[.stages[] | select(.name != "capture") | .seconds] | add' "$work/$1/run.json"; }
  verdict "many, minutes" "$(jq -n "$(seconds many) / 60")" '<=' 90
  verdict "many, seconds for each photo relative to few" \
    "$(jq -n "$(seconds many) / $(value many .photos) / ($(seconds few) / $(value few .photos))")" '<=' 1.5
}

untagged() {
  truth survey 2x2 75
  mkdir -p "$work/untagged-photos"
  python3 - "$work/survey-photos" "$work/untagged-photos" << 'PYTHON'
import sys
from pathlib import Path

source, target = map(Path, sys.argv[1:])
for photo in source.glob("*.jpg"):
    bytes_, kept, at = photo.read_bytes(), bytearray(b"\xff\xd8"), 2
    while bytes_[at + 1] != 0xDA:  # up to the start of the picture
        end = at + 2 + int.from_bytes(bytes_[at + 2 : at + 4], "big")
        if bytes_[at + 1] != 0xE1:
            kept += bytes_[at:end]
        at = end
    (target / photo.name).write_bytes(bytes(kept) + bytes_[at:])
PYTHON
  posed untagged "$work/untagged-photos"
  compared untagged survey
  verdict "untagged, share of photos with poses" "$(value untagged '.registered / .photos')" '>=' 0.95
  verdict "untagged, worst error in metres" "$(value untagged .shape.worst_metres)" '<=' 1
}

# A run to an evaluated scene, and the same killed again and again. Poses depend on the order in which threads end, so the
# scenes are compared that result from one capture.
killed() {
  local method=(--method volume --steps "${STEPS:-1500}" --downscale 4) record=$work/killed.json
  local photos=$data/brighton_beach/images seed=${SEED:-1}
  [ -s "$work/whole/eval.json" ] || "$tessera" run "$photos" "$work/whole" "${method[@]}"
  planned whole
  rm -rf "$work/killed" "$work/again"
  cp "$work/whole/run.json" "$record.unbroken"
  python3 bench/kill_run.py "$seed" 20 "$record" -- "$tessera" run "$photos" "$work/killed" "${method[@]}"
  # What follows the capture, unbroken. The scene has the name of the folder.
  mkdir "$work/again"
  cp -r "$work/killed" "$work/again/killed"
  rm -rf "$work/again/killed"/{model,model.earlier*,scene,eval.json}
  "$tessera" run "$photos" "$work/again/killed" "${method[@]}" --from train
  verdict "brighton_beach, killed, registered of 18" "$(registered killed)" '>=' 18
  verdict "the same, kills" "$(jq .kills "$record")" '>=' 20
  verdict "the same, stages in which it was killed, of $(jq '.reached | length' "$record")" \
    "$(jq '[.reached[] | select(. > 0)] | length' "$record")" '>=' "$(jq '.reached | length' "$record")"
  verdict "the same, programs that survived" "$(jq .survivors "$record")" '<=' 0
  verdict "the same, status of the last attempt, which was not killed" "$(jq .status "$record")" '<=' 0
  verdict "the same, seconds repeated for a kill, at most" "$(jq .repeated_seconds_at_most "$record")" '<=' 180
  verdict "the same, kills of the training after a checkpoint" "$(jq '.resumed | length' "$record")" '>=' 1
  verdict "the same, of these, trainings that did not go on from it" \
    "$(jq '[.resumed[] | select(.first_step < .checkpoint_step)] | length' "$record")" '<=' 0
  verdict "the same, files of the scene that differ from the unbroken one" \
    "$(diff -rq "$work/killed/scene" "$work/again/killed/scene" 2>&1 | wc -l)" '<=' 0
}

# Long enough that the mapper takes snapshots.
killed_survey() {
  local seed=${SEED:-1} record=$work/survey-killed.json
  truth survey 2x2 75
  [ -s "$work/survey/run.json" ] || posed survey "$work/survey-photos"
  rm -rf "$work/survey-killed"
  cp "$work/survey/run.json" "$record.unbroken"
  python3 bench/kill_run.py "$seed" "$((10 + $(jq '.stages | length' "$work/survey/run.json")))" "$record" -- \
    "$tessera" run "$work/survey-photos" "$work/survey-killed" --until capture --holdout none
  verdict "survey, killed, photos with poses of $(registered survey)" "$(registered survey-killed)" '>=' "$(registered survey)"
  verdict "the same, stages in which it was killed, of $(jq '.reached | length' "$record")" \
    "$(jq '[.reached[] | select(. > 0)] | length' "$record")" '>=' "$(jq '.reached | length' "$record")"
  verdict "the same, status of the last attempt, which was not killed" "$(jq .status "$record")" '<=' 0
  verdict "the same, programs that survived" "$(jq .survivors "$record")" '<=' 0
  verdict "the same, seconds repeated for a kill, mean" "$(jq .repeated_seconds_mean "$record")" '<=' 180
}

for row in ${ROWS:-brighton fox served against methods reduced exposure jitter killed survey killed_survey sizes untagged}; do "$row"; done
finish
