#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "runtime/sim/contact/body_surface.h"
#include "runtime/sim/contact/contact.h"

namespace exmat::runtime {

/// All vertices of a body against its own surface, as both stand, moving as the shape was placed with: the tree of the
/// vertices is gone down with those leaves of the surface that are left for its branches, kLanes leaves at a time.
class OwnSearch {
 public:
  /// A vertex that parts of the surface may have come near to, in the frame of the body.
  struct Found {
    int vertex = 0;
    Eigen::Vector3d point = Eigen::Vector3d::Zero();     ///< [m]
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< velocity of a shape that moves [m/s]
    std::span<const LeafPanel> leaves;
  };

  /// Before the searches at a pose: places all of the surface of a shape that is placed. The vertices of the set are at
  /// `places` on the surface.
  void place(const ContactSet& set, const BodySurface& surface, const std::vector<SurfaceHit>& places,
             SurfaceShape& shape);

  /// Calls visit(found) for those of the vertices that `wanted`(vertex) chooses, in ascending order. `reach` is without
  /// boxes.
  template <class Wanted, class Visit>
  void search(const ContactSet& set, const BodySurface& surface, const SurfaceShape& shape, const LeafQuery& reach,
              const Wanted& wanted, const Visit& visit) {
    for (std::size_t i = 0; i < chosen_.size(); ++i) chosen_[i] = wanted(static_cast<int>(i)) ? 1 : 0;
    reach_ = reach;
    begin(set, surface);
    descend(set, surface, shape, 0, 0, std::ssize(surface.all_leaves()), visit);
  }

 private:
  void begin(const ContactSet& set, const BodySurface& surface);
  LeafQuery query_of(const ContactSet& set, int vertex) const noexcept;
  std::ptrdiff_t keep(const BodySurface& surface, const SurfaceShape& shape, const LeafQuery& query,
                      std::ptrdiff_t first, std::ptrdiff_t count);

  /// Searches a branch of the vertices' tree; the `count` panels from `first` on are left for the branch that it is of.
  template <class Visit>
  void descend(const ContactSet& set, const BodySurface& surface, const SurfaceShape& shape, int node,
               std::ptrdiff_t first, std::ptrdiff_t count, const Visit& visit) {
    if (!has_chosen_[static_cast<std::size_t>(node)]) return;
    const std::ptrdiff_t own = first + count;
    const std::ptrdiff_t kept = keep(surface, shape, queries_[static_cast<std::size_t>(node)], first, count);
    if (kept == 0) return;
    const DeformationTree& tree = set.tree();
    if (!tree.node(node).is_leaf) {
      descend(set, surface, shape, node + 1, own, kept, visit);
      return descend(set, surface, shape, tree.node(node + 1).next, own, kept, visit);
    }
    for (int vertex = tree.node(node).first; vertex < tree.node(node).last; ++vertex) {
      if (!chosen_[static_cast<std::size_t>(vertex)]) continue;
      const std::ptrdiff_t count_of_vertex = keep(surface, shape, query_of(set, vertex), own, kept);
      if (count_of_vertex == 0) continue;
      visit(Found{vertex,
                  points_.row(vertex),
                  velocities_.row(vertex),
                  {panels_.data() + own + kept, static_cast<std::size_t>(count_of_vertex)}});
    }
  }

  VertexArray points_, velocities_;  // of the vertices, frame of the body [m], [m/s]
  std::vector<char> chosen_;         // vertices
  LeafQuery reach_;                  // but for boxes
  // One for each branch of the vertices' tree.
  std::vector<LeafQuery> queries_;
  std::vector<char> has_chosen_;
  std::vector<LeafPanel> panels_;  // all, then those that are left on the way from the root to a branch
};

}  // namespace exmat::runtime
