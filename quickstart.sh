#!/usr/bin/env bash
# From a clean Debian 12 to a measured image: installs packages, builds, makes a small city, trains a model of it in
# blocks, bakes that into a scene of tiles, judges the scene on photos that it has not seen, and serves it to browsers.
# Run again, it goes on where it was.
#   ./quickstart.sh [--no-serve]      --no-serve stops before the scene is served
set -euo pipefail
cd "$(dirname "$0")"
serve=yes
for argument in "$@"; do
  [ "$argument" = --no-serve ] || { echo "usage: $0 [--no-serve]" >&2; exit 2; }
  serve=no
done

tools/install-debian-packages.sh
tools/build.sh release tessera
tools/build-web.sh

tessera=build/release/apps/tessera/tessera
out=out/quickstart
begin=$SECONDS
"$tessera" synth city "$out/city" --blocks 2x2 --size 320x240 --samples 4
if [ ! -e "$out/city.model/plan.json" ]; then rm -rf "$out/city.model"; fi
"$tessera" train "$out/city" "$out/city.model" --method volume --blocks 2x2 --minutes 2 --resume
"$tessera" bake "$out/city.model" "$out/city.scene"
"$tessera" eval "$out/city.scene" "$out/city" --json "$out/result.json" --images "$out/images"
echo
echo "held-out views: $(grep -o '"psnr": *[0-9.]*' "$out/result.json" | head -1 | grep -o '[0-9.]*$') dB PSNR, after $((SECONDS - begin)) s"
echo "scene:          $PWD/$out/city.scene"
echo "report:         $PWD/$out/city.scene/report.html"
echo "images:         $PWD/$out/images"
[ "$serve" = no ] || exec "$tessera" serve "$out/city.scene"
