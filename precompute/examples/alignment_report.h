#pragma once

#include <filesystem>
#include <string>

#include "precompute/examples/example_stage.h"

namespace exmat::precompute {

/// Writes for every pose NAME.vtk (the object in the transferred pose, with the displacement as point data),
/// NAME_example.vtk (the example, scaled and turned into the object's frame beside it) and NAME.svg (both surfaces from
/// three sides), and index.html with all of them, what to change and where they differ. Makes the folder; each file
/// appears whole or not at all. Throws WorkError.
void write_alignment_report(const std::string& asset, const TetMesh& object, const ExampleInput& input,
                            const ShapeStage& stage, const std::filesystem::path& folder);

/// Claims the files that write_alignment_report() will write, as outputs of the command. Throws InputError.
void claim_alignment_report(const AssetConfig& asset, const std::filesystem::path& folder);

/// Legacy VTK text of a tet mesh, with a vector field at its vertices [n x 3] where it has rows.
std::string vtk_text(const TetMesh& mesh, const VertexArray& displacement, const std::string& title);

/// An SVG picture of two surfaces side by side, seen along the three axes.
std::string svg_text(const TetMesh& left, const TetMesh& right, const std::string& title);

}  // namespace exmat::precompute
