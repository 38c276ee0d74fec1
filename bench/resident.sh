#!/usr/bin/env bash
# City-on-Web with four resident blocks at a time against all of them: a city of 4x4 blocks, equal steps of equal numbers of rays,
# so equal samples (by default, the number of rays per step follows from a number of texels: more rays if fewer blocks are
# resident). Reports the held-out PSNR of both, and the memory that the process used against what it announced. Resumable: what is
# in build/bench/resident is not made again.
#   [STEPS=4000] [RAYS=4096] [SIZE=400x300] bench/resident.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
work=$out/resident
steps=${STEPS:-4000} rays=${RAYS:-4096} size=${SIZE:-400x300}
settings "STEPS=$steps RAYS=$rays SIZE=$size"

[ -e "$work/city/transforms.json" ] || "$tessera" synth city "$work/city" --blocks 4x4 --size "$size"
# run NAME ARGUMENTS...: keeps the output, which announces how much memory the run will use.
run() {
  local name=$1
  shift
  trained "$name" city --method volume --blocks 4x4 --steps "$steps" --set lod_step_fraction=0 --set first_rays="$rays" \
    --set max_rays="$rays" --set texels_per_step=$((256 * rays)) "$@" 2>&1 | tee -a "$work/$name.log"
}
# Values from a run's metrics: MiB, and millions of samples.
peak() { jq -s 'map(.peak_rss_bytes) | max / 1048576 | round' "$work/$1/metrics.jsonl"; }
samples() {
  jq -s 'map(.seconds) as $t | [range(1; length) as $i | .[$i].samples_per_second * ([0, $t[$i] - $t[$i - 1]] | max)]
    | (add // 0) / 1e6 | round' "$work/$1/metrics.jsonl"
}

run all
run four --resident-blocks 4
all=$(judged all city) four=$(judged four city)
stated=$(grep -o 'memory: at most [0-9]* MiB' "$work/four.log" | head -1 | grep -o '[0-9]*')
echo "city 4x4, $steps steps: all in memory $all dB, $(peak all) MiB, $(samples all) M samples; four at a time $four dB, $(peak four) MiB of $stated stated, $(samples four) M samples"
verdict "city 4x4, all in memory less four at a time in dB" "$(shortfall "$all" "$four")" '<=' 0.3
verdict "city 4x4, four at a time, memory in MiB" "$(peak four)" '<=' "$stated"
finish
