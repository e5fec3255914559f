#include "precompute/cubature/element_samples.h"

#include <algorithm>

#include "runtime/sim/elasticity/element_potential.h"

namespace exmat::precompute {
namespace {

using runtime::AlignedArray;
using runtime::ElementArrays;
using runtime::ElementLaw;
using runtime::kLanes;

constexpr Eigen::Index kAtOnce = 64;       // elements whose B the second-level cache holds
constexpr Eigen::Index kPartialSums = 64;  // whatever the number of threads: sums do not depend on it

ElementLaw law_of(MaterialModel model, const double* mu, const double* lambda) {
  ElementLaw law;
  law.kind = runtime::law_kind(model);
  law.mu = mu;
  law.lambda = lambda;
  return law;
}

}  // namespace

PoseLanes::PoseLanes(const RowMatrix& poses)
    : count_(poses.rows()), modes_(poses.cols()), numbers_(groups() * modes_ * kLanes) {
  for (Eigen::Index p = 0; p < count_; ++p)
    for (Eigen::Index c = 0; c < modes_; ++c) numbers_[(p / kLanes * modes_ + c) * kLanes + p % kLanes] = poses(p, c);
}

Eigen::VectorXd Responses::force_norms() const {
  Eigen::ArrayXd norms(groups() * kLanes);
  for (Eigen::Index g = 0; g < groups(); ++g)
    norms.segment<kLanes>(g * kLanes) = group(g).leftCols(rows_ - 1).square().rowwise().sum().sqrt();
  return norms.head(poses_);
}

Eigen::VectorXd Responses::energies() const {
  Eigen::ArrayXd energies(groups() * kLanes);
  for (Eigen::Index g = 0; g < groups(); ++g) energies.segment<kLanes>(g * kLanes) = group(g).col(rows_ - 1);
  return energies.head(poses_);
}

ElementSamples::ElementSamples(const TetMesh& mesh, const TetMaterials& materials, const RowMatrix& basis)
    : mesh_(mesh), materials_(materials), basis_(basis), elements_(elements_of(mesh, materials)) {}

RowMatrix ElementSamples::gradient(Eigen::Index element) const {
  RowMatrix B(9, modes());
  write_gradient(element, modes(), B.data());
  return B;
}

CubatureData ElementSamples::data_of(const std::vector<Eigen::Index>& elements) const {
  const auto s = std::ssize(elements);
  CubatureData data;
  data.elements.resize(s);
  data.gradient.resize(9 * s, modes());
  for (Eigen::Index j = 0; j < s; ++j) {
    const Eigen::Index element = elements[static_cast<std::size_t>(j)];
    data.elements[j] = static_cast<std::int32_t>(element);
    data.gradient.middleRows<9>(9 * j) = gradient(element);
  }
  data.volumes = elements_.volumes(elements);
  data.youngs_modulus = elements_.youngs_modulus(elements);
  data.poisson_ratio = elements_.poisson_ratio(elements);
  return data;
}

RowMatrix ElementSamples::variance() const {
  const SparseMatrix S = variance_matrix(mesh_, materials_, elements_);
  RowMatrix sum = RowMatrix::Zero(modes(), modes());
  for (Eigen::Index row = 0; row < S.outerSize(); ++row) {
    RowMatrix image = RowMatrix::Zero(3, modes());
    for (SparseMatrix::InnerIterator entry(S, row); entry; ++entry)
      image += entry.value() * basis_.middleRows<3>(3 * entry.col());
    sum += basis_.middleRows<3>(3 * row).transpose() * image;
  }
  return 0.5 * (sum + sum.transpose());  // without the rounding of a product that is symmetric
}

// Rows `stride` apart.
void ElementSamples::write_gradient(Eigen::Index element, Eigen::Index stride, double* numbers) const {
  const auto vertices = elements_.vertices_of(element);
  const auto shape = elements_.gradients_of(element);
  Eigen::Map<RowMatrix, 0, Eigen::OuterStride<>> B(numbers, 9, modes(), Eigen::OuterStride<>(stride));
  B.setZero();
  for (std::size_t j = 0; j < vertices.size(); ++j)
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        B.row(3 * a + b) += shape(static_cast<Eigen::Index>(j), b) * basis_.row(3 * vertices[j] + a);
}

void ElementSamples::respond(Eigen::Index element, const PoseLanes& poses, Responses& responses) const {
  const Eigen::Index r = modes(), stride = runtime::padded(r);
  thread_local AlignedArray B;
  if (B.size() != 9 * stride) B = AlignedArray(9 * stride);
  write_gradient(element, stride, B.data());
  const auto parameters = lame(element);
  const double mu = volume(element) * parameters.mu, lambda = volume(element) * parameters.lambda;
  const ElementArrays arrays{1, r, stride, nullptr, B.data(), nullptr, 1};
  const ElementLaw law = law_of(materials_.model, &mu, &lambda);
  for (Eigen::Index g = 0; g < poses.groups(); ++g) {
    auto group = responses.group(g);
    runtime::kernels().lanes_force(arrays, law, poses.group(g), &group(0, r), &group(0, 0));
  }
}

// Adds the stiffness in kLanes poses, in the layout of the kernels.
void ElementSamples::add_stiffness(const std::vector<Eigen::Index>& elements, const Eigen::VectorXd& weights, Part part,
                                   const PoseLanes& poses, std::vector<AlignedArray>& sums) const {
  const Eigen::Index r = modes(), stride = runtime::padded(r);
  AlignedArray B(kAtOnce * 9 * stride), mu(kAtOnce), lambda(kAtOnce), force(r * kLanes),
      stiffness(runtime::lane_triangle(r));
  double energy[kLanes];
  for (Eigen::Index first = part.begin; first < part.end; first += kAtOnce) {
    const Eigen::Index count = std::min(kAtOnce, part.end - first);
    for (Eigen::Index e = 0; e < count; ++e) {
      const Eigen::Index element = elements[static_cast<std::size_t>(first + e)];
      const auto parameters = lame(element);
      write_gradient(element, stride, B.data() + e * 9 * stride);
      mu[e] = weights[first + e] * volume(element) * parameters.mu;
      lambda[e] = weights[first + e] * volume(element) * parameters.lambda;
    }
    const ElementArrays arrays{runtime::padded(count) / kLanes, r, stride, nullptr, B.data(), nullptr, count};
    const ElementLaw law = law_of(materials_.model, mu.data(), lambda.data());
    for (Eigen::Index g = 0; g < poses.groups(); ++g) {
      runtime::kernels().lanes_force_and_stiffness(arrays, law, poses.group(g), energy, force.data(), stiffness.data());
      AlignedArray& sum = sums[static_cast<std::size_t>(g)];
      for (Eigen::Index i = 0; i < stiffness.size(); ++i) sum[i] += stiffness[i];
    }
  }
}

std::vector<Eigen::MatrixXd> ElementSamples::stiffness(const std::vector<Eigen::Index>& elements,
                                                       const Eigen::VectorXd& weights, const PoseLanes& poses) const {
  const Eigen::Index r = modes();
  using Sums = std::vector<AlignedArray>;
  const Sums zeros(static_cast<std::size_t>(poses.groups()), AlignedArray(runtime::lane_triangle(r)));
  const std::vector<Part> parts = parts_of(std::ssize(elements));
  std::vector<Sums> partial(parts.size(), zeros);
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < parts.size(); ++i) add_stiffness(elements, weights, parts[i], poses, partial[i]);
  std::vector<Eigen::MatrixXd> stiffness(static_cast<std::size_t>(poses.count()), Eigen::MatrixXd::Zero(r, r));
  for (const Sums& sums : partial)
    for (Eigen::Index p = 0; p < poses.count(); ++p)
      for (Eigen::Index i = 0; i < r; ++i)
        for (Eigen::Index j = 0; j <= i; ++j)
          stiffness[static_cast<std::size_t>(p)](i, j) +=
              sums[static_cast<std::size_t>(p / kLanes)][runtime::lane_entry(i, j) + p % kLanes];
  for (Eigen::MatrixXd& K : stiffness) K = Eigen::MatrixXd(K.selfadjointView<Eigen::Lower>());
  return stiffness;
}

std::vector<Part> parts_of(Eigen::Index count) {
  std::vector<Part> parts;
  const Eigen::Index number = std::min(count, kPartialSums);
  for (Eigen::Index i = 0; i < number; ++i) parts.push_back({count * i / number, count * (i + 1) / number});
  return parts;
}

}  // namespace exmat::precompute
