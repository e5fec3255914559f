#!/usr/bin/env bash
# Precomputes the bundle of an example's scene, steps it and compares what came out with what is expected.
#   examples/tools/run_scene.sh SCENE.json OUTPUT_FOLDER [FOLDER_OF_PROGRAMS]    (03_car_wall/scene_arc_paper.json)
# asset_NAME.json and expected_NAME.json lie beside scene_NAME.json; an example of one scene leaves out _NAME.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
source=$1
output=$2
programs=${3:-$here/../../build/release/bin}
folder=$(dirname "$source")
variant=$(basename "$source" .json)
variant=${variant#scene}

member() { sed -n "s/.*\"$1\": *\"\([^\"]*\)\".*/\1/p" "$source"; }

mkdir -p "$output"
cp "$source" "$output/scene$variant.json"
"$programs/exmat-precompute" bundle "$folder/asset$variant.json" --scene "$source" -o "$output/$(member bundle)"
"$programs/exmat-runtime" run "$output/scene$variant.json"
"$here/expect.py" "$folder/expected$variant.json" "$output/$(member trajectory)"
