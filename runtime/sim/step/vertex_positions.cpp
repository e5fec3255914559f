#include "runtime/sim/step/vertex_positions.h"

#include <algorithm>

namespace exmat::runtime {
namespace {

/// Blocks in one call of the kernel. What it starts its sums from is zero: the rest positions come last.
constexpr Eigen::Index kBlocksAtOnce = 64;
alignas(kAlignment) constexpr float kZeros[16 * kBlocksAtOnce] = {};

}  // namespace

VertexPositions::VertexPositions(const VertexArray& rest, const RowMatrix& basis_rows)
    : points_(rest.rows()), modes_(basis_rows.cols()) {
  const Eigen::Index floats = 3 * points_, columns = modes_ + 1;
  basis_.resize(static_cast<std::size_t>((floats + kBlock - 1) / kBlock * columns));
  for (Eigen::Index row = 0; row < floats; ++row) {
    Block* const block = &basis_[static_cast<std::size_t>(row / kBlock * columns)];
    for (Eigen::Index c = 0; c < modes_; ++c) block[c].values[row % kBlock] = static_cast<float>(basis_rows(row, c));
    block[modes_].values[row % kBlock] = static_cast<float>(rest(row / 3, row % 3));
  }
}

VertexPositions::Workspace VertexPositions::make_workspace(Eigen::Index modes) {
  return {std::vector<float>(static_cast<std::size_t>(modes + 1))};
}

double VertexPositions::bytes() const { return static_cast<double>(basis_.size() * sizeof(Block)); }

void VertexPositions::evaluate(const Eigen::VectorXd& q, Workspace& workspace, float* xyz,
                               const Kernels& instructions) const noexcept {
  float* const amplitudes = workspace.amplitudes.data();
  for (Eigen::Index c = 0; c < modes_; ++c) amplitudes[c] = static_cast<float>(q[c]);
  amplitudes[modes_] = 1;
  const Eigen::Index columns = modes_ + 1, whole = 3 * points_ / kBlock, left = 3 * points_ % kBlock;
  const Block* basis = basis_.data();
  for (Eigen::Index first = 0; first < whole; first += kBlocksAtOnce) {
    const Eigen::Index count = std::min(kBlocksAtOnce, whole - first);
    instructions.positions(kZeros, basis->values, count, columns, amplitudes, xyz + first * kBlock);
    basis += count * columns;
  }
  if (left == 0) return;
  Block last;
  instructions.positions(kZeros, basis->values, 1, columns, amplitudes, last.values);
  std::copy_n(last.values, left, xyz + whole * kBlock);
}

}  // namespace exmat::runtime
