#!/usr/bin/env bash
# Builds the browser's viewer into web/dist; packages are downloaded from npm, as pinned in web/package-lock.json.
#   tools/build-web.sh [--packages-only]
set -euo pipefail
cd "$(dirname "$0")/../web"
if ! cmp -s package-lock.json node_modules/.installed.json; then
  npm ci --no-audit --no-fund --loglevel=error
  cp package-lock.json node_modules/.installed.json
fi
[ "${1:-}" = --packages-only ] || npm run --silent build
