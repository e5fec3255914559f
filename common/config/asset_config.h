#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/config/named_file.h"
#include "common/config/vertex_selection.h"
#include "common/elastic/material_model.h"
#include "common/mesh/tet_mesh.h"
#include "common/model/choices.h"

namespace exmat {

/// A set of tets that the mesh file names.
struct SetSelection {
  std::string name;
};

/// Tets by their centroids, by their ids in the mesh file, or by a set of it.
using TetSelection = std::variant<BoxSelection, SphereSelection, FileSelection, IdSelection, PartSelection,
                                  ColourSelection, PointSelection, SetSelection>;

struct MaterialConfig {
  MaterialModel model = MaterialModel::kStVenantKirchhoff;
  std::optional<double> youngs_modulus, poisson_ratio, density;  ///< absent: the mesh file's own
};

/// A part of the object whose numbers replace those before; absent ones stay.
struct MaterialRegionConfig {
  TetSelection tets;
  std::optional<double> youngs_modulus, poisson_ratio, density;
};

/// Faults of a mesh that are mended by dropping instead of refused.
struct DropConfig {
  bool degenerate_tets = false;
  bool unreferenced_vertices = false;
  bool smaller_components = false;
};

/// One of mesh, surface and morph; morph may stand beside surface.
struct ExampleConfig {
  std::string name;
  std::filesystem::path mesh;  ///< tets; empty: none
  bool rest = false;
  DropConfig drop;
  std::optional<std::filesystem::path> surface{};
  std::optional<std::string> morph{};   ///< name in `surface`, else in the object's
  std::optional<std::int64_t> frame{};  ///< number in a point cache

  /// The file that its messages name: the one that it is read from.
  const std::filesystem::path& file(const std::filesystem::path& object_surface) const {
    return surface ? *surface : morph ? object_surface : mesh;
  }
};

/// The vertex of an example for every vertex of the object, in a text file.
struct ExampleMapConfig {
  std::string example;
  std::filesystem::path file;
};

/// Corresponding parts of the object and of examples.
struct CorrespondingRegionConfig {
  struct OnExample {
    std::string example;
    VertexSelection vertices;
  };
  VertexSelection object;
  std::vector<OnExample> examples;
};

struct AlignmentConfig {
  AlignmentMethod method = AlignmentMethod::kAuto;
  AlignmentFrame frame = AlignmentFrame::kAuto;
  std::optional<std::filesystem::path> landmarks;
  std::vector<ExampleMapConfig> maps;
  std::vector<CorrespondingRegionConfig> regions;
  bool accept = false;  ///< takes what is refused otherwise, with a warning
};

/// A part of the object with examples of its own.
struct RegionConfig {
  std::string name;
  VertexSelection vertices;
  std::optional<VertexSelection> example_vertices;  ///< vertices of the rest example; absent: all
  std::vector<std::string> examples;                ///< names, not the rest pose's
};

/// A push that a body will feel, in any direction.
struct ForceLoadConfig {
  VertexSelection vertices;
  double force = 0;  ///< on each vertex [N]
};

/// Loads that will act on a body, where no scene says so.
struct LoadsConfig {
  std::vector<ForceLoadConfig> forces;
  std::optional<double> example_stiffness, example_damping, example_bias;  ///< as in a scene
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();                       ///< [m/s^2]
  double speed = 0;  ///< at which a free body meets obstacles [m/s]; 0: it does not
};

/// The runs in full space that basis and cubature learn from.
struct TrainingConfig {
  Training from = Training::kAuto;
  TrainingSpace space = TrainingSpace::kAuto;
  int segments = 8;
  std::optional<double> seconds;      ///< length of one segment, about; absent: 0.8 periods of the lowest mode
  std::optional<std::uint64_t> seed;  ///< absent: the asset's
  std::optional<LoadsConfig> loads;
};

/// Least number r of modes where an asset names none.
inline constexpr int kBasisSize = 30;

/// ASSET.json after validation, paths resolved against its folder. schemas/asset.json.
struct AssetConfig {
  std::filesystem::path file;
  std::string name;
  std::filesystem::path object_mesh;  ///< tets, or, where object_surface is there, that
  std::optional<std::filesystem::path> object_surface;
  std::optional<std::filesystem::path> object_skeleton;  ///< JSON file of the bones of tets
  std::optional<int> cells;                              ///< number of enclosing tets, about; both absent: the default
  std::optional<double> cell_size;                       ///< [m]
  MaterialConfig material;
  std::vector<MaterialRegionConfig> material_regions;  ///< later ones win
  Formulation formulation = Formulation::kSmoothed;
  std::optional<VertexSelection> fixed;  ///< absent: a free body
  bool clamp_follows = false;            ///< fixed vertices go where examples have them
  DropConfig object_drop;
  std::optional<std::filesystem::path> render_mesh;  ///< surface that is drawn in the object's place
  std::vector<ExampleConfig> examples;
  std::vector<RegionConfig> regions;

  int eigenfunctions = 20;               ///< m, with a tolerance the least
  std::optional<double> pose_tolerance;  ///< share of a pose that eigenfunctions may lose; more are taken
  Weighting weighting = Weighting::kEigenvalue;
  AlignmentConfig alignment;

  std::optional<int> basis_size;          ///< r; both absent: kBasisSize, or more where the examples need it
  std::optional<double> basis_tolerance;  ///< limit of the error in held-out runs, instead of a size
  int linear_modes = 15;
  bool example_fields = true;
  TrainingConfig training;

  std::optional<int> cubature_elements;      ///< s; both absent: 2 r
  std::optional<double> cubature_tolerance;  ///< held-out relative force error
  CubatureMethod cubature_method = CubatureMethod::kGreedySwap;
  int training_poses = 200;

  double target_tolerance = 1e-4;  ///< relative error of the table of targets

  ForceMethod internal_force = ForceMethod::kAuto;

  std::optional<VertexSelection> contact_vertices;  ///< absent: all of the surface
  std::optional<int> contact_count;                 ///< sampled from these; absent: at most 1000

  std::optional<std::vector<std::string>> needs;  ///< optional parts to write ("examples", "targets", "rigid",
                                                  ///< "contact", "regions", "render"); absent: all that apply
  std::uint64_t seed = 1;
  double length_unit = 1;  ///< unit of the numbers of all meshes [m]
};

/// The files that the asset names, whether they are read or not.
std::vector<NamedFile> named_files(const AssetConfig& asset);

/// Throws InputError that names the asset's member where one of them is not there.
void require_files(const AssetConfig& asset);

}  // namespace exmat
