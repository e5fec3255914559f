#pragma once

#include "precompute/fem/elastic_system.h"

namespace exmat::precompute {

/// The linear elastodynamics of a mesh by quadratic tets, with a node in the middle of each edge: what the elements of
/// the same mesh are compared with. Shear terms at four Gauss points, the change of volume at the centroid, so that
/// they do not lock at any Poisson ratio; consistent mass. Zienkiewicz and Taylor 2000, sections 8.8 and 12.5.
struct QuadraticTets {
  VertexArray nodes;  ///< N x 3: the n vertices, then the middles of the edges
  ElasticSystem system;
};

/// An edge is fixed where both of its ends are. Throws as build_elastic_system().
QuadraticTets quadratic_tets(const TetMesh& mesh, const TetMaterials& materials, const FlagVector& fixed);

}  // namespace exmat::precompute
