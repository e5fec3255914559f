#!/usr/bin/env bash
# Precomputes the bundle of an example's scene, steps it and compares what came out with what is expected.
#   examples/tools/run_scene.sh SCENE.json OUTPUT_FOLDER [FOLDER_OF_PROGRAMS]    (03_car_wall/scene_arc_paper.json)
# asset_NAME.json and expected_NAME.json lie beside scene_NAME.json; an example of one scene leaves out _NAME. Where there is a surface and
# no asset, the bundle is made from the surface, and the motion exported beside the trajectory.
# Of a scene of several bodies NAME.h5 is made from asset_NAME.json.
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
if grep -q '"bodies"' "$source"; then
  for bundle in $(member bundle | sort -u); do
    "$programs/exmat-precompute" bundle "$folder/asset_${bundle%.h5}.json" -o "$output/$bundle"
  done
  for poses in $(member poses); do cp "$folder/$poses" "$output"; done
  "$programs/exmat-runtime" run "$output/scene$variant.json"
  exec "$here/expect.py" "$folder/expected$variant.json" "$output/$(member trajectory)"
fi

asset=$folder/asset$variant.json
surface=$(find "$folder" -maxdepth 1 -name '*.glb')
[ -e "$asset" ] || asset=$surface

"$programs/exmat-precompute" bundle "$asset" --scene "$source" -o "$output/$(member bundle)"
"$programs/exmat-runtime" run "$output/scene$variant.json"
if [ "$asset" = "$surface" ]; then
  trajectory=$output/$(member trajectory)
  "$programs/exmat-runtime" export "$trajectory" -o "${trajectory%.h5}.glb"
fi
"$here/expect.py" "$folder/expected$variant.json" "$output/$(member trajectory)"
