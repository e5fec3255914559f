#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "runtime/sim/frame/skeleton.h"
#include "runtime/sim/space/full/full_space.h"

namespace exmat::runtime {

/// Place and rotation, y and R, of every place of a body by its bones alone.
struct SkinPose {
  Eigen::Matrix4Xd base;                           ///< y, world [m]; the last row is 0
  Eigen::Matrix<double, 9, Eigen::Dynamic> turns;  ///< R, by columns
};

/// One place of a body.
struct SkinPlace {
  Eigen::Vector3d base;
  Eigen::Quaterniond turn;
};

/// A body in full space on a skeleton: y = sum_b w_b (R_b (X + E - J_b) + j_b) of the weights w of its bones, and R the
/// rotation of the mean of their quaternions; E = sum_k w_k E_k, the shifts of examples by weights of these. Fixed
/// vertices are at y; of the others x = y + R d, d their own displacement. Immutable; fields are those of FullSpace, of
/// driven fixed vertices. Only what makes it allocates.
class SkinnedPart {
 public:
  SkinnedPart(const FullSpace& space, const VertexArray& rest, const SkeletonData& data);

  SkinPose make_pose() const;
  /// `weights` [K] of the shifts; empty: no example shifts the body.
  void place(const BonePoses& bones, const Eigen::VectorXd& weights, SkinPose& pose) const noexcept;
  SkinPlace place(const BonePoses& bones, const Eigen::VectorXd& weights, Eigen::Index place) const noexcept;

  /// Displacement from where a place was meshed, of the bones alone [m].
  Eigen::Vector3d displacement(const SkinPose& pose, Eigen::Index place) const noexcept {
    return (pose.base.col(place) - rest_.col(place)).head<3>();
  }
  Eigen::Vector3d displacement(const SkinPlace& at, Eigen::Index place) const noexcept {
    return at.base - rest_.col(place).head<3>();
  }
  /// Fields: from the displacement in the world to a place's own and back. Fixed vertices have none of their own.
  void to_own(const SkinPose& pose, const double* world, double* own) const noexcept;
  void to_world(const SkinPose& pose, const double* own, double* world) const noexcept;

  /// Sets the fixed vertices of the displacement field `u` by theirs [3p], the last of its places.
  static void place_fixed(const Eigen::VectorXd& q, Eigen::VectorXd& u) noexcept;

  /// Fields: R v and R^T v of the places that move; v may be the same.
  template <typename Number>
  void turn(const SkinPose& pose, const Number* v, Number* turned) const noexcept;
  template <typename Number>
  void turn_back(const SkinPose& pose, const Number* v, Number* turned) const noexcept;

  /// Potential of gravity on the fixed vertices displaced by `q` [3p], zero where they were meshed [J].
  double fixed_potential(const Eigen::VectorXd& q, const Eigen::Vector3d& gravity) const noexcept;

 private:
  Eigen::Matrix3d rotation(const SkinPose& pose, Eigen::Index place) const noexcept {
    return Eigen::Map<const Eigen::Matrix3d>(pose.turns.col(place).data());
  }

  Eigen::Index moving_ = 0;
  Eigen::Matrix4Xd rest_;                        // X of each place
  std::vector<Eigen::Matrix3Xd> shifts_;         // E of each example at each place; none: nothing is shifted
  Eigen::VectorXd masses_;                       // of the fixed vertices
  Eigen::Matrix3Xd joints_;                      // J
  std::vector<std::int32_t> starts_{0}, bones_;  // of each place
  std::vector<double> weights_;
};

template <typename Number>
void SkinnedPart::turn(const SkinPose& pose, const Number* v, Number* turned) const noexcept {
  using Vector = Eigen::Matrix<Number, 3, 1>;
  for (Eigen::Index place = 0; place < moving_; ++place)
    Eigen::Map<Vector>(turned + 4 * place) =
        (rotation(pose, place).cast<Number>() * Eigen::Map<const Vector>(v + 4 * place)).eval();
}

template <typename Number>
void SkinnedPart::turn_back(const SkinPose& pose, const Number* v, Number* turned) const noexcept {
  using Vector = Eigen::Matrix<Number, 3, 1>;
  for (Eigen::Index place = 0; place < moving_; ++place)
    Eigen::Map<Vector>(turned + 4 * place) =
        (rotation(pose, place).transpose().cast<Number>() * Eigen::Map<const Vector>(v + 4 * place)).eval();
}

}  // namespace exmat::runtime
