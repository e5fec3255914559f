#pragma once

#include <optional>

#include "common/model/reduced_model.h"
#include "precompute/cubature/training_poses.h"

namespace exmat::precompute {

struct CubatureOptions {
  std::optional<int> elements{};                        ///< s
  std::optional<double> tolerance{};                    ///< held-out force error; both absent: 2 r elements
  CubatureMethod method = CubatureMethod::kGreedySwap;  ///< all elements have neither of these
  int training_poses = 200;
  std::uint64_t seed = 1;
  /// Most entries of the training matrix [(r + 1) poses x candidates], 8 bytes each: where all elements would be more,
  /// each of four passes chooses from as many as fit, a systematic sample over the order of their energies, beside
  /// those that it has.
  std::int64_t training_entries = 50'000'000;
  bool measured =
      true;  ///< on held-out poses, which takes as long as the rest where elements are many; else errors of 0
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, CubatureOptions& value) {
  pass_all(archive, value.elements, value.tolerance, value.method, value.training_poses, value.seed,
           value.training_entries, value.measured);
}

/// Relative errors of a weighted element subset against all elements, root mean square over poses: forces in the norm
/// of the inverse rest stiffness, |L^-1 (f - f_all)| / |L^-1 f_all| with L L^T = U^T K U; energies; stiffness
/// (Frobenius, the first ten poses).
struct CubatureErrors {
  double force = 0, energy = 0, stiffness = 0;
};
CubatureErrors cubature_errors(const TetMesh& mesh, const TetMaterials& materials, const PoseSource& source,
                               const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights,
                               const RowMatrix& poses);

/// All elements with the weight 1, no errors measured.
CubatureData all_elements(const TetMesh& mesh, const TetMaterials& materials, const RowMatrix& basis);

/// The elements and weights of `other` for another basis, no errors measured.
CubatureData with_basis(const CubatureData& other, const TetMesh& mesh, const TetMaterials& materials,
                        const RowMatrix& basis);

/// Chooses elements and weights on training poses and measures them on held-out ones. Throws InputError (without
/// a file) where the options do not fit the mesh, WorkError where a tolerance cannot be met.
CubatureData build_cubature(const TetMesh& mesh, const TetMaterials& materials, const PoseSource& source,
                            const CubatureOptions& options);

/// `data`, built of the same but not measured, with its errors on held-out poses.
CubatureData measured_cubature(const CubatureData& data, const TetMesh& mesh, const TetMaterials& materials,
                               const PoseSource& source, const CubatureOptions& options);

}  // namespace exmat::precompute
