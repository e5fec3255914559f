#include "runtime/sim/step/attachment.h"

#include "common/core/decompositions.h"

namespace exmat::runtime {
namespace {

constexpr double kFlat = 1e-12;  // of the largest second moment: vertices on an axis do not say how they turn about it

}  // namespace

void Attachment::follow(double start, double end) noexcept {
  if (!motion) return;
  const MotionSample from = motion->sample(start), to = motion->sample(end);
  rotation_before = from.rotation;
  position_before = from.position;
  rotation = to.rotation;
  position = to.position;
}

void take_hold(const Eigen::VectorXd& masses, const Eigen::Matrix3Xd& here, Attachment& attachment) {
  attachment.shares = masses / masses.sum();
  attachment.places = attachment.rotation.transpose() * (here.colwise() - attachment.position);
  attachment.rotation_before = attachment.rotation;
  attachment.position_before = attachment.position;
}

ReducedPatch reduce_patch(const VertexArray& rest, const RowMatrix& basis_rows, const Eigen::VectorXd& shares,
                          const Eigen::Matrix3Xd& all_places, bool turns) {
  ReducedPatch patch;
  const Eigen::Index moments = turns ? 12 : 3;
  const Eigen::Matrix3Xd places = all_places.colwise() - all_places * shares;
  patch.rest = Eigen::VectorXd::Zero(moments);
  patch.rows = RowMatrix::Zero(moments, basis_rows.cols());
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (Eigen::Index k = 0; k < rest.rows(); ++k) {
    const double share = shares[k];
    const auto own = basis_rows.middleRows<3>(3 * k);
    patch.rest.head<3>() += share * rest.row(k).transpose();
    patch.rows.topRows<3>() += share * own;
    for (Eigen::Index axis = 0; turns && axis < 3; ++axis) {
      patch.rest.segment<3>(3 + 3 * axis) += share * places(axis, k) * rest.row(k).transpose();
      patch.rows.middleRows<3>(3 + 3 * axis) += share * places(axis, k) * own;
    }
    const Eigen::Vector3d place = places.col(k);
    inertia += share * (place.squaredNorm() * Eigen::Matrix3d::Identity() - place * place.transpose());
    patch.square += share * place.squaredNorm();
  }
  patch.axes.resize(3, 0);
  if (!turns || !(patch.square > 0)) return patch;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia);
  const Eigen::Index flat = (solver.eigenvalues().array() <= kFlat * solver.eigenvalues()[2]).count();
  patch.axes = solver.eigenvectors().rightCols(3 - flat);
  return patch;
}

void forget_body(int body, std::vector<Attachment>& attachments) noexcept {
  std::erase_if(attachments, [=](const Attachment& own) { return own.other && own.other->body == body; });
  for (Attachment& own : attachments)
    if (own.other && own.other->body > body) --own.other->body;
}

}  // namespace exmat::runtime
