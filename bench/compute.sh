#!/usr/bin/env bash
# The rate of every operation relative to the machine's own limit, and the whole training step. Of several rounds, the best of each
# operation and of each limit counts, because on a shared machine other processes disturb now one, now the other.
#   [THREADS=0] [ROUNDS=5] bench/compute.sh
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
rounds=()
for round in $(seq "${ROUNDS:-5}"); do
  rounds+=("$out/compute.$round.json")
  alone "$tessera" bench compute --threads "${THREADS:-0}" --json "${rounds[-1]}" | tee "$out/compute.txt"
done
jq -s '{device: .[0].device, rounds: length, flops_per_second: map(.flops_per_second) | max,
  operations: map(.operations[]) | group_by([.operation, .shape])
    | map(.[0] + {seconds: map(.seconds) | min, rate: map(.rate) | max, limit: map(.limit) | max})
    | map(.share = if .limit then .rate / .limit else null end)}' "${rounds[@]}" > "$out/compute.json"
rm "${rounds[@]}"
alone "$tessera" bench train --threads "${THREADS:-0}" --json "$out/train.json" | tee -a "$out/compute.txt"
verdict "training step, M samples/s" "$(jq '.samples_per_second / 1e6 * 1000 | round / 1000' "$out/train.json")" '>=' 0.5
# row OPERATION SHAPE: prints its share of the limit in percent.
row() { jq --arg o "$1" --arg s "$2" '.operations[] | select(.operation == $o and .shape == $s).share * 1000 | round / 10' "$out/compute.json"; }
for samples in 65536 8192; do
  for network in 64-64-64-64 'density 32-64-16' 'colour 32-64-64-3'; do
    verdict "network $network forward and backward, $samples samples, % of peak" "$(row 'Mlp both' "$network, $samples samples")" '>=' 60
  done
  for points in 'random points' 'points on rays'; do
    shape="16 levels x 2, $points, $samples samples"
    verdict "hash grid forward, $points, $samples samples, % of gather rate" "$(row HashGridForward "$shape")" '>=' 80
    verdict "hash grid backward, $points, $samples samples, % of gather rate" "$(row HashGridBackward "$shape")" '>=' 50
  done
done
# The virtual grid, for which no bound is required.
jq -r '[.operations[] | select(.operation | IN("DistinctTexels", "VirtualGridForward", "VirtualGridBackward"))]
  | (.[0].shape | split(" ")[0] | tonumber / 1e6) as $samples
  | (.[] | "\(.operation), \(.shape): \($samples / .seconds * 100 | round / 100) M samples/s, "
      + (if .share then "\(.share * 1000 | round / 10) % of the limit" else "no limit known" end)),
    "virtual grid, all three: \($samples / (map(.seconds) | add) * 100 | round / 100) M samples/s"' "$out/compute.json"
finish
