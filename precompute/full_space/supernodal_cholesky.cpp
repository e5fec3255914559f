#include "precompute/full_space/supernodal_cholesky.h"

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <algorithm>
#include <numeric>
#include <utility>

namespace exmat::precompute {
namespace {

using Index = std::int32_t;

// Of a block of so many columns, the share of zeros up to which a node joins its parent.
double most_zeros(Index columns) { return columns <= 4 ? 1 : columns <= 16 ? 0.5 : columns <= 48 ? 0.1 : 0.05; }

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// The rows of both, ascending, from `first` on.
std::vector<Index> merged(const std::vector<Index>& a, const std::vector<Index>& b, Index first) {
  std::vector<Index> all;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
  all.erase(all.begin(), std::lower_bound(all.begin(), all.end(), first));
  return all;
}

// Liu's algorithm with path compression.
std::vector<Index> elimination_tree(const std::vector<std::vector<Index>>& upper) {
  std::vector<Index> parent(upper.size(), -1), ancestor(upper.size(), -1);
  for (std::size_t j = 0; j < upper.size(); ++j)
    for (Index i : upper[j])
      while (i >= 0 && i < static_cast<Index>(j)) {
        const Index next = ancestor[at(i)];
        ancestor[at(i)] = static_cast<Index>(j);
        if (next < 0) parent[at(i)] = static_cast<Index>(j);
        i = next;
      }
  return parent;
}

// Each subtree in one piece, children before parents: the new number of each column.
std::vector<Index> postorder(const std::vector<Index>& parent) {
  const auto size = static_cast<Index>(parent.size());
  std::vector<Index> first(parent.size(), -1), next(parent.size(), -1), number(parent.size()), stack;
  for (Index j = size; j-- > 0;)
    if (parent[at(j)] >= 0) {
      next[at(j)] = first[at(parent[at(j)])];
      first[at(parent[at(j)])] = j;
    }
  Index count = 0;
  for (Index root = 0; root < size; ++root) {
    if (parent[at(root)] >= 0) continue;
    stack.push_back(root);
    while (!stack.empty()) {
      const Index j = stack.back();
      if (const Index child = first[at(j)]; child >= 0) {
        first[at(j)] = next[at(child)];
        stack.push_back(child);
        continue;
      }
      stack.pop_back();
      number[at(j)] = count++;
    }
  }
  return number;
}

// Rows above the diagonal of each column of the reordered matrix, whose lower triangle has the pattern.
std::vector<std::vector<Index>> upper_rows(const SupernodalCholesky::Matrix& pattern, const std::vector<Index>& place) {
  std::vector<std::vector<Index>> rows(place.size());
  for (Index column = 0; column < pattern.outerSize(); ++column)
    for (SupernodalCholesky::Matrix::InnerIterator entry(pattern, column); entry; ++entry) {
      const auto [low, high] = std::minmax(place[at(static_cast<Index>(entry.row()))], place[at(column)]);
      if (low < high) rows[at(high)].push_back(low);
    }
  return rows;
}

}  // namespace

SupernodalCholesky::SupernodalCholesky(const Matrix& pattern) : size_(pattern.rows()) {
  order(pattern);
  find_nodes();
  merge_nodes();
  place_entries(pattern);
  position_.assign(at(static_cast<Index>(size_)), 0);
}

void SupernodalCholesky::order(const Matrix& pattern) {
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  const Matrix symmetric = pattern.selfadjointView<Eigen::Lower>();
  Eigen::AMDOrdering<int>()(symmetric, permutation);  // row k of the result is row indices()[k]
  place_.resize(at(static_cast<Index>(size_)));
  for (Index k = 0; k < static_cast<Index>(size_); ++k) place_[at(permutation.indices()[k])] = k;
  const std::vector<Index> number = postorder(elimination_tree(upper_rows(pattern, place_)));
  for (Index& place : place_) place = number[at(place)];
  upper_ = upper_rows(pattern, place_);
  parent_ = elimination_tree(upper_);
}

// Columns that follow each other in the tree and have the same rows; the rows of each node.
void SupernodalCholesky::find_nodes() {
  std::vector<std::vector<Index>> lower(at(static_cast<Index>(size_)));  // rows of the matrix, below the diagonal
  for (Index column = 0; column < static_cast<Index>(size_); ++column)
    for (const Index row : upper_[at(column)]) lower[at(row)].push_back(column);
  upper_.clear();
  std::vector<std::vector<Index>> pending(at(static_cast<Index>(size_)));  // nodes whose parent begins there
  std::vector<Index> node_of(at(static_cast<Index>(size_)));
  for (Index column = 0; column < static_cast<Index>(size_); ++column) {
    std::vector<Index> rows = std::move(lower[at(column)]);  // ascending
    for (const Index child : pending[at(column)]) rows = merged(rows, nodes_[at(child)].rows, column + 1);
    const bool follows = column > 0 && parent_[at(column - 1)] == column &&
                         nodes_[at(node_of[at(column - 1)])].rows.size() == rows.size() + 1;
    if (follows) {
      Node& node = nodes_[at(node_of[at(column - 1)])];
      std::erase(pending[at(column)], node_of[at(column - 1)]);
      node.children.insert(node.children.end(), pending[at(column)].begin(), pending[at(column)].end());
      ++node.columns;
      node.rows = std::move(rows);
    } else {
      nodes_.push_back({column, 1, std::move(rows), pending[at(column)]});
    }
    node_of[at(column)] = follows ? node_of[at(column - 1)] : static_cast<Index>(nodes_.size()) - 1;
    if (const Index parent = parent_[at(column)]; parent >= 0) pending[at(parent)].push_back(node_of[at(column)]);
  }
}

// Into the parent that follows it.
void SupernodalCholesky::merge_nodes() {
  std::vector<Node> kept;
  std::vector<Index> now(nodes_.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node node = std::move(nodes_[i]);
    for (Index& child : node.children) child = now[at(child)];
    while (!kept.empty() &&
           std::ranges::find(node.children, static_cast<Index>(kept.size()) - 1) != node.children.end()) {
      const Node& last = kept.back();
      const auto height = static_cast<std::int64_t>(last.columns + node.columns) + std::ssize(node.rows);
      const Index columns = last.columns + node.columns;
      const std::int64_t zeros =
          last.zeros + node.zeros + last.columns * (height - last.columns - std::ssize(last.rows));
      if (static_cast<double>(zeros) > most_zeros(columns) * static_cast<double>(height * columns)) break;
      std::erase(node.children, static_cast<Index>(kept.size()) - 1);
      node.children.insert(node.children.end(), last.children.begin(), last.children.end());
      node.begin = last.begin;
      node.columns = columns;
      node.zeros = zeros;
      kept.pop_back();
    }
    now[i] = static_cast<Index>(kept.size());
    kept.push_back(std::move(node));
  }
  nodes_ = std::move(kept);
  for (Node& node : nodes_) {
    std::ranges::sort(node.children);
    const auto height = static_cast<double>(node.columns) + static_cast<double>(node.rows.size());
    node.block.resize(node.columns + std::ssize(node.rows), node.columns);
    entries_ += node.block.size();
    for (Index c = 0; c < node.columns; ++c) operations_ += (height - c) * (height - c);
  }
}

void SupernodalCholesky::place_entries(const Matrix& pattern) {
  std::vector<Index> node_of(at(static_cast<Index>(size_)));
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    for (Index c = 0; c < nodes_[i].columns; ++c) node_of[at(nodes_[i].begin + c)] = static_cast<Index>(i);
  for (Index column = 0; column < pattern.outerSize(); ++column)
    for (Matrix::InnerIterator entry(pattern, column); entry; ++entry) {
      const auto [low, high] = std::minmax(place_[at(static_cast<Index>(entry.row()))], place_[at(column)]);
      nodes_[at(node_of[at(low)])].values.push_back(static_cast<Index>(entry_.size()));
      entry_.push_back({high, low});
    }
}

// The front of a node: its columns, what children and matrix add to them, and what it leaves for its parent.
bool SupernodalCholesky::eliminate(std::size_t index, const Matrix& matrix, std::vector<Eigen::MatrixXd>& updates) {
  Node& node = nodes_[index];
  const Eigen::Index columns = node.columns, below = std::ssize(node.rows);
  for (Index c = 0; c < node.columns; ++c) position_[at(node.begin + c)] = c;
  for (std::size_t i = 0; i < node.rows.size(); ++i) position_[at(node.rows[i])] = node.columns + static_cast<Index>(i);
  node.block.setZero();
  Eigen::MatrixXd& rest = updates[index];
  rest.setZero(below, below);
  for (const Index value : node.values) {
    const Entry& entry = entry_[at(value)];
    node.block(position_[at(entry.row)], position_[at(entry.column)]) += matrix.valuePtr()[value];
  }
  for (const Index child : node.children) {
    const std::vector<Index>& rows = nodes_[at(child)].rows;
    Eigen::MatrixXd& update = updates[at(child)];
    for (std::size_t j = 0; j < rows.size(); ++j) {
      const Index column = position_[at(rows[j])];
      double* into =
          column < node.columns ? node.block.col(column).data() : rest.col(column - columns).data() - columns;
      const double* from = update.col(static_cast<Eigen::Index>(j)).data();
      for (std::size_t i = j; i < rows.size(); ++i) into[position_[at(rows[i])]] += from[i];
    }
    update.resize(0, 0);
  }
  auto diagonal = node.block.topRows(columns);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(diagonal);
  if (factor.info() != Eigen::Success) return false;
  auto lower = node.block.bottomRows(below);
  diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(lower);
  rest.selfadjointView<Eigen::Lower>().rankUpdate(lower, -1);
  return true;
}

bool SupernodalCholesky::factorise(const Matrix& matrix) {
  std::vector<Eigen::MatrixXd> updates(nodes_.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    if (!eliminate(i, matrix, updates)) return false;
  return true;
}

Eigen::VectorXd SupernodalCholesky::solve(const Eigen::VectorXd& b) const {
  Eigen::VectorXd x(size_), gathered;
  x(place_) = b;
  for (const Node& node : nodes_) {
    auto own = x.segment(node.begin, node.columns);
    node.block.topRows(node.columns).triangularView<Eigen::Lower>().solveInPlace(own);
    gathered.noalias() = node.block.bottomRows(std::ssize(node.rows)) * own;
    for (std::size_t i = 0; i < node.rows.size(); ++i) x[node.rows[i]] -= gathered[static_cast<Eigen::Index>(i)];
  }
  for (auto node = nodes_.rbegin(); node != nodes_.rend(); ++node) {
    auto own = x.segment(node->begin, node->columns);
    gathered = x(node->rows);
    own.noalias() -= node->block.bottomRows(std::ssize(node->rows)).transpose() * gathered;
    node->block.topRows(node->columns).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
  }
  return x(place_);
}

}  // namespace exmat::precompute
