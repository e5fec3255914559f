#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/mesh/tet_mesh.h"
#include "precompute/examples/alignment_verdict.h"
#include "precompute/examples/example_stage.h"

namespace exmat::precompute {

/// Writes for every pose NAME.vtk (the object in the transferred pose, with the displacement as point data) and
/// NAME_example.vtk (the example, scaled and turned into the object's frame beside it), and index.html with pictures of
/// all of them, what to change and where they differ. Makes the folder; each file appears whole or not at all. Throws
/// WorkError.
void write_alignment_report(const std::string& asset, const TetMesh& object, const ExampleInput& input,
                            const ShapeStage& stage, const std::filesystem::path& folder);

/// Claims the files that write_alignment_report() will write, as outputs of the command. Throws InputError.
void claim_alignment_report(const AssetConfig& asset, const std::filesystem::path& folder);

/// Legacy VTK text of a tet mesh, with a vector field at its vertices [n x 3] where it has rows.
std::string vtk_text(const TetMesh& mesh, const VertexArray& displacement, const std::string& title);

/// A pose as the object has it and as it was given, both in the object's frame.
struct ReportedPose {
  AlignmentOutcome outcome;
  TetMesh transferred;  ///< the object
  TetMesh given;        ///< the example, as large as the object
};

/// Distance of the middle of each triangle of a surface from another surface [n_f].
Eigen::VectorXd surface_distances(const TetMesh& from, const TetMesh& to);

/// A page in HTML that needs nothing beside it: for each pose the verdict, what to change, and pictures from two sides
/// of the object at rest, of the pose as the object has it and as it was given, and of both coloured by their distance
/// from one another.
std::string alignment_page(const std::string& title, const TetMesh& rest, const std::vector<ReportedPose>& poses);

}  // namespace exmat::precompute
