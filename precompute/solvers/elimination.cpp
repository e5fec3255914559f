#include "precompute/solvers/elimination.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace exmat::precompute {
namespace {

using Index = std::int32_t;
using Node = Elimination::Node;

// Share of zeros up to which a node joins its parent, for a part of L of so many columns.
double most_zeros(Index columns) { return columns <= 4 ? 1 : columns <= 16 ? 0.5 : columns <= 48 ? 0.1 : 0.05; }

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

// The rows of both, ascending, from `first` on.
std::vector<Index> merged(const std::vector<Index>& a, const std::vector<Index>& b, Index first) {
  std::vector<Index> all;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
  all.erase(all.begin(), std::lower_bound(all.begin(), all.end(), first));
  return all;
}

// The parent of each column in the elimination tree, -1: none. Liu's algorithm with path compression.
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

// Rows above the diagonal of each column of the reordered matrix.
std::vector<std::vector<Index>> upper_rows(const Graph& graph, const std::vector<Index>& place) {
  std::vector<std::vector<Index>> rows(place.size());
  for (Index vertex = 0; vertex < graph.size(); ++vertex)
    for (Index k = graph.starts[at(vertex)]; k < graph.starts[at(vertex) + 1]; ++k)
      if (const Index other = place[at(graph.neighbours[at(k)])]; other < place[at(vertex)])
        rows[at(place[at(vertex)])].push_back(other);
  return rows;
}

// Columns that follow each other in the tree and have the same rows; the rows of each node. Takes the rows above the
// diagonal.
std::vector<Node> find_nodes(std::vector<std::vector<Index>> upper, const std::vector<Index>& parents) {
  const auto size = static_cast<Index>(upper.size());
  std::vector<Node> nodes;
  std::vector<std::vector<Index>> lower(upper.size());  // rows of the matrix, below the diagonal
  for (Index column = 0; column < size; ++column)
    for (const Index row : upper[at(column)]) lower[at(row)].push_back(column);
  upper.clear();
  std::vector<std::vector<Index>> pending(lower.size());  // nodes whose parent begins there
  std::vector<Index> node_of(lower.size());
  for (Index column = 0; column < size; ++column) {
    std::vector<Index> rows = std::move(lower[at(column)]);  // ascending
    for (const Index child : pending[at(column)]) rows = merged(rows, nodes[at(child)].rows, column + 1);
    const bool follows = column > 0 && parents[at(column - 1)] == column &&
                         nodes[at(node_of[at(column - 1)])].rows.size() == rows.size() + 1;
    if (follows) {
      Node& node = nodes[at(node_of[at(column - 1)])];
      std::erase(pending[at(column)], node_of[at(column - 1)]);
      node.children.insert(node.children.end(), pending[at(column)].begin(), pending[at(column)].end());
      ++node.columns;
      node.rows = std::move(rows);
    } else {
      nodes.push_back({column, 1, std::move(rows), pending[at(column)]});
    }
    node_of[at(column)] = follows ? node_of[at(column - 1)] : static_cast<Index>(nodes.size()) - 1;
    if (const Index parent = parents[at(column)]; parent >= 0) pending[at(parent)].push_back(node_of[at(column)]);
  }
  return nodes;
}

// Into the parent that follows it.
std::vector<Node> merge_nodes(std::vector<Node> nodes, int block) {
  std::vector<Node> kept;
  std::vector<Index> now(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    Node node = std::move(nodes[i]);
    for (Index& child : node.children) child = now[at(child)];
    while (!kept.empty() &&
           std::ranges::find(node.children, static_cast<Index>(kept.size()) - 1) != node.children.end()) {
      const Node& last = kept.back();
      const auto height = static_cast<std::int64_t>(last.columns + node.columns) + std::ssize(node.rows);
      const Index columns = last.columns + node.columns;
      const std::int64_t zeros =
          last.zeros + node.zeros + last.columns * (height - last.columns - std::ssize(last.rows));
      if (static_cast<double>(zeros) > most_zeros(block * columns) * static_cast<double>(height * columns)) break;
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
  for (Node& node : kept) std::ranges::sort(node.children);
  return kept;
}

}  // namespace

std::int64_t Elimination::entries() const {
  std::int64_t sum = 0;
  for (const Node& node : nodes) sum += node.columns * (node.columns + std::ssize(node.rows));
  return sum;
}

double Elimination::operations() const {
  double sum = 0;
  for (const Node& node : nodes) {
    const auto height = static_cast<double>(node.columns) + static_cast<double>(node.rows.size());
    for (Index c = 0; c < node.columns; ++c) sum += (height - c) * (height - c);
  }
  return sum;
}

Elimination elimination_of(const Graph& graph, std::vector<std::int32_t> place, int block) {
  const std::vector<Index> number = postorder(elimination_tree(upper_rows(graph, place)));
  for (Index& own : place) own = number[at(own)];
  std::vector<std::vector<Index>> upper = upper_rows(graph, place);
  const std::vector<Index> parents = elimination_tree(upper);
  std::vector<Node> nodes = merge_nodes(find_nodes(std::move(upper), parents), block);
  return {std::move(place), std::move(nodes)};
}

}  // namespace exmat::precompute
