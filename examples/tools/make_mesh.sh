#!/usr/bin/env bash
# Tessellates a Gmsh file into tets (./install-dependencies meshes brings Gmsh 4.8).   make_mesh BODY.geo MESH.msh
set -euo pipefail
raw=$(mktemp --suffix .msh)
trap 'rm -f "$raw"' EXIT
gmsh -3 -v 2 -nt 1 -format msh22 "$1" -o "$raw"
"$(dirname "$0")"/pose.py "$raw" "$2"
