#include "runtime/sim/contact/own_search.h"

#include <algorithm>

namespace exmat::runtime {
namespace {

using Box = double[6];

void set_box(const VertexArray& points, int row, Box& box) {
  for (int axis = 0; axis < 3; ++axis) box[axis] = box[3 + axis] = points(row, axis);
}
void extend(const Box& by, Box& box) {
  for (int axis = 0; axis < 3; ++axis) {
    box[axis] = std::min(box[axis], by[axis]);
    box[3 + axis] = std::max(box[3 + axis], by[3 + axis]);
  }
}
void extend(const LeafQuery& by, LeafQuery& query) {
  extend(by.places, query.places);
  extend(by.velocities, query.velocities);
  extend(by.rest, query.rest);
}

}  // namespace

void OwnSearch::place(const ContactSet& set, const BodySurface& surface, const std::vector<SurfaceHit>& places,
                      SurfaceShape& shape) {
  surface.place_all(shape);
  points_.resize(set.vertices(), 3);
  velocities_.setZero(set.vertices(), 3);
  chosen_.resize(static_cast<std::size_t>(set.vertices()));
  for (int i = 0; i < set.vertices(); ++i) {
    const SurfaceHit& place = places[static_cast<std::size_t>(i)];
    const int vertex = place.distance == 0 ? surface.vertex_at(place) : -1;
    if (vertex >= 0) {
      points_.row(i) = shape.positions.row(vertex);
      if (shape.moves) velocities_.row(i) = shape.velocities.row(vertex);
    } else {
      points_.row(i) = set.place(i, shape.x);
      if (shape.moves) velocities_.row(i) = surface.velocity_of(place, shape);
    }
  }
}

LeafQuery OwnSearch::query_of(const ContactSet& set, int vertex) const noexcept {
  LeafQuery query = reach_;
  set_box(points_, vertex, query.places);
  set_box(velocities_, vertex, query.velocities);
  set_box(set.rest(), vertex, query.rest);
  return query;
}

std::ptrdiff_t OwnSearch::keep(const BodySurface& surface, const SurfaceShape& shape, const LeafQuery& query,
                               std::ptrdiff_t first, std::ptrdiff_t count) {
  const std::ptrdiff_t end = first + count;
  if (std::ssize(panels_) < end + count) panels_.resize(static_cast<std::size_t>(end + count));
  return surface.near_leaves(query, panels_.data() + first, count, shape, panels_.data() + end);
}

/// Boxes of all branches, of the chosen vertices alone.
void OwnSearch::begin(const ContactSet& set, const BodySurface& surface) {
  const std::vector<LeafPanel>& all = surface.all_leaves();
  if (panels_.size() < all.size()) panels_.resize(all.size());
  std::ranges::copy(all, panels_.begin());
  const DeformationTree& tree = set.tree();
  queries_.resize(tree.nodes().size());
  has_chosen_.assign(tree.nodes().size(), 0);
  for (int node = static_cast<int>(tree.nodes().size()) - 1; node >= 0; --node) {
    const auto at = static_cast<std::size_t>(node);
    const auto add = [&](const LeafQuery& query) {
      if (has_chosen_[at])
        extend(query, queries_[at]);
      else
        queries_[at] = query;
      has_chosen_[at] = 1;
    };
    const DeformationTree::Node& branch = tree.node(node);
    if (branch.is_leaf) {
      for (int vertex = branch.first; vertex < branch.last; ++vertex)
        if (chosen_[static_cast<std::size_t>(vertex)]) add(query_of(set, vertex));
      continue;
    }
    for (const int half : {node + 1, tree.node(node + 1).next})
      if (has_chosen_[static_cast<std::size_t>(half)]) add(queries_[static_cast<std::size_t>(half)]);
  }
}

}  // namespace exmat::runtime
