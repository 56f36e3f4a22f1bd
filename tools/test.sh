#!/usr/bin/env bash
# Builds the developer preset and runs its tests; with BITR_SLOW_TESTS=ON in the environment also those that take
# minutes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tools/install_packages.sh test
cmake --preset dev -DBITR_SLOW_TESTS="${BITR_SLOW_TESTS:-OFF}" >/dev/null
cmake --build --preset dev
ctest --preset dev
