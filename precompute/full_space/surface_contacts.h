#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/full_space/full_space_model.h"
#include "runtime/sim/contact/moving_surface.h"

namespace exmat::precompute {

/// The surface of a body where a step begins, in the frame that fits the body best, as searches of the run time take
/// it.
class MovingSurface {
 public:
  /// `data` with /object and /contact.
  MovingSurface(const ReducedModel& data, const FullSpaceModel& model, const FullSpaceState& state);

  runtime::TouchingBody touching() const { return surface_.touching(); }
  runtime::SurfaceShape& shape() { return surface_.shape(); }

  const runtime::Placement& placement() const { return placement_; }
  const Eigen::AlignedBox3d& box() const { return box_; }  ///< about it, world [m]
  double speed() const { return surface_.speed(); }        ///< speed of its fastest vertex [m/s]
  std::int32_t object_vertex(int vertex) const { return surface_.object_vertex(vertex); }
  std::int32_t corner(int triangle, int c) const { return surface_.object_corner(triangle, c); }

 private:
  runtime::Placement placement_;
  runtime::MovingSurface surface_;
  Eigen::AlignedBox3d box_;
};

/// Memory of the vertices that are inside another body.
using HeldVertices = std::vector<runtime::HeldBodyContact>;

/// Contact of the vertices of one body, a, with the surface of another, b, in one step: candidates, normals and nearest
/// material points as the run time finds them where the step begins, the law of contact_law.h. Positions are those of
/// all vertices [n x 3], world.
class SurfaceContacts {
 public:
  /// `law` of one direction, as runtime::BodyContact has it. `margin`: how far away a vertex may be and yet touch [m].
  SurfaceContacts(const runtime::ContactLaw& law, MovingSurface& a, MovingSurface& b, double time_step, double margin,
                  bool anew, const HeldVertices& held);

  bool empty() const { return candidates_.all.empty(); }

  /// Adds forces [n x 3] to those of either body. Returns W [J].
  double evaluate(const VertexArray& a, const VertexArray& b, VertexArray& force_a, VertexArray& force_b);
  /// W alone; leaves the last evaluation as it is.
  double potential(const VertexArray& a, const VertexArray& b) const;

  void refresh_friction(runtime::FrictionChange& change);

  /// A part of -df/dx of the last evaluation: the positive semi-definite `matrix` acts on how `vertex` moves against
  /// the sum of the shares of how the corners move.
  struct Stiffness {
    std::int32_t vertex = 0;                ///< vertex of a
    std::array<std::int32_t, 3> corners{};  ///< corners of b
    Eigen::Vector3d shares = Eigen::Vector3d::Zero();
    Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();  ///< [N/m]
  };
  std::vector<Stiffness> stiffness() const;

  /// Data of the last evaluation that the next step needs; `rotation_b` of the frame of b at the end.
  HeldVertices held(const Eigen::Matrix3d& rotation_b) const;
  int touching() const;

 private:
  struct Place {
    std::int32_t vertex = 0;
    std::array<std::int32_t, 3> corners{};
    Eigen::Vector3d shares = Eigen::Vector3d::Zero();
  };
  Eigen::Vector3d between(std::size_t index, const VertexArray& a, const VertexArray& b) const;

  runtime::BodyContact contact_;
  const MovingSurface& a_;
  const MovingSurface& b_;
  runtime::BodyCandidates candidates_;
  std::vector<Place> places_;  // of the candidates
};

}  // namespace exmat::precompute
