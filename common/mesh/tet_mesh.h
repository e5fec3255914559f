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

/// Isotropic elastic material: one model, parameters per tet.
struct TetMaterials {
  Eigen::VectorXd density;         ///< [kg/m^3]
  Eigen::VectorXd youngs_modulus;  ///< [Pa]
  Eigen::VectorXd poisson_ratio;   ///< (-1, 0.5)
  MaterialModel model = MaterialModel::kStVenantKirchhoff;
};

}  // namespace exmat
