#!/usr/bin/env bash
# The same seed gives the same final checkpoint, byte for byte: with one thread, with two, and when the run is killed with SIGKILL
# ten times at random moments and resumed.
#   [STEPS=1500] [KILLS=10] [RANDOM_SEED=N] bench/determinism.sh [CAPTURE]     default: a small city made here
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
steps=${STEPS:-1500} kills=${KILLS:-10}
seed=${RANDOM_SEED:-$$}
RANDOM=$seed
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
capture=${1:-$work/city}
[ -e "$capture" ] || "$tessera" synth city "$capture" --blocks 1x1 --photos 16 --size 160x120 --samples 2 --traffic

train() { "$tessera" train "$capture" "$@" --method field --steps "$steps" --seed 7 --set samples_per_step=8192 --set samples_per_micro_batch=2048; }

train "$work/one" --threads 1
started=$(date +%s%N)
train "$work/two" --threads 2
lasted=$(($(date +%s%N) - started))

# Moments within a sixth of the run, so that all ten are before its end.
killed=0
mkdir "$work/killed"
while [ "$killed" -lt "$kills" ]; do
  nap=$(awk -v l="$lasted" -v k="$kills" -v r="$RANDOM" 'BEGIN { printf "%.3f", 0.05 + l / 1e9 * 1.6 / k * r / 32768 }')
  "$tessera" train "$capture" "$work/killed" --method field --steps "$steps" --seed 7 --set samples_per_step=8192 --set samples_per_micro_batch=2048 \
    --threads 2 --resume --checkpoint-seconds 0.3 > "$work/log" 2>&1 &
  pid=$!
  sleep "$nap"
  kill -9 "$pid" 2> /dev/null || die "the run ended after $killed kills; raise STEPS (random seed $seed): $(tail -n 1 "$work/log")"
  wait "$pid" 2> /dev/null || true
  killed=$((killed + 1))
  at=$( [ -e "$work/killed/manifest.json" ] && jq .step "$work/killed/manifest.json" || echo none)
  echo "kill $killed after $nap s; last checkpoint at step $at"
done
train "$work/killed" --threads 2 --resume

sum() { sha256sum < "$(checkpoint "$work/$1")" | cut -d' ' -f1; }
one=$(sum one) two=$(sum two) resumed=$(sum killed)
printf '%s  1 thread\n%s  2 threads\n%s  killed %d times (random seed %d)\n' \
  "$one" "$two" "$resumed" "$killed" "$seed" | tee "$out/determinism.txt"
[ "$one" = "$two" ] && [ "$two" = "$resumed" ] || die "checkpoints differ"
echo "determinism: identical after $steps steps"
