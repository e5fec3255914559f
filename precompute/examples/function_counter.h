#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "common/mesh/tet_mesh.h"
#include "precompute/shape_space/laplace_basis.h"

namespace exmat::precompute {

/// Eigenfunctions of an object that are looked through for how many carry a pose.
inline constexpr Eigen::Index kMostEigenfunctions = 400;

/// Counts the eigenfunctions of an object that a pose needs. They are computed when it is first asked.
class FunctionCounter {
 public:
  /// Both are kept by reference; `name` is for messages.
  FunctionCounter(const TetMesh& mesh, const std::string& name) : mesh_(mesh), name_(name) {}

  /// The least number that loses at most the share of a displacement [3n], relative M-norm, and cuts no cluster; 0
  /// where kMostEigenfunctions do not do.
  Eigen::Index needed(const Eigen::VectorXd& field, double share);

 private:
  const TetMesh& mesh_;
  const std::string& name_;
  std::optional<LaplaceBasis> basis_;
};

}  // namespace exmat::precompute
