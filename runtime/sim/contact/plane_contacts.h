#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/kernels/aligned_array.h"
#include "runtime/kernels/kernels.h"
#include "runtime/sim/contact/contact_law.h"
#include "runtime/sim/contact/vertex_rows.h"
#include "runtime/sim/frame/placement.h"

namespace exmat::runtime {

/// The candidates of a step where all obstacles are planes that stand: kLanes of them at once. Sized once; no call
/// allocates or throws.
class PlaneContacts {
 public:
  /// A body at a pose: x = position + rotation (X + U q).
  struct Body {
    const VertexRows& rows;      ///< U
    const Placement& placement;  ///< position and rotation
    const AlignedArray& q;       ///< padded(r)
  };
  /// Sums of an evaluation, see ContactSums.
  struct Sums {
    Eigen::Vector3d force, torque;
    double potential, stiffness;
    int touching;
  };

  PlaneContacts() = default;
  explicit PlaneContacts(std::size_t most_candidates)
      : panels_((most_candidates + kLanes - 1) / kLanes),
        clearances_(panels_.size()),
        loaded_(panels_.size()),
        coefficients_(panels_.size() * kLanes),
        vertices_(panels_.size() * kLanes) {}

  /// Sets what a step keeps of a candidate `distance` away from its plane where the step begins; its vertex is at
  /// `rest`, frame of the body, and has `friction`, Coulomb's coefficient. One after the other; then end() says how
  /// many they are.
  void set(std::size_t number, const Eigen::Vector3d& rest, double distance, double friction,
           const ContactCandidate& candidate) noexcept;
  void end(std::size_t candidates) noexcept;

  /// Forces at a pose that no vertex is farther than `way` away from at the first one. loads [padded(r)] += U_i^T
  /// rotation^T f_i.
  Sums evaluate(const Body& body, double way, bool is_first, AlignedArray& loads) noexcept;

  /// W alone [J]; leaves the last evaluation as it is. `way` as above, 0 where there was none.
  double potential(const Body& body, double way) const noexcept;

  /// Sets what the last evaluation found of a candidate.
  void take(std::size_t number, ContactCandidate& candidate) const noexcept;

  std::span<const PlaneContactPanel> panels() const noexcept { return std::span(panels_).first(count_); }

  /// Takes lambda of all from the last evaluation.
  void refresh_friction(FrictionChange& change) noexcept;

  /// -df/dx of the last evaluation of a panel as a sum of squares, see Kernels::plane_factors(), and the vertex of
  /// each.
  std::ptrdiff_t factors(std::size_t panel, const Placement& placement, double* vectors, double* rigid,
                         int* vertices) const noexcept;

 private:
  template <class Work>
  void for_near(const Body& body, double way, Work work) const noexcept;

  static std::size_t lane(std::size_t number) noexcept { return number % kLanes; }
  const PlaneContactPanel& panel(std::size_t number) const noexcept { return panels_[number / kLanes]; }
  PlaneContactPanel& panel(std::size_t number) noexcept { return panels_[number / kLanes]; }

  std::vector<PlaneContactPanel> panels_;
  std::vector<double> clearances_;    ///< the least of each panel's, see ContactCandidate
  std::vector<std::uint8_t> loaded_;  ///< one for each panel: a bit for each candidate with a normal force or friction
  std::vector<double> coefficients_;  ///< coefficients of friction
  std::vector<int> vertices_;
  std::size_t count_ = 0;  ///< panels in use
};

}  // namespace exmat::runtime
