#!/usr/bin/env bash
# From a fresh Debian 12 to an assembled pair of clouds, and a picture of it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tools/install_packages.sh build
cmake --preset release >/dev/null
cmake --build --preset release

bitr=build/release/bitr
example=build/example
if [[ ! -e $example/aircraft_000_truth.json ]]; then
  "$bitr" generate aircraft --share 0.5 --points 1024 --noise 0.005 --out "$example" --count 1 --seed 20005
fi

page=()
if [[ -d viewer/node_modules ]]; then
  page=(--view "$example/assembly.html")
fi

cat <<'TEXT'

Two halves of an aeroplane that the model has never seen, without any overlap, each in a frame of its own:

TEXT
"$bitr" assemble "$example/aircraft_000_source.ply" "$example/aircraft_000_reference.ply" \
  --truth "$example/aircraft_000_truth.json" -o "$example/assembled.ply" --json "$example/assembly.json" \
  --image "$example/assembly.png" "${page[@]}"

cat <<TEXT

"error" above compares the pose with $example/aircraft_000_truth.json.
Written to $PWD/$example:
  assembly.png    the two halves as they were given, and assembled
  assembled.ply   both clouds in the reference's frame, the source in orange
  assembly.json   the pose, the diagnostics, the times
TEXT
if ((${#page[@]})); then
  echo "  assembly.html   both halves in 3-D, for a browser"
fi
