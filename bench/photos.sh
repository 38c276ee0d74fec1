#!/usr/bin/env bash
# Photographs without poses, as JPEG files alone, through `tessera run`.
#   brighton  18 nadir photographs: all get poses; minutes of each stage
#   fox       50 hand-held photographs without GPS and EXIF: at least 49 get poses
#   survey    a survey of a city of 2x2 blocks in 202 photographs of 800x600, GPS errors of 2 m and 0.5 m, one flight 15 m too high:
#             at least 98 % get poses; after the best similarity to the true ones 0.1 m, 0.05 degrees (medians, without a pose:
#             infinite) and 0.5 m (worst); scale, rotation and middle from GPS within twice the predicted standard errors
#   exposure  brighton_beach at 400x225, ten minutes of `field`: exposures predicted from EXIF at least 0.4 dB above neutral, and on
#             the right halves of the views at most 0.2 dB below fitted ones
#   killed    brighton_beach to an evaluated scene of `volume`, killed 20 times, at least once in each stage: all photos get poses, at most
#             three minutes are repeated each time, no program survives, and the scene has the bytes of an unbroken training
#   against   brighton_beach at 400x225 and fox at 270x480, with the poses of `run` and with the poses that the data has: the scenes of
#             ten minutes of `volume`, held-out PSNR at most 0.3 dB lower, mean of the seeds
#   jitter    a city whose photographs differ by half a stop: a model of it, compared with the held-out views of the same city without
#             these differences, at most 0.3 dB below a model of that one; with the exposures of EXIF shuffled, too
#   untagged  the same photographs as in survey, without EXIF and XMP: at least 95 % get poses, none more than 1 m off
# Of each run: its time within twice what it had expected at the start, stages within 1.5 times, memory between half and all of it.
# Resumable: everything is kept in build/bench/photos, and what exists is not made again.
#   TESSERA_SHARED_DATA=DIR [ROWS="brighton fox against exposure jitter killed survey untagged"] [SEEDS="1 2 3"] [MINUTES=10] bench/photos.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
data=${TESSERA_SHARED_DATA:?names no folder; it must hold brighton_beach/ and fox/}
for name in brighton_beach fox; do [ -d "$data/$name" ] || die "$data/$name: no such folder"; done
work=$out/photos
mkdir -p "$work"

# posed NAME PHOTOS: finds the poses, and prints minutes and memory of each stage.
posed() {
  "$tessera" run "$2" "$work/$1" --until capture --holdout none
  jq -r '.stages[] | select(.seconds >= 1) |
    "\(.name): \(.seconds / 6 | round / 10) min, \(.peak_bytes / 1048576 | round) MiB: \(.summary)"' "$work/$1/run.json"
  planned "$1"
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

# scene_of CAPTURE SEED: trains, bakes and evaluates, and prints the held-out PSNR.
scene_of() {
  local name=$1-volume-$2
  trained "$name" "$1" --method volume --minutes "${MINUTES:-10}" --seed "$2" >&2
  [ -e "$work/$name.scene/tileset.json" ] || "$tessera" bake "$work/$name" "$work/$name.scene" --capture "$work/$1" >&2
  [ -s "$work/$name.json" ] || "$tessera" eval "$work/$name.scene" "$work/$1" --json "$work/$name.json" \
    --report "$work/$name.html" ${lpips:+--lpips "$lpips"} >&2
  jq .psnr "$work/$name.json"
}

# against_poses NAME FOLDER DOWNSCALE
against_poses() {
  local seed own given differences=()
  [ -e "$work/$1-own/transforms.json" ] || {
    "$tessera" run "$2/images" "$work/$1-posed" --until capture --downscale "$3" --holdout every:8
    cp -r "$work/$1-posed/capture" "$work/$1-own"
  }
  [ -e "$work/$1-given/transforms.json" ] || "$tessera" import "$2" "$work/$1-given" --downscale "$3" --holdout every:8
  for seed in ${SEEDS:-1 2 3}; do
    own=$(scene_of "$1-own" "$seed") given=$(scene_of "$1-given" "$seed")
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
    model=beach-$seed
    trained "$model" beach --method field --minutes "${MINUTES:-10}" --seed "$seed"
    neutral=$(exposed "$model" neutral "$model-neutral")
    predicted=$(exposed "$model" predicted "$model-predicted")
    echo "brighton_beach, seed $seed: neutral $neutral dB, predicted $predicted dB"
    verdict "seed $seed, predicted less neutral, held-out PSNR in dB" "$(shortfall "$predicted" "$neutral")" '>=' 0.4
    verdict "seed $seed, fitted less predicted on the right halves, held-out PSNR in dB" \
      "$(shortfall "$(exposed "$model" fitted "$model-fitted")" \
        "$(exposed "$model" predicted "$model-right" --right-halves)")" '<=' 0.2
  done
}

jitter() {
  local seed steady=() jittered=() shuffled=()
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
  # judged CAPTURE SEED: a model of it, compared with the held-out views without jitter.
  judged() {
    trained "$1-field-$2" "$1" --method field --minutes "${MINUTES:-10}" --seed "$2" >&2
    [ -s "$work/$1-$2.json" ] || "$tessera" eval "$work/$1-field-$2" "$work/steady" --json "$work/$1-$2.json" \
      --report "$work/$1-$2.html" ${lpips:+--lpips "$lpips"} >&2
    jq .psnr "$work/$1-$2.json"
  }
  for seed in ${SEEDS:-1 2 3}; do
    steady+=("$(judged steady "$seed")") jittered+=("$(judged jittered "$seed")") shuffled+=("$(judged shuffled "$seed")")
    echo "city, seed $seed: ${steady[-1]} dB, with jitter ${jittered[-1]} dB, with EXIF shuffled, too, ${shuffled[-1]} dB"
  done
  mean() { printf '%s\n' "$@" | jq -s 'add / length'; }
  verdict "city, trained with jitter less without, mean held-out PSNR in dB" \
    "$(shortfall "$(mean "${jittered[@]}")" "$(mean "${steady[@]}")")" '>=' -0.3
  verdict "city, EXIF shuffled less EXIF, mean held-out PSNR in dB" \
    "$(shortfall "$(mean "${shuffled[@]}")" "$(mean "${jittered[@]}")")" '>=' -0.1
}

truth() {
  [ -e "$work/truth/transforms.json" ] || "$tessera" synth city "$work/truth" --blocks 2x2 --overlap 75 --size 800x600 \
    --gps-noise 2,0.5 --height-offsets 15
  # The photographs alone: the program must not see the true poses beside them.
  mkdir -p "$work/photos"
  cp -n "$work"/truth/images/*.jpg "$work/photos/"
}

# compared NAME: the poses of a run against the true ones.
compared() { python3 bench/pose_errors.py "$work/$1" "$work/truth" "$work/$1.json" > /dev/null; }
value() { jq "$2" "$work/$1.json"; }

survey() {
  truth
  posed survey "$work/photos"
  compared survey
  verdict "survey, share of photos with poses" "$(value survey '.registered / .photos')" '>=' 0.98
  verdict "survey, median error in metres" "$(value survey .shape.median_metres)" '<=' 0.1
  verdict "survey, median error in degrees" "$(value survey .shape.median_degrees)" '<=' 0.05
  verdict "survey, worst error in metres" "$(value survey .shape.worst_metres)" '<=' 0.5
  local what
  for what in scale rotation_degrees middle_metres; do
    verdict "survey, error of $what from GPS, in standard errors" \
      "$(value survey ".georeference.$what / .georeference.predicted.$what | fabs")" '<=' 2
  done
}

untagged() {
  truth
  mkdir -p "$work/untagged-photos"
  python3 - "$work/photos" "$work/untagged-photos" << 'PYTHON'
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
  compared untagged
  verdict "untagged, share of photos with poses" "$(value untagged '.registered / .photos')" '>=' 0.95
  verdict "untagged, worst error in metres" "$(value untagged .shape.worst_metres)" '<=' 1
}

# A run to an evaluated scene, and the same killed again and again. Poses depend on the order in which threads end, so the
# scenes are compared that result from one capture.
killed() {
  local method=(--method volume --steps "${STEPS:-300}" --downscale 4) record=$work/killed.json
  local photos=$data/brighton_beach/images seed=${SEED:-1}
  [ -s "$work/whole/eval.json" ] || "$tessera" run "$photos" "$work/whole" "${method[@]}"
  planned whole
  rm -rf "$work/killed" "$work/again"
  cp "$work/whole/run.json" "$record.unbroken"
  python3 bench/kill_run.py "$seed" 20 "$record" -- "$tessera" run "$photos" "$work/killed" "${method[@]}"
  # What follows the capture, unbroken.
  cp -r "$work/killed" "$work/again"
  rm -rf "$work/again"/{model,model.earlier*,scene,eval.json}
  "$tessera" run "$photos" "$work/again" "${method[@]}" --from train
  verdict "brighton_beach, killed, registered of 18" "$(registered killed)" '>=' 18
  verdict "the same, kills" "$(jq .kills "$record")" '>=' 20
  verdict "the same, stages in which it was killed, of $(jq '.reached | length' "$record")" \
    "$(jq '[.reached[] | select(. > 0)] | length' "$record")" '>=' "$(jq '.reached | length' "$record")"
  verdict "the same, programs that survived" "$(jq .survivors "$record")" '<=' 0
  verdict "the same, seconds repeated for each kill" "$(jq .repeated_seconds_per_kill "$record")" '<=' 180
  verdict "the same, files of the scene that differ from the unbroken one" \
    "$(diff -rq "$work/killed/scene" "$work/again/scene" | wc -l)" '<=' 0
}

for row in ${ROWS:-brighton fox against exposure jitter killed survey untagged}; do "$row"; done
finish
