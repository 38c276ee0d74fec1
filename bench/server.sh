#!/usr/bin/env bash
# `tessera serve` under attack: paths that lead outside, malformed requests, 500 clients that stall in five ways, twice; meanwhile a
# well-behaved client is served.
#   bench/server.sh [SECONDS]
# Each client may cost the server one 64 KiB piece of a file and 16 KiB of headers in both directions: 40 MiB for 500 clients. It
# may cost the system 128 KiB of unsent data, or 256 KiB with overhead and data in flight: 125 MiB.
set -euo pipefail
source "$(dirname "$0")/setup.sh"
need_tessera
work=$(mktemp -d)
server= first=()
chrt -r 1 true 2> /dev/null && first=(chrt -r 1)  # like `alone`, which would start another process
trap '[ -z "$server" ] || kill "$server" 2> /dev/null; rm -rf "$work"' EXIT
secret=secret-$RANDOM$RANDOM$RANDOM
cp -r tests/golden/volume "$work/scene"
mkdir -p "$work/viewer" "$work/scene-beside" "$work/scene/.git"
echo '<!doctype html><title>a page</title>' > "$work/viewer/index.html"
head -c 8388608 /dev/urandom > "$work/scene/large.glb"
for file in secret.txt scene-beside/secret.txt scene/.hidden scene/tiles/.hidden scene/.git/config; do
  echo "$secret" > "$work/$file"
done
ln -s ../secret.txt "$work/scene/out.txt"
ln -s .. "$work/scene/up"
ln -s out.txt "$work/scene/chain.txt"
ln -s .hidden "$work/scene/shown.txt"
ln -s /proc/self/environ "$work/scene/environ"
ln -s /proc/self/fd "$work/scene/descriptors"
ln -s /etc/passwd "$work/scene/passwd"
ln -s / "$work/scene/root"
ln -s loop "$work/scene/loop"
mkfifo "$work/scene/pipe"

SECRET=$secret "${first[@]}" "$tessera" serve "$work/scene" --viewer "$work/viewer" --port 0 > "$work/said" &
server=$!
for _ in {1..100}; do grep -q http:// "$work/said" && break; sleep 0.1; done
port=$(grep -oP 'http://127.0.0.1:\K[0-9]+' "$work/said") || die "the server does not say where it is"
"${first[@]}" python3 bench/server_clients.py "$port" "$server" "$work" "$secret" "${1:-20}" > "$out/server.json" ||
  die "the server is gone"
figure() { jq -r "$1" "$out/server.json"; }
verdict "answers to $(figure .traversal.requests) requests for what is no file of the scene, that hold a secret" \
  "$(figure .traversal.leaks)" '<=' 0
verdict "  that are not refused (4xx)" "$(figure .traversal.not_refused)" '<=' 0
for storm in storm second_storm; do
  verdict "clients that stall, on average, as those that are closed come again" "$(figure ".$storm.stalled")" '>=' 490
  verdict "  the longest of $(figure ".$storm.fetches") honest fetches meanwhile, in s" \
    "$(figure ".$storm.longest_s")" '<=' 1
  verdict "  of these, not what they should be" "$(figure ".$storm.wrong")" '<=' 0
  verdict "  growth of the server's memory in MiB" "$(figure ".$storm.growth_mib")" '<=' 40
  verdict "  growth of the system's memory for TCP in MiB" "$(figure ".$storm.system_mib")" '<=' 125
done
verdict "answers to $(figure .garbage.requests) requests cut off, altered and made up, that make no sense" \
  "$(figure .garbage.bad)" '<=' 0
verdict "memory kept from the second time on, in MiB above $(figure .first_mib)" "$(figure .kept_mib)" '<=' 1
verdict "descriptors left open" "$(figure .descriptors_more)" '<=' 0
kill -INT "$server"
status=0
wait "$server" || status=$?
server=
verdict "exit status of the server" "$status" '<=' 0
finish
