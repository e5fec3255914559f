#include "runtime/export/surface_motion.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <vector>

#include "common/core/decompositions.h"
#include "common/core/progress.h"
#include "runtime/export/drawn_skin.h"

namespace exmat::runtime {
namespace {

constexpr double kFlat = 1e-3;     // determinant of a blend of bones below which it is not inverted
constexpr double kDamping = 1e-3;  // of the squares of such a blend

/// Takes a vertex in frame `frame` back to where it is drawn from.
class Unposing {
 public:
  Unposing(const DrawnSurface& surface, const BodyMotion& motion, Eigen::Index frame) : surface_(surface) {
    if (surface.skin) {
      moves_ = placed(*surface.skin, motion.bones.row(frame));
      for (std::size_t b = 0; b < moves_.size(); ++b) moves_[b] = moves_[b] * surface.skin->bind[b].inverse();
      return;
    }
    const auto turn = motion.orientations.row(frame);
    const Eigen::Quaterniond rotation(turn[0], turn[1], turn[2], turn[3]);
    const Eigen::Vector3d about = surface.free ? surface.origin : Eigen::Vector3d::Zero();
    frame_ =
        Eigen::Translation3d(motion.positions.row(frame).transpose() + about) * rotation * Eigen::Translation3d(-about);
  }

  /// The displacement that takes the vertex to `position`, world; grows `missed` where none does.
  Eigen::Vector3d displacement(Eigen::Index vertex, const Eigen::Vector3d& position, double& missed) const {
    const Eigen::Affine3d pose = surface_.skin ? blended(*surface_.skin, moves_, vertex) : frame_;
    const Eigen::Vector3d rest = surface_.vertices.row(vertex).transpose() + surface_.origin;
    const Eigen::Vector3d way = position - pose * rest;
    const Eigen::Matrix3d& linear = pose.linear();
    if (linear.determinant() > kFlat) return linear.inverse() * way;
    const Eigen::Matrix3d squares = linear.transpose() * linear + kDamping * Eigen::Matrix3d::Identity();
    const Eigen::Vector3d nearest = squares.inverse() * linear.transpose() * way;
    missed = std::max(missed, (linear * nearest - way).norm());
    return nearest;
  }

 private:
  const DrawnSurface& surface_;
  std::vector<Eigen::Isometry3d> moves_;
  Eigen::Affine3d frame_ = Eigen::Affine3d::Identity();
};

}  // namespace

SurfaceMotion read_surface_motion(TrajectoryReader& trajectory, const DrawnSurface& surface, const BodyMotion& motion) {
  const std::string& place = trajectory.open_positions(true);
  if (trajectory.samples() != motion.frames() || trajectory.points() != surface.of_vertices.cols())
    trajectory.refuse(place, fmt::format("{} frames of {} points", motion.frames(), surface.of_vertices.cols()),
                      fmt::format("{} of {}", trajectory.samples(), trajectory.points()));
  const Eigen::Vector3d origin = trajectory.origin();
  SurfaceMotion found;
  found.displacements.resize(motion.frames(), 3 * surface.vertex_count());
  std::vector<float> positions;
  for (Eigen::Index frame = 0; frame < motion.frames(); ++frame) {
    trajectory.read_next(positions);
    using Positions = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
    const Eigen::Map<const Positions> all(positions.data(), trajectory.points(), 3);
    const VertexArray drawn = (surface.of_vertices * all.cast<double>()).rowwise() + origin.transpose();
    const Unposing pose(surface, motion, frame);
    for (Eigen::Index v = 0; v < drawn.rows(); ++v)
      found.displacements.row(frame).segment<3>(3 * v) = pose.displacement(v, drawn.row(v), found.missed);
  }
  trajectory.check_sum();
  return found;
}

MotionComponents components_of(const RowMatrix& displacements, double tolerance) {
  const Eigen::Index frames = displacements.rows();
  const auto numbers = static_cast<double>(displacements.cols() / 3 * frames);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(displacements * displacements.transpose()));
  Eigen::Index kept = frames;  // eigenvalues ascend
  double cut = 0;
  for (Eigen::Index k = 0; k + 1 < frames; ++k, --kept) {
    cut += std::max(0.0, eigen.eigenvalues()[k]);
    if (std::sqrt(cut / numbers) > tolerance) break;
  }
  const Eigen::MatrixXd vectors = eigen.eigenvectors().rightCols(kept).rowwise().reverse();
  const Eigen::VectorXd lengths = eigen.eigenvalues().tail(kept).reverse().cwiseMax(0).cwiseSqrt();
  MotionComponents found;
  found.reduced = vectors * lengths.asDiagonal();
  found.modes = displacements.transpose() * vectors;
  for (Eigen::Index k = 0; k < kept; ++k)
    if (lengths[k] > 0) found.modes.col(k) /= lengths[k];
  double squares = 0;
  for (Eigen::Index frame = 0; frame < frames; ++frame) {
    const Eigen::VectorXd missed =
        displacements.row(frame).transpose() - found.modes * found.reduced.row(frame).transpose();
    squares += missed.squaredNorm();
    found.largest = std::max(found.largest, missed.reshaped(3, missed.size() / 3).colwise().norm().maxCoeff());
  }
  found.rms = std::sqrt(squares / numbers);
  return found;
}

}  // namespace exmat::runtime
