#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace exmat::precompute {

/// The neighbours of each vertex, one vertex after another; symmetric, no vertex is its own neighbour.
struct Graph {
  std::vector<std::int32_t> starts{0}, neighbours;

  std::int32_t size() const { return static_cast<std::int32_t>(starts.size()) - 1; }
  bool operator==(const Graph&) const = default;
};

/// Plan of the factor L of L L^T for matrices of one pattern: columns of one structure are nodes, whose parts of L are
/// dense. Liu 1992.
struct Elimination {
  struct Node {
    std::int32_t begin = 0, columns = 0;  ///< its columns of L
    std::vector<std::int32_t> rows;       ///< below them, ascending
    std::vector<std::int32_t> children{};
    std::int64_t zeros = 0;  ///< zeros in its part of L
  };

  std::vector<std::int32_t> place;  ///< place of each vertex in L
  std::vector<Node> nodes;          ///< children before parents

  std::int64_t entries() const;  ///< size of L, zeros of the nodes among them
  double operations() const;     ///< cost of a factorisation, a sum of squares by columns of L
};

/// Plan for vertices that are eliminated in the order of their `place`, or in one of the same fill. Vertices stand for
/// `block` rows of the matrix each: small nodes join their parents, by how many rows they have. Numbers in the result
/// are of vertices.
Elimination elimination_of(const Graph& graph, std::vector<std::int32_t> place, int block);

}  // namespace exmat::precompute
