#!/usr/bin/env bash
# Builds the developer preset and runs every test.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tools/install_packages.sh test
cmake --preset dev >/dev/null
cmake --build --preset dev
ctest --preset dev
