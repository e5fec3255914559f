#include "runtime/sim/space/full/skinned_part.h"

namespace exmat::runtime {

SkinnedPart::SkinnedPart(const FullSpace& space, const VertexArray& rest, const SkeletonData& data)
    : moving_(space.vertices()),
      rest_(Eigen::Matrix4Xd::Zero(4, space.places())),
      masses_(space.masses().tail(space.driven())),
      joints_(3, data.parents.size()) {
  for (Eigen::Index b = 0; b < joints_.cols(); ++b) joints_.col(b) = data.bind.block<3, 1>(3 * b, 3);
  std::vector<Eigen::Index> vertex_at(static_cast<std::size_t>(space.places()));
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    rest_.col(space.place(v)).head<3>() = rest.row(v);
    vertex_at[static_cast<std::size_t>(space.place(v))] = v;
  }
  for (Eigen::Index first = 0; first < data.shifts.rows(); first += rest.rows()) {
    Eigen::Matrix3Xd& shift = shifts_.emplace_back(3, space.places());
    for (Eigen::Index v = 0; v < rest.rows(); ++v) shift.col(space.place(v)) = data.shifts.row(first + v);
  }
  for (const Eigen::Index v : vertex_at) {
    for (Eigen::Index b = 0; b < joints_.cols(); ++b) {
      if (data.weights(v, b) == 0) continue;
      bones_.push_back(static_cast<std::int32_t>(b));
      weights_.push_back(data.weights(v, b));
    }
    starts_.push_back(static_cast<std::int32_t>(bones_.size()));
  }
}

SkinPose SkinnedPart::make_pose() const {
  return {
      rest_,
      Eigen::Map<const Eigen::Vector<double, 9>>(Eigen::Matrix3d::Identity().eval().data()).replicate(1, rest_.cols())};
}

SkinPlace SkinnedPart::place(const BonePoses& bones, const Eigen::VectorXd& weights,
                             Eigen::Index place) const noexcept {
  const auto first = static_cast<std::size_t>(starts_[static_cast<std::size_t>(place)]);
  const auto end = static_cast<std::size_t>(starts_[static_cast<std::size_t>(place) + 1]);
  Eigen::Vector3d rest = rest_.col(place).head<3>();
  for (Eigen::Index k = 0; k < weights.size(); ++k)
    rest += weights[k] * shifts_[static_cast<std::size_t>(k)].col(place);
  Eigen::Vector3d base = Eigen::Vector3d::Zero();
  Eigen::Vector4d turn = Eigen::Vector4d::Zero();
  for (std::size_t k = first; k < end; ++k) {
    const BonePose& bone = bones[static_cast<std::size_t>(bones_[k])];
    base += weights_[k] * (bone.joint + bone.turn * (rest - joints_.col(bones_[k])));
    const Eigen::Vector4d& own = bone.turn.coeffs();
    turn += (turn.dot(own) < 0 ? -weights_[k] : weights_[k]) * own;
  }
  // Quaternions of turns that differ by half a turn and more may cancel out: no mean is better than another then.
  if (!(turn.squaredNorm() > 0)) return {base, bones[static_cast<std::size_t>(bones_[first])].turn};
  return {base, Eigen::Quaterniond(turn).normalized()};
}

void SkinnedPart::place(const BonePoses& bones, const Eigen::VectorXd& weights, SkinPose& pose) const noexcept {
  for (Eigen::Index k = 0; k < rest_.cols(); ++k) {
    const SkinPlace at = place(bones, weights, k);
    pose.base.col(k).head<3>() = at.base;
    Eigen::Map<Eigen::Matrix3d>(pose.turns.col(k).data()) = at.turn.toRotationMatrix();
  }
}

void SkinnedPart::to_own(const SkinPose& pose, const double* world, double* own) const noexcept {
  for (Eigen::Index place = 0; place < rest_.cols(); ++place) {
    Eigen::Map<Eigen::Vector3d> to(own + 4 * place);
    if (place < moving_)
      to = rotation(pose, place).transpose() *
           (Eigen::Map<const Eigen::Vector3d>(world + 4 * place) - displacement(pose, place)).eval();
    else
      to.setZero();
  }
}

void SkinnedPart::to_world(const SkinPose& pose, const double* own, double* world) const noexcept {
  for (Eigen::Index place = 0; place < rest_.cols(); ++place) {
    Eigen::Map<Eigen::Vector3d> to(world + 4 * place);
    const Eigen::Vector3d here = displacement(pose, place);
    to = place < moving_ ? (here + rotation(pose, place) * Eigen::Map<const Eigen::Vector3d>(own + 4 * place)).eval()
                         : here;
  }
}

void SkinnedPart::place_fixed(const Eigen::VectorXd& q, Eigen::VectorXd& u) noexcept {
  const Eigen::Index fixed = q.size() / 3;
  for (Eigen::Index k = 0; k < fixed; ++k) u.tail(4 * fixed).segment<3>(4 * k) = q.segment<3>(3 * k);
}

double SkinnedPart::fixed_potential(const Eigen::VectorXd& q, const Eigen::Vector3d& gravity) const noexcept {
  double sum = 0;
  for (Eigen::Index k = 0; k < masses_.size(); ++k) sum -= masses_[k] * gravity.dot(q.segment<3>(3 * k));
  return sum;
}

}  // namespace exmat::runtime
