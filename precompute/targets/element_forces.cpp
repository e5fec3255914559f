#include "precompute/targets/element_forces.h"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "common/core/decompositions.h"
#include "runtime/sim/elasticity/element_potential.h"

namespace exmat::precompute {
namespace {

using runtime::AlignedArray;
using runtime::kLanes;

using Lanes = Eigen::Map<Eigen::Array<double, kLanes, 1>, Eigen::AlignedMax>;
using ConstLanes = Eigen::Map<const Eigen::Array<double, kLanes, 1>, Eigen::AlignedMax>;

constexpr double kTolerance = 1e-9;  // of the largest example
constexpr int kMostSteps = 40;
constexpr int kMostHalvings = 5;
constexpr Eigen::Index kTogether = 1024;  // elements whose numbers stay in the caches
constexpr Eigen::Index kEntries = 9;      // of a displacement gradient, H_ab at 3a + b

// Its inverse, or of none where it is not positive definite: stiffness at rest is the identity.
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& hessian) {
  const Eigen::Index d = hessian.rows();
  const Eigen::LLT<Eigen::MatrixXd> factor(hessian);  // of the lower triangle
  if (factor.info() != Eigen::Success) return Eigen::MatrixXd::Identity(d, d);
  return factor.solve(Eigen::MatrixXd::Identity(d, d));
}

// Nocedal and Wright 2006, equation 6.17.
void update(const Eigen::VectorXd& step, const Eigen::VectorXd& change, Eigen::MatrixXd& inverse) {
  const double curvature = step.dot(change);
  if (!(curvature > 0)) return;
  const Eigen::VectorXd mapped = inverse * change;
  inverse += (1 + change.dot(mapped) / curvature) / curvature * step * step.transpose() -
             (mapped * step.transpose() + step * mapped.transpose()) / curvature;
}

// One of the sums on its way to its minimum.
class Descent {
 public:
  Descent(Eigen::VectorXd y, Eigen::MatrixXd inverse, double enough)
      : y_(std::move(y)), inverse_(std::move(inverse)), enough_(enough) {}

  bool open() const { return open_; }
  Eigen::VectorXd trial() const { return taken_ < 0 ? y_ : y_ + step_; }
  const Eigen::VectorXd& y() const { return y_; }
  ElementForces::Answer answer() const { return {residual_ <= enough_, residual_}; }

  /// The gradient at the trial.
  void take(const Eigen::VectorXd& gradient) {
    const double residual = gradient.norm();
    if (taken_ < 0 || residual < residual_) {
      if (taken_ >= 0) {
        update(step_, gradient - gradient_, inverse_);
        y_ += step_;
      }
      gradient_ = gradient;
      residual_ = residual;
      step_ = -(inverse_ * gradient_);
      halvings_ = 0;
      open_ = residual_ > enough_ && ++taken_ < kMostSteps;
    } else {
      step_ *= 0.5;
      open_ = ++halvings_ <= kMostHalvings;
    }
  }

 private:
  Eigen::VectorXd y_, gradient_, step_;
  Eigen::MatrixXd inverse_;
  double enough_, residual_ = 0;
  int taken_ = -1, halvings_ = 0;
  bool open_ = true;
};

}  // namespace

// Sums at N weights, a number of each in each lane, kLanes of them in a group.
struct ElementForces::Batch {
  Eigen::Index groups = 0, rows = 0;  ///< rows: of the vertices of a part
  AlignedArray weights{};             ///< groups x K x kLanes
  AlignedArray displacements{};       ///< groups x rows x kLanes
  AlignedArray forces{};              ///< likewise

  const double* weight(Eigen::Index group, std::size_t k, std::size_t examples) const {
    return weights.data() + (static_cast<std::size_t>(group) * examples + k) * kLanes;
  }
};

ElementForces::ElementForces(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& coordinates,
                             EnergyReference reference)
    : object_(object),
      reference_(reference),
      elements_(elements_of(object.mesh, object.materials)),
      fields_(system.extend(coordinates.basis)) {
  for (const auto& pose : coordinates.poses.colwise()) examples_.emplace_back(fields_ * pose);
  for (Eigen::Index e = 0; e < elements_.count(); ++e) {
    const auto upright = [&](const Eigen::VectorXd& u) {
      return (Eigen::Matrix3d::Identity() + elements_.displacement_gradient(e, u)).determinant() > 0;
    };
    if (reference != EnergyReference::kExample || std::ranges::all_of(examples_, upright)) members_.push_back(e);
  }
  parts_ = element_parts(object.mesh.vertices, elements_, members_, kTogether);
}

// Adds the forces of a part's elements, by the material's lanes: one element is all of the body, the entries of its
// displacement gradient from the example's are its modes.
void ElementForces::add_forces(std::size_t index, Batch& batch) const {
  constexpr Eigen::Index kStride = runtime::padded(kEntries);
  alignas(runtime::kAlignment) double gradient[9 * kStride] = {}, entries[kEntries * kLanes],
                                                   stresses[kEntries * kLanes], energies[kLanes];
  using Lane = Eigen::Array<double, kLanes, 1>;
  LameParameters lame;
  const runtime::ElementArrays arrays{
      .panels = 1, .modes = kEntries, .stride = kStride, .by_element = gradient, .count = 1};
  const runtime::ElementLaw law{
      .kind = runtime::law_kind(object_.materials.model), .mu = &lame.mu, .lambda = &lame.lambda};
  const ElementPart& part = parts_[index];
  for (std::size_t i = 0; i < part.elements.size(); ++i) {
    const Eigen::Index element = part.elements[i];
    const auto places = part.places[i];
    const auto shape = elements_.gradients_of(element);
    const LameParameters own = elements_.lame(element);
    const double volume = elements_.volumes[element];
    for (std::size_t k = 0; k < examples_.size(); ++k) {
      const Eigen::Matrix3d H = elements_.displacement_gradient(element, examples_[k]);
      // Gradients from the example's shape on: those at rest times the inverse of its deformation gradient.
      Eigen::Matrix3d from_rest = Eigen::Matrix3d::Identity();
      double scale = volume;
      if (reference_ == EnergyReference::kExample) {
        const Eigen::Matrix3d F = Eigen::Matrix3d::Identity() + H;
        scale *= F.determinant();
        from_rest = F.inverse();
      }
      lame = {scale * own.mu, scale * own.lambda};
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          for (int c = 0; c < 3; ++c) gradient[(3 * a + b) * kStride + 3 * a + c] = from_rest(c, b);
      for (Eigen::Index group = 0; group < batch.groups; ++group) {
        const ConstLanes weights(batch.weight(group, k, examples_.size()));
        if ((weights == 0).all()) continue;
        const double* displacements = batch.displacements.data() + group * batch.rows * kLanes;
        double* forces = batch.forces.data() + group * batch.rows * kLanes;
        for (int a = 0; a < 3; ++a) {
          Lane sums[3] = {Lane::Constant(-H(a, 0)), Lane::Constant(-H(a, 1)), Lane::Constant(-H(a, 2))};
          for (std::size_t j = 0; j < places.size(); ++j) {
            const ConstLanes u(displacements + (3 * places[j] + a) * kLanes);
            for (int c = 0; c < 3; ++c) sums[c] += shape(static_cast<Eigen::Index>(j), c) * u;
          }
          for (int c = 0; c < 3; ++c) Lanes(entries + (3 * a + c) * kLanes) = sums[c];
        }
        runtime::kernels().lanes_force(arrays, law, entries, energies, stresses);
        for (int a = 0; a < 3; ++a) {
          const Lane rows[3] = {weights * ConstLanes(stresses + 3 * a * kLanes),
                                weights * ConstLanes(stresses + (3 * a + 1) * kLanes),
                                weights * ConstLanes(stresses + (3 * a + 2) * kLanes)};
          for (std::size_t j = 0; j < places.size(); ++j) {
            Lanes force(forces + (3 * places[j] + a) * kLanes);
            for (int c = 0; c < 3; ++c) force += shape(static_cast<Eigen::Index>(j), c) * rows[c];
          }
        }
      }
    }
  }
}

Eigen::MatrixXd ElementForces::forces_of_part(std::size_t index, const RowMatrix& weights,
                                              const Eigen::MatrixXd& p) const {
  const std::vector<std::int32_t>& vertices = parts_[index].vertices;
  const Eigen::Index d = p.rows(), count = p.cols(), rows = 3 * std::ssize(vertices);
  RowMatrix by_rows(rows, d);
  for (std::size_t v = 0; v < vertices.size(); ++v)
    by_rows.middleRows<3>(3 * static_cast<Eigen::Index>(v)) = fields_.middleRows<3>(3 * vertices[v]);
  const Eigen::MatrixXd by_columns = by_rows;
  Batch batch{.groups = runtime::padded(count) / kLanes, .rows = rows};
  batch.weights = AlignedArray(batch.groups * weights.cols() * kLanes);
  batch.displacements = AlignedArray(batch.groups * rows * kLanes);
  batch.forces = AlignedArray(batch.groups * rows * kLanes);
  AlignedArray lanes(d * kLanes);
  for (Eigen::Index n = 0; n < count; ++n)
    for (Eigen::Index k = 0; k < weights.cols(); ++k)
      batch.weights[(n / kLanes * weights.cols() + k) * kLanes + n % kLanes] = weights(n, k);
  const runtime::Kernels& kernels = runtime::kernels();
  for (Eigen::Index group = 0; group < batch.groups; ++group) {
    lanes = AlignedArray(d * kLanes);
    for (Eigen::Index lane = 0; lane < std::min(kLanes, count - group * kLanes); ++lane)
      for (Eigen::Index i = 0; i < d; ++i) lanes[i * kLanes + lane] = p(i, group * kLanes + lane);
    kernels.lanes_matrix_product(by_columns.data(), rows, d, rows, lanes.data(),
                                 batch.displacements.data() + group * rows * kLanes);
  }
  add_forces(index, batch);
  Eigen::MatrixXd sums(d, count);
  for (Eigen::Index group = 0; group < batch.groups; ++group) {
    kernels.lanes_matrix_product(by_rows.data(), d, rows, d, batch.forces.data() + group * rows * kLanes, lanes.data());
    for (Eigen::Index lane = 0; lane < std::min(kLanes, count - group * kLanes); ++lane)
      for (Eigen::Index i = 0; i < d; ++i) sums(i, group * kLanes + lane) = lanes[i * kLanes + lane];
  }
  return sums;
}

Eigen::MatrixXd ElementForces::forces(const RowMatrix& weights, const Eigen::MatrixXd& p) const {
  std::vector<Eigen::MatrixXd> of_parts(parts_.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t index = 0; index < parts_.size(); ++index) of_parts[index] = forces_of_part(index, weights, p);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(p.rows(), p.cols());
  for (const Eigen::MatrixXd& of_part : of_parts) sum += of_part;
  return sum;
}

std::vector<ElementForces::Answer> ElementForces::polish(const runtime::TargetSolver& solver, const RowMatrix& weights,
                                                         Eigen::MatrixXd& y) const {
  const RowMatrix& Z = solver.basis();
  double largest = 0;
  for (Eigen::Index k = 0; k < weights.cols(); ++k) largest = std::max(largest, solver.example(k).norm());
  std::vector<Eigen::MatrixXd> inverses(static_cast<std::size_t>(y.cols()));
#pragma omp parallel
  {
    auto workspace = solver.make_workspace();
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(y.rows(), y.rows());
#pragma omp for schedule(dynamic)
    for (Eigen::Index n = 0; n < y.cols(); ++n) {
      solver.hessian(weights.row(n).transpose(), y.col(n), workspace, hessian);
      inverses[static_cast<std::size_t>(n)] = inverse_of(hessian);
    }
  }
  std::vector<Descent> descents;
  for (Eigen::Index n = 0; n < y.cols(); ++n)
    descents.emplace_back(y.col(n), std::move(inverses[static_cast<std::size_t>(n)]), kTolerance * largest);
  for (;;) {
    std::vector<Eigen::Index> open;
    for (Eigen::Index n = 0; n < y.cols(); ++n)
      if (descents[static_cast<std::size_t>(n)].open()) open.push_back(n);
    if (open.empty()) break;
    Eigen::MatrixXd trials(y.rows(), std::ssize(open));
    for (std::size_t i = 0; i < open.size(); ++i)
      trials.col(static_cast<Eigen::Index>(i)) = descents[static_cast<std::size_t>(open[i])].trial();
    const Eigen::MatrixXd gradients = Z.transpose() * forces(weights(open, Eigen::all), Z * trials);
    for (std::size_t i = 0; i < open.size(); ++i)
      descents[static_cast<std::size_t>(open[i])].take(gradients.col(static_cast<Eigen::Index>(i)));
  }
  std::vector<Answer> answers;
  for (Eigen::Index n = 0; n < y.cols(); ++n) {
    const Descent& descent = descents[static_cast<std::size_t>(n)];
    y.col(n) = descent.y();
    answers.push_back(descent.answer());
  }
  return answers;
}

}  // namespace exmat::precompute
