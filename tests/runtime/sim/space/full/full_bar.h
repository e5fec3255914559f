#pragma once

#include <string>

#include "runtime/sim/space/full/full_step.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::runtime {

struct FullBarOptions {
  std::array<int, 3> cells{6, 2, 2};
  MaterialModel model = MaterialModel::kStableNeoHookean;
  Formulation formulation = Formulation::kSmoothed;
  double youngs_modulus = 1e5, poisson_ratio = 0.35;
  bool two_parts = false;  ///< the outer half is ten times as stiff, twice as heavy, and of another Poisson ratio
  int functions = 0;       ///< functions of a filter; 0: no filter
  bool free = false;
};

/// A bar of 1 m along x, 0.25 m thick, clamped at x = 0.
struct FullBar {
  TetMesh mesh;
  TetMaterials materials;
  FlagVector fixed;
  FullModel model;
  const FullSpace& space = model.space;

  FullBar(const FullBar&) = delete;
  FullBar& operator=(const FullBar&) = delete;
  explicit FullBar(const FullBarOptions& options = {}) : mesh(test::box_mesh(options.cells, {1, 0.25, 0.25})) {
    const Eigen::Index tets = mesh.tet_count();
    materials.density = Eigen::VectorXd::Constant(tets, 1000);
    materials.youngs_modulus = Eigen::VectorXd::Constant(tets, options.youngs_modulus);
    materials.poisson_ratio = Eigen::VectorXd::Constant(tets, options.poisson_ratio);
    materials.model = options.model;
    materials.formulation = options.formulation;
    materials.variance_factor = options.formulation == Formulation::kSmoothed ? kVarianceFactor : 0;
    for (Eigen::Index t = 0; options.two_parts && t < tets; ++t)
      if (mesh.vertices(mesh.tets.row(t), 0).mean() > 0.5) {
        materials.youngs_modulus[t] *= 10;
        materials.density[t] *= 2;
        materials.poisson_ratio[t] = 0.2;
      }
    fixed = FlagVector::Zero(mesh.vertex_count());
    for (Eigen::Index v = 0; !options.free && v < mesh.vertex_count(); ++v) fixed[v] = mesh.vertices(v, 0) < 1e-9;
    RowMatrix filter;
    if (options.functions > 0) filter = 0.3 * test::random_matrix(mesh.vertex_count(), options.functions, 5);
    model = FullModel(FullSpace(mesh, materials, fixed, filter));
    if (options.functions > 0) model.examples.push_back({.functions = options.functions});
  }

  /// [f] the same force [N] on each vertex of the end.
  Eigen::VectorXd end_force(const Eigen::Vector3d& force) const {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(space.size());
    Eigen::Index row = 0;
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
      if (fixed[v] != 0) continue;
      if (mesh.vertices(v, 0) > 1 - 1e-9) all.segment<3>(row) = force;
      row += 3;
    }
    return all;
  }
};

inline constexpr MaterialModel kModels[] = {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                            MaterialModel::kCorotational};
inline constexpr Formulation kFormulations[] = {Formulation::kLinear, Formulation::kSmoothed};

/// Without damping or gravity, to so many digits.
inline StepScene full_scene(double time_step, double tolerance = 1e-9) {
  StepScene scene;
  scene.time_step = time_step;
  scene.space.newton = {50, tolerance};
  return scene;
}

}  // namespace exmat::runtime
