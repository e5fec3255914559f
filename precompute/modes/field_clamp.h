#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "precompute/fem/elastic_system.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {

/// Makes displacements fit for a clamped body: takes away the field w that moves its fixed vertices as they do and has
/// (K + decay M) w = 0 elsewhere. It dies away from the clamp over the length of an elastic wave of that squared
/// frequency; with decay 0 it would be the elastic displacement, which turns all of the body where the clamp is turned.
class FieldClamp {
 public:
  /// `decay` >= 0 [1/s^2]; `name` is for messages. `system` must outlive this. Nothing is factorised for a free body.
  FieldClamp(const ElasticSystem& system, double decay, const std::string& name);

  Eigen::Index free_rows() const { return system_.mass.rows(); }  ///< f

  /// [f x k] free rows of [3n x k] fields, clamped; of a free body as they are.
  Eigen::MatrixXd apply(const Eigen::MatrixXd& fields) const;

 private:
  const ElasticSystem& system_;
  SparseMatrix full_;  // K + decay M
  std::optional<SemidefiniteSolver> solver_;
};

}  // namespace exmat::precompute
