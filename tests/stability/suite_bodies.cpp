#include "tests/stability/suite_bodies.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <system_error>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "precompute/examples/alignment_report.h"
#include "precompute/pipeline/build_reduced_model.h"

namespace exmat::precompute {
namespace {

constexpr double kLengths[3] = {1.0, 0.25, 0.2};  // [m]
constexpr std::array<int, 3> kCells{8, 2, 2};
constexpr double kFlatLayer = 1.54e-3;                       // thickness of the cells of slivers [m]
constexpr double kBend = 1.2, kTwist = 1.0, kNearly = 1e-7;  // [rad]
constexpr const char* kRegion = "outer";
constexpr int kModes = 12, kLinearModes = 8, kElements = 24, kEigenfunctions = 8, kTrainingPoses = 60;

// Along an axis of the bar; slivers have a third layer of cells in the middle of z.
std::vector<double> grid(int axis, bool slivers) {
  const int cells = kCells[static_cast<std::size_t>(axis)];
  std::vector<double> places;
  for (int i = 0; i <= cells; ++i) places.push_back(kLengths[axis] * i / cells);
  if (!slivers || axis != 2) return places;
  const double middle = places[1];
  places[1] = middle - kFlatLayer / 2;
  places.insert(places.begin() + 2, middle + kFlatLayer / 2);
  return places;
}

// Bent about y into an arc, or twisted about its axis, the more the farther along.
TetMesh posed(TetMesh mesh, double bend, double twist) {
  for (auto x : mesh.vertices.rowwise()) {
    const double along = x[0] / kLengths[0], y = x[1] - kLengths[1] / 2, z = x[2] - kLengths[2] / 2;
    const double c = std::cos(twist * along), s = std::sin(twist * along);
    x = Eigen::RowVector3d(x[0], kLengths[1] / 2 + c * y - s * z, kLengths[2] / 2 + s * y + c * z);
    if (bend == 0) continue;
    const double radius = kLengths[0] / bend, away = radius + kLengths[2] / 2 - x[2];
    x[0] = away * std::sin(bend * along);
    x[2] = kLengths[2] / 2 + radius - away * std::cos(bend * along);
  }
  return mesh;
}

std::vector<std::pair<std::string, TetMesh>> example_meshes(BodyExamples examples, const TetMesh& mesh) {
  switch (examples) {
    case BodyExamples::kBendAndTwist:
      return {{"bend", posed(mesh, kBend, 0)}, {"twist", posed(mesh, 0, kTwist)}};
    case BodyExamples::kNearDuplicates:
      return {{"twist", posed(mesh, 0, kTwist)}, {"again", posed(mesh, 0, kTwist + kNearly)}};
    case BodyExamples::kDuplicates:
      return {{"twist", posed(mesh, 0, kTwist)}, {"again", posed(mesh, 0, kTwist)}};
    default:
      return {};
  }
}

AssetConfig asset_of(const BodySpec& spec) {
  AssetConfig asset;
  asset.name = "bar";
  asset.material = {spec.material, spec.youngs_modulus, spec.poisson_ratio, spec.density};
  if (!spec.free) asset.fixed = BoxSelection{{-1e-6, -1, -1}, {1e-6, 1, 1}};
  asset.eigenfunctions = kEigenfunctions;
  asset.basis_size = kModes;
  asset.linear_modes = kLinearModes;
  asset.cubature_elements = kElements;
  asset.training_poses = kTrainingPoses;
  asset.internal_force = spec.polynomial ? ForceMethod::kPolynomial : ForceMethod::kCubature;
  if (spec.region) {
    const BoxSelection outer{{0.5 * kLengths[0] - 1e-6, -1, -1}, {2 * kLengths[0], 1, 1}};
    RegionConfig& region = asset.regions.emplace_back();
    region.name = kRegion;
    region.vertices = outer;
    region.example_vertices = outer;
    for (const auto& [name, pose] : example_meshes(spec.examples, stability_mesh(spec.slivers)))
      region.examples.push_back(name);
  }
  return asset;
}

Needs needs_of(const BodySpec& spec) {
  Needs needs;
  needs.examples = spec.examples != BodyExamples::kNone && !spec.region;
  needs.targets = spec.target_table;
  needs.carried = spec.carried;
  needs.target_elasticity = spec.elastic;
  needs.energy_reference = spec.energy_reference;
  needs.internal_force = spec.polynomial ? ForceMethod::kPolynomial : ForceMethod::kCubature;
  return needs;
}

void measure(StudyBody& body) {
  const VertexArray& vertices = body.reduced.object->mesh.vertices;
  static_cast<BodyScale&>(body) = measure_scale(vertices, body.basis(), body.model->internal_force);
  const Eigen::Index modes = body.rest_stiffness.rows();
  body.least_dihedral = least_dihedral(body.reduced.object->mesh);
  body.lowest_frequency = 2 * std::numbers::pi * body.reduced.modal->frequencies[0];
  body.highest_frequency = std::sqrt(body.rest_stiffness.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff());
  body.mass_reach = reach_of(body.basis(), Eigen::MatrixXd::Identity(modes, modes));
}

void write_mesh(const TetMesh& mesh, const std::filesystem::path& file) {
  write_file_atomically(file, vtk_text(mesh, {}, "stability suite"));
}

std::unique_ptr<StudyBody> build(const BodySpec& spec, const std::filesystem::path& folder) {
  AssetConfig asset = asset_of(spec);
  asset.file = folder / "asset.json";  // for messages and the hash
  write_file_atomically(asset.file, "{}");
  asset.object_mesh = folder / "bar.vtk";
  const TetMesh mesh = stability_mesh(spec.slivers);
  write_mesh(mesh, asset.object_mesh);
  if (spec.examples != BodyExamples::kNone) asset.examples.push_back({"rest", asset.object_mesh, true, {}});
  for (const auto& [name, pose] : example_meshes(spec.examples, mesh)) {
    asset.examples.push_back({name, folder / (name + ".vtk"), false, {}});
    write_mesh(pose, asset.examples.back().mesh);
  }
  auto body = std::make_unique<StudyBody>();
  BuildReport report;
  body->reduced = build_reduced_model(asset, needs_of(spec), report);
  runtime::ModelOptions options;
  options.examples = spec.examples != BodyExamples::kNone && !spec.region;
  options.target_table = body->reduced.targets.has_value();
  options.polynomial = spec.polynomial;
  options.carried = spec.carried;
  options.elastic = spec.elastic;
  options.energy_reference = spec.energy_reference;
  if (spec.region) options.regions.push_back({.region = kRegion, .target_table = spec.target_table});
  runtime::ModelResult result = runtime::build_model(body->reduced, options);
  if (!result.model) throw InputError(std::move(result.complaint));
  body->model = std::move(result.model);
  body->full = runtime::build_full_model(body->reduced, *body->model).model;
  measure(*body);
  return body;
}

}  // namespace

TetMesh stability_mesh(bool slivers) {
  // The corner tets and the middle one of a cell; cells of odd parity are mirrored, so that diagonals meet.
  constexpr int kTets[5][4] = {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}};
  const std::array<std::vector<double>, 3> places{grid(0, slivers), grid(1, slivers), grid(2, slivers)};
  const auto count = [&](int axis) { return static_cast<int>(places[static_cast<std::size_t>(axis)].size()); };
  const auto index = [&](int x, int y, int z) { return (z * count(1) + y) * count(0) + x; };
  TetMesh mesh;
  mesh.vertices.resize(count(0) * count(1) * count(2), 3);
  for (int z = 0; z < count(2); ++z)
    for (int y = 0; y < count(1); ++y)
      for (int x = 0; x < count(0); ++x)
        mesh.vertices.row(index(x, y, z)) << places[0][static_cast<std::size_t>(x)],
            places[1][static_cast<std::size_t>(y)], places[2][static_cast<std::size_t>(z)];
  mesh.tets.resize(5 * (count(0) - 1) * (count(1) - 1) * (count(2) - 1), 4);
  Eigen::Index tet = 0;
  for (int z = 0; z + 1 < count(2); ++z)
    for (int y = 0; y + 1 < count(1); ++y)
      for (int x = 0; x + 1 < count(0); ++x)
        for (const auto& corners : kTets) {
          const int mirror = (x + y + z) & 1;
          for (int k = 0; k < 4; ++k) {
            const int bits = corners[k] ^ mirror;
            mesh.tets(tet, k) = index(x + (bits & 1), y + (bits >> 1 & 1), z + (bits >> 2 & 1));
          }
          const auto at = tet_positions(mesh, tet);
          const Eigen::Matrix3d edges = at.bottomRows<3>().rowwise() - at.row(0);
          if (edges.determinant() < 0) std::swap(mesh.tets(tet, 2), mesh.tets(tet, 3));
          ++tet;
        }
  return mesh;
}

double least_dihedral(const TetMesh& mesh) {
  double least = std::numbers::pi;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    // Gradients of the shape functions are normal to the faces, inward.
    const auto normals = shape_gradients(tet_positions(mesh, t));
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < i; ++j) {
        const Eigen::Vector3d a = normals.row(i), b = normals.row(j);
        least = std::min(least, std::numbers::pi - std::atan2(a.cross(b).norm(), a.dot(b)));
      }
  }
  return least;
}

BodyStore::BodyStore() {
  std::string name = (std::filesystem::temp_directory_path() / "exmat_stability_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw WorkError(name + ": cannot make a folder for mesh files");
  folder_ = name;
}

BodyStore::~BodyStore() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

const StudyBody& BodyStore::get(const BodySpec& spec) {
  const auto found = bodies_.find(spec);
  if (found != bodies_.end()) return *found->second;
  return *bodies_.emplace(spec, build(spec, folder_)).first->second;
}

}  // namespace exmat::precompute
