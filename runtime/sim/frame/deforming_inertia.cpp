#include "runtime/sim/frame/deforming_inertia.h"

namespace exmat::runtime {
namespace {

constexpr int kFirst[6] = {0, 1, 2, 1, 0, 0};                    // of the pairs xx, yy, zz, yz, xz, xy
constexpr double kMostSoftening = 0.25, kLeastSoftening = 1e-5;  // shares of inertia
constexpr int kSecond[6] = {0, 1, 2, 2, 2, 1};

/// d(1/2 w^T J w)/dP_ab of the six pairs, off-diagonal ones counted twice.
Eigen::Matrix<double, 6, 1> energy_slopes(const Eigen::Vector3d& spin) {
  Eigen::Matrix<double, 6, 1> slopes;
  for (int pair = 0; pair < 6; ++pair) {
    const int a = kFirst[pair], b = kSecond[pair];
    slopes[pair] = a == b ? 0.5 * (spin.squaredNorm() - spin[a] * spin[a]) : -spin[a] * spin[b];
  }
  return slopes;
}

/// Rows from `first` on of matrices in panels of kLanes rows, each by columns.
void write_panels(const Eigen::MatrixXd& matrix, Eigen::Index first, AlignedArray& panels) {
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      const Eigen::Index row = first + i;
      panels[(row / kLanes * matrix.cols() + j) * kLanes + row % kLanes] = matrix(i, j);
    }
}

}  // namespace

DeformingInertia::DeformingInertia(const RigidData& data)
    : mass_(data.mass),
      centre_of_mass_(data.centre_of_mass),
      second_moments_(data.second_moments),
      linear_(data.linear_moments.cols(), kSymmetric),
      stacked_(kProducts * padded(data.linear_moments.cols()) * data.linear_moments.cols()),
      panels_(padded(5 * modes()) * modes()),
      turning_panels_(padded(3 * modes()) * modes()) {
  const Eigen::Index r = modes(), stride = padded(r);
  const auto S = [&](int a, int b) { return data.basis_moments.middleRows((3 * a + b) * r, r); };
  Eigen::Map<Eigen::MatrixXd> stacked(stacked_.data(), kProducts * stride, r);
  for (int pair = 0; pair < kSymmetric; ++pair) {
    const int a = kFirst[pair], b = kSecond[pair];
    pairs_[pair] = data.second_moments(a, b);
    linear_.col(pair) = data.linear_moments.row(3 * a + b);
    stacked.middleRows(pair * stride, r) = 0.5 * (S(a, b) + S(b, a));
    if (pair > 0) write_panels(stacked.middleRows(pair * stride, r), (pair - 1) * r, panels_);
  }
  for (int c = 0; c < 3; ++c) {
    const int a = (c + 1) % 3, b = (c + 2) % 3;
    stacked.middleRows((kSymmetric + c) * stride, r) = S(a, b) - S(b, a);
    write_panels(S(b, a) - S(a, b), c * r, turning_panels_);
  }
}

DeformingInertia::Moments DeformingInertia::make_moments() const {
  return {modes(), AlignedArray(rotation_products(modes())), Eigen::Matrix3d::Zero()};
}

void DeformingInertia::moments(const Eigen::VectorXd& q, Moments& moments) const noexcept {
  Eigen::Matrix<double, 6, 1> changes;
  kernels().rotation_moments(arrays(), q.data(), nullptr, moments.products.data(), nullptr, changes.data());
  set_inertia(changes, moments);
}

void DeformingInertia::moments(const Eigen::VectorXd& q, const Eigen::VectorXd& other, Moments& moments,
                               AlignedArray& other_products) const noexcept {
  Eigen::Matrix<double, 6, 1> changes;
  kernels().rotation_moments(arrays(), q.data(), other.data(), moments.products.data(), other_products.data(),
                             changes.data());
  set_inertia(changes, moments);
}

/// Sets the inertia from the changes of P_ab.
void DeformingInertia::set_inertia(const Eigen::Matrix<double, 6, 1>& changes, Moments& moments) const noexcept {
  const Eigen::Matrix<double, 6, 1> P = pairs_ + changes;
  const double trace = P[0] + P[1] + P[2];
  moments.inertia << trace - P[0], -P[5], -P[4], -P[5], trace - P[1], -P[3], -P[4], -P[3], trace - P[2];
}

void DeformingInertia::turning_products(const Eigen::VectorXd& v, AlignedArray& products) const noexcept {
  kernels().panel_product(turning_panels_.data(), padded(3 * modes()) / kLanes, modes(), v.data(), products.data());
}

void DeformingInertia::force(const Moments& moments, const AlignedArray& velocity_products, const Eigen::Vector3d& spin,
                             const Eigen::Vector3d& by_velocity, const Eigen::Vector3d& by_pose,
                             Eigen::VectorXd& force) const noexcept {
  const Eigen::Matrix<double, 6, 1> slopes = energy_slopes(spin);
  const Eigen::Vector3d of_velocity = -by_velocity, of_pose = -by_pose;
  kernels().rotation_force(arrays(), moments.products.data(), velocity_products.data(), slopes.data(),
                           of_velocity.data(), of_pose.data(), force.data());
}

void DeformingInertia::gyroscopic_product(const Eigen::Vector3d& spin, const Eigen::VectorXd& v, AlignedArray& scratch,
                                          Eigen::VectorXd& product) const noexcept {
  turning_products(v, scratch);
  const auto part = [&](int c) { return Eigen::Map<const Eigen::VectorXd>(scratch.data() + c * modes(), modes()); };
  product = -(spin[0] * part(0) + spin[1] * part(1) + spin[2] * part(2));
}

void DeformingInertia::add_gyroscopic(const Eigen::Vector3d& spin, double factor,
                                      Eigen::MatrixXd& matrix) const noexcept {
  const Eigen::Index stride = padded(modes());
  const Eigen::Map<const Eigen::MatrixXd> stacked(stacked_.data(), kProducts * stride, modes());
  for (int c = 0; c < 3; ++c) matrix += factor * spin[c] * stacked.middleRows((kSymmetric + c) * stride, modes());
}

void DeformingInertia::add_centrifugal(const Eigen::Vector3d& spin, double factor,
                                       Eigen::MatrixXd& matrix) const noexcept {
  const Eigen::Index stride = padded(modes());
  const Eigen::Matrix<double, 6, 1> slopes = 2 * factor * energy_slopes(spin);
  for (Eigen::Index j = 0; j < modes(); ++j) {
    const Eigen::Index below = modes() - j;
    const auto S = [&](int pair) {
      return Eigen::Map<const Eigen::VectorXd>(stacked_.data() + (j * kProducts + pair) * stride + j, below);
    };
    matrix.col(j).tail(below) +=
        slopes[0] * S(0) + slopes[1] * S(1) + slopes[2] * S(2) + slopes[3] * S(3) + slopes[4] * S(4) + slopes[5] * S(5);
  }
}

bool DeformingInertia::softens(const Eigen::Vector3d& spin, double velocity_factor) noexcept {
  const double share = spin.squaredNorm() / (velocity_factor * velocity_factor);
  return share >= kLeastSoftening && share <= kMostSoftening;
}

void DeformingInertia::add_softening(const Eigen::Vector3d& spin, double velocity_factor,
                                     Eigen::MatrixXd& hessian) const noexcept {
  if (softens(spin, velocity_factor)) add_centrifugal(spin, -1, hessian);
}

RotationArrays DeformingInertia::arrays() const noexcept {
  return {modes(), panels_.data(), turning_panels_.data(), linear_.data()};
}

LaneRotationArrays DeformingInertia::lane_arrays() const noexcept {
  LaneRotationArrays arrays;
  arrays.modes = modes();
  arrays.stride = padded(modes());
  arrays.stacked = stacked_.data();
  arrays.linear = linear_.data();
  arrays.second_moments = pairs_.data();
  return arrays;
}

}  // namespace exmat::runtime
