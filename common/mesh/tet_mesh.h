#pragma once

#include "common/core/arrays.h"
#include "common/elastic/material_model.h"

namespace exmat {

/// A tetrahedral mesh. Sound meshes (see checks.h) have positive volumes: det[x1 - x0, x2 - x0, x3 - x0] > 0.
struct TetMesh {
  VertexArray vertices;  ///< n x 3 [m]
  TetArray tets;         ///< n_t x 4, indices into vertices

  Eigen::Index vertex_count() const { return vertices.rows(); }
  Eigen::Index tet_count() const { return tets.rows(); }
};

/// The formulation says how strains follow from the displacements of vertices, see Elements.
enum class Formulation { kLinear, kSmoothed };
template <>
inline constexpr std::array<std::string_view, 2> kNames<Formulation>{"linear", "smoothed"};

/// beta of smoothed elements where the mesh does not say which is right: bars and plates of two to four tets across are
/// within 5 percent of the limit by it.
inline constexpr double kVarianceFactor = 0.2;

/// Isotropic elastic material: one model, parameters per tet, and the formulation of its elements.
struct TetMaterials {
  Eigen::VectorXd density;         ///< [kg/m^3]
  Eigen::VectorXd youngs_modulus;  ///< [Pa]
  Eigen::VectorXd poisson_ratio;   ///< (-1, 0.5)
  MaterialModel model = MaterialModel::kStVenantKirchhoff;
  Formulation formulation = Formulation::kLinear;
  double variance_factor = 0;  ///< beta of smoothed elements
};

}  // namespace exmat
