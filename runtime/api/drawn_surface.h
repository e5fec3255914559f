#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/core/arrays.h"
#include "common/elastic/material.h"
#include "common/elastic/material_model.h"
#include "common/mesh/vertex_normals.h"
#include "runtime/api/point_set.h"

namespace exmat::runtime {

/// Elastic energy density at drawn points: of tets, and of each point the mean of some of them.
class DensityField {
 public:
  DensityField() = default;

  /// `weights` [k x n_t, as lists]: of point i those tets with those shares, which add up to 1.
  using Shares = std::vector<std::vector<std::pair<std::int32_t, double>>>;
  DensityField(const ObjectData& object, const RowMatrix& basis, const Shares& shares);

  Eigen::Index points() const { return static_cast<Eigen::Index>(begins_.size()) - 1; }

  /// `density` [k] [J/m^3] of a body in this state. Uses its own scratch: one call at a time.
  void evaluate(const State& state, const FullModel* full, const Placement& frame, float* density) noexcept;

 private:
  void set_displacements(const State& state, const FullModel* full, const Placement& frame) noexcept;

  struct Tet {
    std::array<std::int32_t, 4> corners{};  ///< indices into displacements_
    Eigen::Matrix<double, 4, 3> gradients;  ///< gradients of the shape functions [1/m]
    LameParameters lame;
  };

  MaterialModel material_ = MaterialModel::kStVenantKirchhoff;
  std::vector<Tet> tets_;
  std::vector<std::int32_t> begins_{0};                  ///< k + 1, in members_
  std::vector<std::pair<std::int32_t, float>> members_;  ///< tet and share
  std::vector<std::int32_t> vertices_;                   ///< vertices of the object: the tets' corners
  VertexPositions displacements_;                        ///< U q of these
  VertexPositions::Workspace workspace_;
  std::vector<float> moved_, densities_;  ///< scratch
};

/// Triangles that are drawn, beside their points.
struct ModelSurface {
  bool render = false;      ///< a render mesh, not the boundary of the tets
  TriangleArray triangles;  ///< f x 3, of the points
  IndexVector vertices;     ///< k, of the object: the point itself, or the nearest to it at rest
  DensityField density;
  VertexNormals normals;
};

struct ReadSurface {
  ModelSurface drawn;
  PointSet points;
};

/// Throws InputError: the bundle is no longer the one that was loaded, or has no render mesh.
ReadSurface read_surface(const Source& source, bool render);

}  // namespace exmat::runtime
