#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/full_space/mesh_elasticity.h"
#include "runtime/sim/contact/contact_law.h"

namespace exmat::precompute {

/// Contact of single vertices with obstacles in full space, by the law of runtime/sim/contact/contact_law.h;
/// displacements u [f] are those of the free degrees of freedom, from rest in the world.
class VertexContacts {
 public:
  /// Contacts that one step finds.
  struct Step {
    std::vector<runtime::PlacedObstacle> obstacles;     ///< at the end of the step
    std::vector<runtime::ContactCandidate> candidates;  ///< in order of vertex and obstacle

    // Results of the last evaluation.
    Eigen::VectorXd force;                                  ///< [f] on the body [N]
    Eigen::Vector3d total_force = Eigen::Vector3d::Zero();  ///< sum over the vertices, world [N]
    double potential = 0;                                   ///< W [J], force = -dW/du
    int touching = 0;                                       ///< vertices with a normal force
  };

  /// The vertices and areas of `data`, none of them fixed; `free_dofs` ascend.
  VertexContacts(const ContactData& data, const std::vector<std::int32_t>& free_dofs);

  Eigen::Index vertices() const { return areas_.size(); }

  /// Candidates for a step that begins with u, the velocity v [f] and what `held` remembers: vertices that are within
  /// kContactMarginSteps of the way of the fastest one, and `extra` [m], of an obstacle.
  Step begin(const runtime::Obstacles& obstacles, double end_time, double time_step, const Eigen::VectorXd& u,
             const Eigen::VectorXd& v, double extra, const runtime::ContactState& held) const;

  /// Forces and their stiffness at u.
  void evaluate(const Eigen::VectorXd& u, Step& step) const;

  /// W alone [J]; leaves the last evaluation as it is.
  double potential(const Eigen::VectorXd& u, const Step& step) const;

  /// Adds -df/du of the last evaluation, without the curvature of the obstacles, which is positive semi-definite.
  void add_stiffness(const Step& step, LowerTriangle& stiffness) const;

  /// Writes the memory of the last evaluation, at u, for the next step.
  void commit(const Eigen::VectorXd& u, const Step& step, runtime::ContactState& held) const;

 private:
  bool sweeps(const runtime::PlacedObstacle& placed, const Eigen::VectorXd& u) const;
  Eigen::Vector3d point(int vertex, const Eigen::VectorXd& u) const;

  VertexArray rest_;
  Eigen::VectorXd areas_;
  std::vector<Eigen::Index> dofs_;  // of each vertex's x
};

}  // namespace exmat::precompute
