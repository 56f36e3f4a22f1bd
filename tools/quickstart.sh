#!/usr/bin/env bash
# From a fresh Debian 12 to an assembled pair of clouds.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tools/install_packages.sh build
cmake --preset release >/dev/null
cmake --build --preset release

bitr=build/release/bitr
example=build/example
if [[ ! -e $example/copy_000_truth.json ]]; then
  "$bitr" generate copy --out "$example" --count 1 --seed 1
fi

cat <<'TEXT'

Assembling a solid with a moved copy of itself by complete matching: no trained model ships yet, and complete
matching needs none. It returns f(X,Y)∘f(X,X), which the network's symmetry makes exact for any weights.

TEXT
"$bitr" assemble "$example/copy_000_source.ply" "$example/copy_000_reference.ply" --complete-match \
  --truth "$example/copy_000_truth.json" -o "$example/assembled.ply" --json "$example/assembly.json"

cat <<TEXT

"error" above compares the pose with $example/copy_000_truth.json.
Written to $PWD/$example:
  assembled.ply   both clouds in the reference's frame, the source in orange
  assembly.json   the pose, the diagnostics, the times
TEXT
