#include "precompute/polynomial/reduced_polynomial.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <utility>
#include <vector>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "precompute/cubature/element_samples.h"

namespace exmat::precompute {
namespace {

using Strain = Eigen::Matrix<double, 6, 1>;  // a symmetric 3 x 3 matrix; its dot product is that of the matrices

constexpr Eigen::Index kStrainSize = 6;
constexpr Eigen::Index kBatchBytes = Eigen::Index{64} << 20;
// Elements of one batch: enough for the products, few enough to report progress.
constexpr Eigen::Index kMostBatchElements = 256;
// Pairs of modes of one block of the products, the unit of work of a thread.
constexpr Eigen::Index kPairBlock = 96;

Eigen::Index pair_count(Eigen::Index size) { return size * (size + 1) / 2; }

// Place of a pair in the lower triangle by rows, i >= j or not.
Eigen::Index pair_index(Eigen::Index i, Eigen::Index j) { return i >= j ? pair_count(i) + j : pair_count(j) + i; }

// Multiplies strains by the square root of V times the elasticity, so that the energy of an element is half a squared
// norm: V (mu |dev E|^2 + (3 lambda + 2 mu) / 6 tr(E)^2).
struct StrainScale {
  double deviatoric = 0, spherical = 0;

  StrainScale(double volume, const LameParameters& lame)
      : deviatoric(std::sqrt(2 * lame.mu * volume)), spherical(std::sqrt((3 * lame.lambda + 2 * lame.mu) * volume)) {}

  // Scaled strain 1/2 (M + M^T).
  Strain operator()(const Eigen::Matrix3d& M) const {
    const double shift = (spherical - deviatoric) * M.trace() / 3;
    const double shear = deviatoric * std::numbers::sqrt2 / 2;
    return {deviatoric * M(0, 0) + shift, deviatoric * M(1, 1) + shift, deviatoric * M(2, 2) + shift,
            shear * (M(0, 1) + M(1, 0)),  shear * (M(1, 2) + M(2, 1)),  shear * (M(2, 0) + M(0, 2))};
  }
};

// Scaled strains of some elements, six rows each: e(q) = sum_i l_i q_i + 1/2 sum_ij m_ij q_i q_j.
struct StrainBatch {
  Eigen::MatrixXd linear;     // 6 B x r, l_i
  Eigen::MatrixXd quadratic;  // 6 B x R, m_ij
};

void fill_element(const RowMatrix& B, const StrainScale& scale, Eigen::Index row, StrainBatch& batch) {
  std::vector<Eigen::Matrix3d> gradients(static_cast<std::size_t>(B.cols()));
  for (Eigen::Index i = 0; i < B.cols(); ++i) {
    Eigen::Matrix3d& G = gradients[static_cast<std::size_t>(i)];
    G = B.col(i).reshaped<Eigen::RowMajor>(3, 3);
    batch.linear.col(i).segment<kStrainSize>(row) = scale(G);
    for (Eigen::Index j = 0; j <= i; ++j)
      batch.quadratic.col(pair_index(i, j)).segment<kStrainSize>(row) =
          scale(G.transpose() * gradients[static_cast<std::size_t>(j)]);
  }
}

// Sums over elements before symmetrisation: l_i . l_j, m_ij . l_k, m_ij . m_kl.
class StrainProducts {
 public:
  explicit StrainProducts(Eigen::Index modes) : pairs_(pair_count(modes)) {
    sums.stiffness.setZero(modes, modes);
    sums.cubic.setZero(pairs_, modes);
    sums.quartic.setZero(pair_count(pairs_));
    for (Eigen::Index row = 0; row < pairs_; row += kPairBlock)
      for (Eigen::Index col = 0; col <= row; col += kPairBlock) blocks_.emplace_back(row, col);
  }

  // Every sum is that of one thread, in the order of the batches.
  void add(const StrainBatch& batch) {
    sums.stiffness.noalias() += batch.linear.transpose() * batch.linear;
    const auto count = static_cast<std::int64_t>(blocks_.size());
#pragma omp parallel for schedule(dynamic)
    for (std::int64_t b = 0; b < count; ++b) {
      const auto [row, col] = blocks_[static_cast<std::size_t>(b)];
      if (col == 0) add_cubic(batch, row);
      add_quartic(batch, row, col);
    }
  }

  PolynomialData sums;

 private:
  Eigen::Index block_size(Eigen::Index first) const { return std::min(kPairBlock, pairs_ - first); }

  void add_cubic(const StrainBatch& batch, Eigen::Index row) {
    const Eigen::Index size = block_size(row);
    sums.cubic.middleRows(row, size).noalias() += batch.quadratic.middleCols(row, size).transpose() * batch.linear;
  }

  void add_quartic(const StrainBatch& batch, Eigen::Index row, Eigen::Index col) {
    const RowMatrix block =
        batch.quadratic.middleCols(row, block_size(row)).transpose() * batch.quadratic.middleCols(col, block_size(col));
    for (Eigen::Index i = 0; i < block.rows(); ++i) {
      const Eigen::Index size = std::min(block.cols(), row + i - col + 1);
      sums.quartic.segment(pair_index(row + i, col), size) += block.row(i).head(size).transpose();
    }
  }

  Eigen::Index pairs_;
  std::vector<std::pair<Eigen::Index, Eigen::Index>> blocks_;
};

// C_ijk = m_ij . l_k + m_ik . l_j + m_jk . l_i, in place.
void symmetrise_cubic(RowMatrix& cubic) {
  for (Eigen::Index i = 0; i < cubic.cols(); ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      for (Eigen::Index k = 0; k <= j; ++k) {
        double* const entries[] = {&cubic(pair_index(i, j), k), &cubic(pair_index(i, k), j),
                                   &cubic(pair_index(j, k), i)};
        const double sum = *entries[0] + *entries[1] + *entries[2];
        for (double* entry : entries) *entry = sum;
      }
}

// D_ijkl = m_ij . m_kl + m_ik . m_jl + m_il . m_jk, in place.
void symmetrise_quartic(Eigen::Index modes, Eigen::VectorXd& quartic) {
#pragma omp parallel for schedule(dynamic)
  for (Eigen::Index i = 0; i < modes; ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      for (Eigen::Index k = 0; k <= j; ++k)
        for (Eigen::Index l = 0; l <= k; ++l) {
          double* const entries[] = {&quartic[pair_index(pair_index(i, j), pair_index(k, l))],
                                     &quartic[pair_index(pair_index(i, k), pair_index(j, l))],
                                     &quartic[pair_index(pair_index(i, l), pair_index(j, k))]};
          const double sum = *entries[0] + *entries[1] + *entries[2];
          for (double* entry : entries) *entry = sum;
        }
}

}  // namespace

void require_polynomial_modes(Eigen::Index modes) {
  if (modes <= kMostPolynomialModes) return;
  throw InputError(
      {"", "/internal_force", fmt::format("at most {} modes with \"polynomial\"", kMostPolynomialModes),
       fmt::format("{}, for which it takes {:.1f} GB", modes, 1e-9 * static_cast<double>(polynomial_bytes(modes))),
       "use \"cubature\", or a smaller basis.size"});
}

double polynomial_flops(Eigen::Index modes, Eigen::Index elements) {
  const auto r = static_cast<double>(modes), R = static_cast<double>(pair_count(modes));
  return kStrainSize * static_cast<double>(elements) * R * (R + 2 * r);
}

std::int64_t polynomial_bytes(Eigen::Index modes) {
  const std::int64_t pairs = pair_count(modes);
  return static_cast<std::int64_t>(sizeof(double)) * (modes * modes + pairs * modes + pair_count(pairs));
}

PolynomialData reduced_polynomial(const TetMesh& mesh, const TetMaterials& materials, const RowMatrix& basis) {
  const Eigen::Index modes = basis.cols(), pairs = pair_count(modes);
  require_polynomial_modes(modes);
  const ElementSamples elements(mesh, materials, basis);
  const Eigen::Index fit = kBatchBytes / (kStrainSize * (modes + pairs) * static_cast<Eigen::Index>(sizeof(double)));
  const Eigen::Index batch_elements = std::clamp(fit, Eigen::Index{1}, std::min(kMostBatchElements, elements.count()));
  StrainBatch batch;
  StrainProducts products(modes);
  Progress progress("polynomial", elements.count());
  for (Eigen::Index first = 0; first < elements.count(); first += batch_elements) {
    const Eigen::Index count = std::min(batch_elements, elements.count() - first);
    batch.linear.resize(kStrainSize * count, modes);
    batch.quadratic.resize(kStrainSize * count, pairs);
#pragma omp parallel for
    for (Eigen::Index t = 0; t < count; ++t) {
      const Eigen::Index element = first + t;
      fill_element(elements.gradient(element), StrainScale(elements.volume(element), elements.lame(element)),
                   kStrainSize * t, batch);
    }
    products.add(batch);
    progress.advance(count);
  }
  PolynomialData& data = products.sums;
  data.stiffness = RowMatrix(data.stiffness.selfadjointView<Eigen::Lower>()) + elements.variance();
  symmetrise_cubic(data.cubic);
  symmetrise_quartic(modes, data.quartic);
  return std::move(data);
}

}  // namespace exmat::precompute
