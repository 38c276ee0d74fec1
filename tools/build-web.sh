#!/usr/bin/env bash
# Builds the browser's viewer into web/dist; packages come from npm, as web/package-lock.json names them.
#   tools/build-web.sh [--packages-only]
set -euo pipefail
cd "$(dirname "$0")/../web"
if [ ! node_modules/.package-lock.json -nt package-lock.json ]; then
  npm ci --no-audit --no-fund --loglevel=error
  touch node_modules/.package-lock.json
fi
[ "${1:-}" = --packages-only ] || npm run --silent build -- --logLevel warn
