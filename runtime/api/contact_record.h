#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

/// A force [N] and a torque [N m], world.
struct ContactLoad {
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = Eigen::Vector3d::Zero();
};

/// Contacts of a body in one call of its steps. Only prepare() allocates.
class ContactRecord {
 public:
  struct Touch {
    int vertex = 0;  ///< vertex of the object
    int obstacle = 0;
    double depth = 0;                                                                   ///< [m]
    Eigen::Vector3d position = Eigen::Vector3d::Zero();                                 ///< world [m]
    Eigen::Vector3d normal = Eigen::Vector3d::Zero(), force = Eigen::Vector3d::Zero();  ///< on the body [N]
  };

  /// For so many obstacles; forgets all.
  void prepare(const Model& model, std::size_t obstacles);
  void clear() noexcept;
  /// After a step of the body in this workspace.
  void add(const StepReport& report, const Model& model, const State& state, const Workspace& workspace) noexcept;

  /// At the end of the last step, in order of the set's vertices and of obstacles.
  std::span<const Touch> touches() const noexcept { return std::span(touches_).first(count_); }
  /// Mean over the steps; on an obstacle about its frame's origin, on the body about Placement::position.
  ContactLoad on_obstacle(std::size_t obstacle) const noexcept { return mean(obstacles_[obstacle]); }
  ContactLoad on_body() const noexcept { return mean(body_); }

 private:
  ContactLoad mean(const ContactLoad& sum) const noexcept;

  std::vector<Touch> touches_;
  std::size_t count_ = 0;
  std::vector<ContactLoad> obstacles_;  // sums over the steps
  ContactLoad body_;
  std::int64_t steps_ = 0;
};

}  // namespace exmat::runtime
