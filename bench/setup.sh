# Sourced by the scripts of this folder, which run from the repository's root: paths and shared functions. TESSERA overrides the
# binary; TESSERA_SHARED_DATA names the folder of photographs.
shopt -s inherit_errexit  # in command substitutions, too
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tessera=${TESSERA:-build/release/apps/tessera/tessera}
out=build/bench
mkdir -p "$out"

die() {
  echo "$(basename "$0"): $*" >&2
  exit 1
}

need_tessera() {
  [ -x "$tessera" ] || die "$tessera: not built; run: cmake --preset release && cmake --build --preset release"
}

# Runs at real-time priority if that is allowed (CAP_SYS_NICE), so that other processes disturb the measurement less.
alone() {
  if chrt -r 1 true 2> /dev/null; then chrt -r 1 "$@"; else "$@"; fi
}

# Compares numbers, not text: holds 27.3 '>=' 27.2
# What is not a number holds nowhere.
holds() {
  awk -v a="$1" -v b="$3" -v how="$2" 'BEGIN {
    number = "^[-+]?[0-9]+[.]?[0-9]*([eE][-+]?[0-9]+)?$"
    exit !(a ~ number && b ~ number && (how == ">=" ? a + 0 >= b + 0 : a + 0 <= b + 0))
  }'
}

# verdict WHAT VALUE >=|<= BOUND: prints one line, and remembers a failure for `finish`.
failures=0
verdict() {
  local word=ok
  holds "$2" "$3" "$4" || { word=FAILED; failures=$((failures + 1)); }
  echo "$1: $2 (wanted $3 $4) $word"
}
finish() { [ "$failures" -eq 0 ] || exit 1; }

# interval NUMBERS...: prints the mean and the ends of its 95 % interval (Student's t).
interval() {
  awk 'BEGIN {
    split("12.706 4.303 3.182 2.776 2.571 2.447 2.365 2.306 2.262", t, " ")
    n = ARGC - 1
    for (i = 1; i <= n; ++i) sum += ARGV[i]
    for (i = 1; i <= n; ++i) squares += (ARGV[i] - sum / n) ^ 2
    half = n > 1 && n < 11 ? t[n - 1] * sqrt(squares / (n - 1) / n) : 99
    printf "%.4f %.4f %.4f\n", sum / n, sum / n - half, sum / n + half
  }' "$@"
}

# Prints the file that contains a model's state.
checkpoint() { echo "$1/$(jq -r '.files[0]' "$1/manifest.json")"; }

# The functions below work in the folder $work and do not repeat what exists there.
# settings TEXT: makes the folder, or checks that it was made with the same settings.
settings() {
  mkdir -p "$work"
  [ -e "$work/settings" ] || echo "$1" > "$work/settings"
  [ "$(cat "$work/settings")" = "$1" ] || die "$work was made with $(cat "$work/settings"): repeat those, or remove it"
}
# trained MODEL CAPTURE ARGUMENTS...: trains, or resumes an interrupted run.
trained() {
  local model=$work/$1 capture=$work/$2
  shift 2
  [ -e "$model.done" ] && return
  "$tessera" train "$capture" "$model" --resume "$@" || return
  touch "$model.done"
}
# baked MODEL SCENE CAPTURE
baked() {
  [ -e "$work/$2/tileset.json" ] || "$tessera" bake "$work/$1" "$work/$2" --capture "$work/$3"
}
# The weights of LPIPS: LPIPS, or those in TESSERA_SHARED_DATA if there are any.
lpips=${LPIPS:-}
[ -n "$lpips" ] || [ ! -e "${TESSERA_SHARED_DATA:-}/lpips/alex.safetensors" ] ||
  lpips=$TESSERA_SHARED_DATA/lpips/alex.safetensors
# judged WHAT CAPTURE [LOD]: prints its held-out PSNR, from the file if it was evaluated before; with weights, the file also has
# LPIPS.
judged() {
  local name=$1${3:+-lod$3}
  if [ ! -s "$work/$name.json" ] || { [ -n "$lpips" ] && [ "$(jq .lpips "$work/$name.json")" = null ]; }; then
    "$tessera" eval "$work/$1" "$work/$2" --json "$work/$name.json" --report "$work/$name.html" ${3:+--lod "$3"} \
      ${lpips:+--lpips "$lpips"} > /dev/null
  fi
  jq -r '.psnr * 100 | round / 100' "$work/$name.json"
}
# What is not a number has no difference, so that no verdict on it holds.
shortfall() {
  if holds "$1" '<=' "$1" && holds "$2" '<=' "$2"; then awk -v a="$1" -v b="$2" 'BEGIN { print a - b }'; else echo unknown; fi
}
difference() { shortfall "$1" "$2" | sed 's/^-//'; }

# photographs NAME DOWNSCALE BOUND: imports real photographs, trains for MINUTES with each of SEEDS, and evaluates held-out views.
photographs() {
  local name=$1 downscale=$2 bound=$3 seed psnr
  local data=${TESSERA_SHARED_DATA:?names no folder; it must hold $name/}/$name work
  [ -d "$data" ] || die "$data: no such folder"
  need_tessera
  work=$(mktemp -d)
  trap "rm -rf '$work'" EXIT
  "$tessera" import "$data" "$work/capture" --downscale "$downscale" --holdout every:8
  echo '[]' > "$work/rows.json"
  for seed in ${SEEDS:-1 2 3}; do
    "$tessera" train "$work/capture" "$work/$seed" --method field --minutes "${MINUTES:-10}" --seed "$seed"
    "$tessera" eval "$work/$seed" "$work/capture" --json "$work/eval.json" ${lpips:+--lpips "$lpips"}
    jq --argjson seed "$seed" --slurpfile eval "$work/eval.json" \
      '. + [{seed: $seed, psnr: $eval[0].psnr, ssim: $eval[0].ssim, lpips: $eval[0].lpips, views: $eval[0].views}]' \
      "$work/rows.json" > "$work/next.json"
    mv "$work/next.json" "$work/rows.json"
  done
  jq --argjson minutes "${MINUTES:-10}" '{minutes: $minutes, mean_psnr: (map(.psnr) | add / length), runs: .}' \
    "$work/rows.json" > "$out/$name.json"
  for seed in ${SEEDS:-1 2 3}; do
    psnr=$(jq -r --argjson seed "$seed" '.runs[] | select(.seed == $seed).psnr * 100 | round / 100' "$out/$name.json")
    verdict "$name seed $seed, held-out PSNR in dB" "$psnr" '>=' "$bound"
  done
  echo "$name mean held-out PSNR: $(jq -r '.mean_psnr * 100 | round / 100' "$out/$name.json") dB ($out/$name.json)"
  finish
}
