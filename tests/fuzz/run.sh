#!/bin/sh
# Builds every fuzzer and runs each for SECONDS (default 20), as many at a time as there are processors. Fails if one finds
# something; the input that caused it is kept in ./fuzz-findings.
#   tests/fuzz/run.sh [SECONDS] [FUZZER ...]
set -eu
cd "$(dirname "$0")/../.."
seconds=${1:-20}
[ $# -gt 0 ] && shift
build=${TESSERA_FUZZ_BUILD:-build/fuzz}
cmake --preset fuzz -B "$build" >/dev/null
cmake --build "$build" --target fuzzers
corpus=$(mktemp -d)
trap 'rm -rf "$corpus"' EXIT
"$build/tests/fuzz/make_seeds" "$corpus"
[ $# -gt 0 ] || set -- $(ls "$corpus")
mkdir -p fuzz-findings
cat > "$corpus/.run" <<'RUN'
build=$1 seconds=$2 name=$3
log=${0%/*}/$name.log
export ASAN_OPTIONS="log_path=$log.asan" UBSAN_OPTIONS="print_stacktrace=1:log_path=$log.asan"
if "$build/tests/fuzz/fuzz_$name" -max_total_time="$seconds" -rss_limit_mb=2048 -timeout=10 -max_len=16384 -close_fd_mask=3 \
  -artifact_prefix="fuzz-findings/$name-" "${0%/*}/$name" >"$log" 2>&1; then
  echo "fuzz $name: $(grep -o 'Done .*' "$log" || echo done)"
else
  { echo "fuzz $name: a finding"; tail -n 20 "$log"; cat "$log.asan"* 2>/dev/null || true; } >&2
  exit 1
fi
RUN
failed=0
printf '%s\n' "$@" | xargs -P "$(nproc)" -n 1 sh "$corpus/.run" "$build" "$seconds" || failed=1
rmdir fuzz-findings 2>/dev/null || true
exit $failed
