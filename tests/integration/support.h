#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/pipeline/build_reduced_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::test {

using Json = nlohmann::json;

/// Outcome of a program.
struct Outcome {
  int status = -1;  ///< exit status, or 128 + signal
  std::string output, errors;
};

/// Runs a program (a path, or a name to look for in PATH; status 127 where there is none) and waits for it.
Outcome execute(const std::filesystem::path& program, const std::vector<std::string>& arguments);

/// The two programs of this build.
Outcome exmat_precompute(const std::vector<std::string>& arguments);
Outcome exmat_runtime(const std::vector<std::string>& arguments);

/// A bar along x from the origin, clamped at x = 0, and an example of another tessellation: its rest mesh and a pose
/// twisted about the bar's axis, the angle growing from zero at the clamp.
struct BarFiles {
  std::array<double, 3> lengths{4.0, 1.0, 0.8};  ///< [m]
  std::array<int, 3> cells{14, 4, 3};            ///< cubes of six tets: 1,008 tets
  std::array<int, 3> example_cells{11, 3, 3};    ///< 594 tets
  double twist = 1.0;                            ///< at the far end [rad]
  double bend = 0;                               ///< then into an arc of this angle, towards z [rad]
  /// Turns the pose in space before it is written.
  Eigen::Matrix3d pose_rotation = Eigen::Matrix3d::Identity();
};

/// The pose of each vertex.
VertexArray twisted(const VertexArray& vertices, const BarFiles& bar);

/// Writes bar.msh, rest.msh and twist.msh, and asset.json: r = 30, s = 60, m = 20 with `changes` merged in (null
/// removes a member). Returns the asset file.
std::filesystem::path write_bar(const TemporaryFolder& folder, const BarFiles& bar,
                                const Json& changes = Json::object());

/// The bar in little: 96 tets, r = 8, s = 12, m = 6.
std::filesystem::path write_small_bar(const TemporaryFolder& folder, const Json& changes = Json::object());

/// Ids of the vertices at the far end.
std::vector<int> end_vertices(const VertexArray& vertices);

/// Gmsh 2.2 text.
void write_msh(const std::filesystem::path& path, const TetMesh& mesh);

struct Built {
  ReducedModel model;
  precompute::BuildReport report;
};

/// The offline stage, needs as the asset says or as those given.
Built build(const std::filesystem::path& asset, const std::optional<Needs>& needs = std::nullopt);

/// Writes a bundle and reads it.
ReducedModel through_bundle(const ReducedModel& model, const std::filesystem::path& path);

/// Writes scene.json on bundle.h5 with the members merged in. Returns the scene file.
std::filesystem::path write_scene(const TemporaryFolder& folder, const Json& members = Json::object());

/// Distance of a scene's motion from that of the full space, root mean squares over frames and vertices.
struct MotionError {
  double error = 0;  ///< distance over the size
  double size = 0;   ///< displacement in full space [m]
};
/// Error over `frames` frames, `every` so many steps.
MotionError error_against_full_space(const std::filesystem::path& scene, int frames, int every);

/// Inner product of two fields [3n] in the consistent mass of the density [n_t], summed tet by tet.
double mass_product(const TetMesh& mesh, const Eigen::VectorXd& density, const Eigen::VectorXd& a,
                    const Eigen::VectorXd& b);

}  // namespace exmat::test
