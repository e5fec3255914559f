#pragma once

#include <vector>

#include "precompute/alignment/aligned_shape.h"

namespace exmat::precompute {

/// Groups of consecutive eigenvalues that cannot be told apart in either list: [first, size], sizes at most 3.
struct Cluster {
  Eigen::Index first = 0, size = 1;
};
std::vector<Cluster> common_clusters(const Eigen::VectorXd& a, const Eigen::VectorXd& b, Eigen::Index count);

/// Orthogonal matrices tried for a cluster: both signs; rotations by multiples of 45 degrees, with and without a
/// reflection, of pairs; signed permutations of triples.
std::vector<Eigen::MatrixXd> cluster_choices(Eigen::Index size);

/// Functional maps [count x count] by a tree over the clusters of the first `count` functions, best first: at each
/// cluster the choices that bring the embeddings phi_i / sqrt(lambda_i) of the two shapes nearest, both ways, are kept.
/// Takes reflections for maps. docs/alignment.md, step 2.
std::vector<Eigen::MatrixXd> spectral_maps(const AlignedShape& a, const AlignedShape& b, Eigen::Index count,
                                           std::size_t kept);

}  // namespace exmat::precompute
