#!/usr/bin/env bash
# Tests that a refactoring changes no bytes: on a synthetic city of 2x2 blocks, two commits train the same models with each method
# and bake the same scenes, byte for byte; their golden scenes hold the same numbers. Prints one line for each comparison.
#   [STEPS=300] [METHODS="field volume hash"] bench/same_bytes.sh BEFORE_COMMIT [AFTER_COMMIT=HEAD]
# BEFORE_PROGRAM and AFTER_PROGRAM name programs that are already built from those commits; otherwise both are built. KEEP names a
# folder that keeps the results; what the first commit made there is not made again. Help texts in the comments of config.toml may
# differ.
set -euo pipefail
source "$(dirname "$0")/setup.sh"
before=${1:?usage: bench/same_bytes.sh BEFORE_COMMIT [AFTER_COMMIT]} after=${2:-HEAD}
steps=${STEPS:-300} methods=${METHODS:-field volume hash}
work=${KEEP:-$(mktemp -d)}
mkdir -p "$work"
work=$(cd "$work" && pwd)
trees=()
root=$PWD
leave() {
  for tree in "${trees[@]}"; do git -C "$root" worktree remove --force "$tree" || true; done
  [ -n "${KEEP:-}" ] || rm -rf "$work"
}
trap leave EXIT

# program NAME COMMIT GIVEN: prints the program's path.
program() {
  if [ -n "$3" ]; then
    realpath "$3"
    return
  fi
  (cd "$work/$1-source" && tools/build.sh release tessera) >&2
  echo "$work/$1-source/build/release/apps/tessera/tessera"
}
for side in before after; do
  given=BEFORE_PROGRAM
  [ "$side" = before ] || given=AFTER_PROGRAM
  [ -z "${!given:-}" ] || continue
  git worktree add --detach "$work/$side-source" "${!side}" >&2
  trees+=("$work/$side-source")
done
programBefore=$(program before "$before" "${BEFORE_PROGRAM:-}")
programAfter=$(program after "$after" "${AFTER_PROGRAM:-}")

[ -e "$work/city/transforms.json" ] ||
  "$programBefore" synth city "$work/city" --blocks 2x2 --photos 24 --size 160x120 --samples 2 --traffic

# run SIDE PROGRAM: makes all models and scenes. Both sides work in the folder `run`, because files may contain their own path.
run() {
  rm -rf "$work/run" "${work:?}/$1"
  mkdir "$work/run"
  cd "$work/run"
  train() {
    local model=$1
    shift
    "$program" train ../city "$model" --steps "$steps" --seed 7 --checkpoint-seconds 1000000 --device cpu "$@"
  }
  bake() { "$program" bake "$1" "$1.scene" --stride 4 "${@:2}"; }
  local program=$2 method
  for method in $methods; do
    case $method in
      field) train field --method field --set samples_per_step=8192 --set samples_per_micro_batch=2048 ;;
      volume)
        train volume --method volume --blocks 2x2 --set texels_per_step=131072
        bake volume
        train volume-in-turns --method volume --blocks 2x2 --set texels_per_step=131072 --resident-blocks 2
        bake volume-in-turns --resident-blocks 2
        ;;
      hash)
        train hash --method hash --blocks 2x2 --set samples_per_step=16384
        bake hash
        ;;
    esac
  done
  cd - > /dev/null
  mv "$work/run" "$work/$1"
}
[ -d "$work/before" ] || run before "$programBefore" >&2
run after "$programAfter" >&2

for side in before after; do
  mkdir -p "$work/$side/golden"
  git archive "${!side}" tests/golden | tar -x -C "$work/$side/golden"
done
python3 bench/same_bytes.py "$work/before" "$work/after"
