#include "runtime/export/morph_targets.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "common/core/decompositions.h"
#include "common/core/progress.h"

namespace exmat::runtime {
namespace {

constexpr double kRidge = 1e-3;            // of the mean squared weight
constexpr double kNoDirection = 1e-12;     // of the largest eigenvalue
constexpr Eigen::Index kFramesAtOnce = 8;  // so that a product of matrices serves them

/// Y [3v x N] coefficients of the modes [r x N] and weights of the frames [F x N], components in order.
struct Components {
  RowMatrix coefficients;
  RowMatrix weights;
};

/// With W = modes^T modes = V L V^T the displacements of a frame are as long as L^(1/2) V^T q, so that the singular
/// vectors of these small columns stand for those of the displacements of all vertices.
Components principal_components(const RowMatrix& modes, const RowMatrix& reduced, Eigen::Index count) {
  const Eigen::MatrixXd gram = modes.transpose() * modes;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);
  const double least = kNoDirection * eigen.eigenvalues().maxCoeff();
  const Eigen::Index kept = (eigen.eigenvalues().array() > least).count();  // ascending: the last ones
  const Eigen::VectorXd scales = eigen.eigenvalues().tail(kept).cwiseSqrt();
  const Eigen::MatrixXd vectors = eigen.eigenvectors().rightCols(kept);
  const Eigen::MatrixXd columns = scales.asDiagonal() * (vectors.transpose() * reduced.transpose());
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(columns, Eigen::ComputeThinU);
  const Eigen::MatrixXd left = svd.matrixU().leftCols(std::min(count, svd.matrixU().cols()));
  return {vectors * scales.cwiseInverse().asDiagonal() * left, columns.transpose() * left};
}

std::vector<std::string> names_of(const char* kind, Eigen::Index count) {
  std::vector<std::string> names;
  for (Eigen::Index k = 1; k <= count; ++k) names.push_back(fmt::format("{} {}", kind, k));
  return names;
}

void scale_weights_to_one(MorphTargets& targets) {
  for (Eigen::Index k = 0; k < targets.weights.cols(); ++k) {
    const double largest = targets.weights.col(k).cwiseAbs().maxCoeff();
    if (largest == 0) continue;
    targets.displacements.col(k) *= largest;
    targets.weights.col(k) /= largest;
  }
}

VertexArray moved(const DrawnSurface& surface, const Eigen::VectorXd& q) {
  VertexArray positions = surface.vertices;
  positions.reshaped<Eigen::RowMajor>() += surface.modes * q;
  return positions;
}

std::vector<Eigen::Index> spread(Eigen::Index frames, Eigen::Index most) {
  std::vector<Eigen::Index> chosen;
  const Eigen::Index count = std::min(frames, most);
  for (Eigen::Index k = 0; k < count; ++k) chosen.push_back(count == 1 ? 0 : k * (frames - 1) / (count - 1));
  return chosen;
}

/// targets.normals, so far their derivatives at rest, plus the least correction that fits the motion.
void fit_normals(const DrawnSurface& surface, const VertexNormals& normals, const RowMatrix& reduced,
                 MorphTargets& targets) {
  const Eigen::VectorXd rest = normals.at(surface.vertices).reshaped<Eigen::RowMajor>();
  const Eigen::Index count = targets.weights.cols();
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(count, count);
  RowMatrix products = RowMatrix::Zero(targets.normals.rows(), count);
  const std::vector<Eigen::Index> frames = spread(reduced.rows(), kNormalFrames);
  Progress progress("normals", std::ssize(frames));
  for (const Eigen::Index frame : frames) {
    const Eigen::VectorXd weights = targets.weights.row(frame);
    const VertexArray now = normals.at(moved(surface, reduced.row(frame)));
    const Eigen::VectorXd missed = now.reshaped<Eigen::RowMajor>() - rest - targets.normals * weights;
    products.noalias() += missed * weights.transpose();
    squares.noalias() += weights * weights.transpose();
    progress.advance();
  }
  const double ridge = kRidge * squares.trace() / static_cast<double>(count);
  if (ridge == 0) return;
  squares.diagonal().array() += ridge;
  targets.normals += squares.llt().solve(products.transpose()).transpose();
}

double squared_angles(const VertexArray& normals, const VertexArray& others) {
  double sum = 0;
  for (Eigen::Index k = 0; k < normals.rows(); ++k) {
    const Eigen::Vector3d a = normals.row(k), b = others.row(k);
    const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
    sum += angle * angle;
  }
  return sum;
}

}  // namespace

MorphTargets modes_as_targets(const DrawnSurface& surface, const VertexNormals& normals) {
  return {names_of("mode", surface.mode_count()), surface.modes, normals.derivatives(surface.vertices, surface.modes),
          RowMatrix(0, surface.mode_count())};
}

MorphTargets targets_of_motion(const DrawnSurface& surface, const VertexNormals& normals, const RowMatrix& reduced,
                               std::optional<std::int64_t> count) {
  MorphTargets targets;
  if (count && *count < surface.mode_count()) {
    const Components components = principal_components(surface.modes, reduced, *count);
    targets.displacements = surface.modes * components.coefficients;
    targets.weights = components.weights;
    targets.names = names_of("component", targets.weights.cols());
  } else {
    targets.displacements = surface.modes;
    targets.weights = reduced;
    targets.names = names_of(surface.mode_name, targets.weights.cols());
  }
  scale_weights_to_one(targets);
  targets.normals = normals.derivatives(surface.vertices, targets.displacements);
  fit_normals(surface, normals, reduced, targets);
  return targets;
}

MorphError error_of(const MorphTargets& targets, const DrawnSurface& surface, const VertexNormals& normals,
                    const RowMatrix& reduced) {
  const RowMatrix drawn = targets.displacements.cast<float>().cast<double>();
  const RowMatrix weights = targets.weights.cast<float>().cast<double>();
  const Eigen::VectorXd rounding =
      (surface.vertices.cast<float>().cast<double>() - surface.vertices).reshaped<Eigen::RowMajor>();
  MorphError error;
  double squares = 0;
  Progress progress("error", reduced.rows());
  for (Eigen::Index first = 0; first < reduced.rows(); first += kFramesAtOnce) {
    const Eigen::Index count = std::min(kFramesAtOnce, reduced.rows() - first);
    Eigen::MatrixXd missed = drawn * weights.middleRows(first, count).transpose();
    missed.noalias() -= surface.modes * reduced.middleRows(first, count).transpose();
    missed.colwise() += rounding;
    squares += missed.squaredNorm();
    const auto vertices = missed.reshaped(3, missed.size() / 3);
    error.largest = std::max(error.largest, vertices.colwise().norm().maxCoeff());
    progress.advance(count);
  }
  error.rms = std::sqrt(squares / static_cast<double>(surface.vertex_count() * reduced.rows()));

  const VertexArray rest = normals.at(surface.vertices);
  const std::vector<Eigen::Index> frames = spread(reduced.rows(), kNormalFrames);
  double angles = 0;
  for (const Eigen::Index frame : frames) {
    VertexArray shown = rest;
    shown.reshaped<Eigen::RowMajor>() += targets.normals * weights.row(frame).transpose();
    angles += squared_angles(shown, normals.at(moved(surface, reduced.row(frame))));
  }
  error.normal_rms = std::sqrt(angles / static_cast<double>(surface.vertex_count() * std::ssize(frames)));
  return error;
}

}  // namespace exmat::runtime
