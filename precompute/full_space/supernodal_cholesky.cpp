#include "precompute/full_space/supernodal_cholesky.h"

#include <Eigen/OrderingMethods>
#include <algorithm>
#include <utility>

#include "common/core/decompositions.h"

namespace exmat::precompute {
namespace {

using Index = std::int32_t;
using Matrix = SupernodalCholesky::Matrix;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

Graph graph_of(const Matrix& symmetric) {
  Graph graph;
  for (Index column = 0; column < symmetric.outerSize(); ++column) {
    for (Matrix::InnerIterator entry(symmetric, column); entry; ++entry)
      if (entry.row() != column) graph.neighbours.push_back(static_cast<Index>(entry.row()));
    graph.starts.push_back(static_cast<Index>(graph.neighbours.size()));
  }
  return graph;
}

// By approximate minimum degree.
Elimination plan_of(const Matrix& pattern) {
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  const Matrix symmetric = pattern.selfadjointView<Eigen::Lower>();
  Eigen::AMDOrdering<int>()(symmetric, permutation);  // row k of the result is row indices()[k]
  std::vector<Index> place(at(static_cast<Index>(pattern.rows())));
  for (Index k = 0; k < static_cast<Index>(pattern.rows()); ++k) place[at(permutation.indices()[k])] = k;
  return elimination_of(graph_of(symmetric), std::move(place), 1);
}

}  // namespace

SupernodalCholesky::SupernodalCholesky(const Matrix& pattern) : plan_(plan_of(pattern)) {
  for (const Elimination::Node& node : plan_.nodes)
    blocks_.emplace_back(node.columns + std::ssize(node.rows), node.columns);
  place_entries(pattern);
  position_.assign(plan_.place.size(), 0);
}

void SupernodalCholesky::place_entries(const Matrix& pattern) {
  values_.resize(plan_.nodes.size());
  std::vector<Index> node_of(plan_.place.size());
  for (std::size_t i = 0; i < plan_.nodes.size(); ++i)
    for (Index c = 0; c < plan_.nodes[i].columns; ++c) node_of[at(plan_.nodes[i].begin + c)] = static_cast<Index>(i);
  for (Index column = 0; column < pattern.outerSize(); ++column)
    for (Matrix::InnerIterator entry(pattern, column); entry; ++entry) {
      const auto [low, high] = std::minmax(plan_.place[at(static_cast<Index>(entry.row()))], plan_.place[at(column)]);
      values_[at(node_of[at(low)])].push_back(static_cast<Index>(entry_.size()));
      entry_.push_back({high, low});
    }
}

// The front of a node: its columns, what children and matrix add to them, and what it leaves for its parent.
bool SupernodalCholesky::eliminate(std::size_t index, const Matrix& matrix, std::vector<Eigen::MatrixXd>& updates) {
  const Elimination::Node& node = plan_.nodes[index];
  Eigen::MatrixXd& block = blocks_[index];
  const Eigen::Index columns = node.columns, below = std::ssize(node.rows);
  for (Index c = 0; c < node.columns; ++c) position_[at(node.begin + c)] = c;
  for (std::size_t i = 0; i < node.rows.size(); ++i) position_[at(node.rows[i])] = node.columns + static_cast<Index>(i);
  block.setZero();
  Eigen::MatrixXd& rest = updates[index];
  rest.setZero(below, below);
  for (const Index value : values_[index]) {
    const Entry& entry = entry_[at(value)];
    block(position_[at(entry.row)], position_[at(entry.column)]) += matrix.valuePtr()[value];
  }
  for (const Index child : node.children) {
    const std::vector<Index>& rows = plan_.nodes[at(child)].rows;
    Eigen::MatrixXd& update = updates[at(child)];
    for (std::size_t j = 0; j < rows.size(); ++j) {
      const Index column = position_[at(rows[j])];
      double* into = column < node.columns ? block.col(column).data() : rest.col(column - columns).data() - columns;
      const double* from = update.col(static_cast<Eigen::Index>(j)).data();
      for (std::size_t i = j; i < rows.size(); ++i) into[position_[at(rows[i])]] += from[i];
    }
    update.resize(0, 0);
  }
  auto diagonal = block.topRows(columns);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(diagonal);
  if (factor.info() != Eigen::Success) return false;
  auto lower = block.bottomRows(below);
  diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(lower);
  rest.selfadjointView<Eigen::Lower>().rankUpdate(lower, -1);
  return true;
}

bool SupernodalCholesky::factorise(const Matrix& matrix) {
  std::vector<Eigen::MatrixXd> updates(plan_.nodes.size());
  for (std::size_t i = 0; i < plan_.nodes.size(); ++i)
    if (!eliminate(i, matrix, updates)) return false;
  return true;
}

Eigen::VectorXd SupernodalCholesky::solve(const Eigen::VectorXd& b) const {
  Eigen::VectorXd x(b.size()), gathered;
  x(plan_.place) = b;
  for (std::size_t k = 0; k < plan_.nodes.size(); ++k) {
    const Elimination::Node& node = plan_.nodes[k];
    auto own = x.segment(node.begin, node.columns);
    blocks_[k].topRows(node.columns).triangularView<Eigen::Lower>().solveInPlace(own);
    gathered.noalias() = blocks_[k].bottomRows(std::ssize(node.rows)) * own;
    for (std::size_t i = 0; i < node.rows.size(); ++i) x[node.rows[i]] -= gathered[static_cast<Eigen::Index>(i)];
  }
  for (std::size_t k = plan_.nodes.size(); k-- > 0;) {
    const Elimination::Node& node = plan_.nodes[k];
    auto own = x.segment(node.begin, node.columns);
    gathered = x(node.rows);
    own.noalias() -= blocks_[k].bottomRows(std::ssize(node.rows)).transpose() * gathered;
    blocks_[k].topRows(node.columns).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
  }
  return x(plan_.place);
}

}  // namespace exmat::precompute
