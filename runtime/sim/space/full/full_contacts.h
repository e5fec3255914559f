#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "runtime/sim/contact/contact.h"
#include "runtime/sim/space/full/full_space.h"

namespace exmat::runtime {

/// Scratch of the contacts of one step, sized once: their stiffness as conjugate gradients take it.
struct FullContactScratch {
  FullContactScratch() = default;
  explicit FullContactScratch(Eigen::Index vertices) : blocks(static_cast<std::size_t>(vertices)) {
    block_of.assign(blocks.size(), -1);
  }

  /// Stiffness at a vertex that something pushes or rubs.
  struct Block {
    Eigen::Index place = 0;     ///< in fields
    Eigen::Matrix3f stiffness;  ///< -df/dx of obstacles [N/m]
    Eigen::Matrix3f pushed;     ///< the same of all that pushes it
    Eigen::Matrix3f scale;      ///< (I + z K)^-1/2, K of all, z of the inverse of what is preconditioned there
  };
  std::vector<Block> blocks;  ///< the first block_count
  std::size_t block_count = 0;
  std::vector<std::int32_t> block_of;  ///< block of each place, -1: none

  void clear() noexcept;
  /// That of a vertex that moves, zero where it is a new one.
  Block& at(Eigen::Index place) noexcept;
  /// `inverse_diagonal` [n] as FullPreconditioner has it.
  void set_scales(const Eigen::VectorXd& inverse_diagonal) noexcept;
};

/// Contact of a body in full space with obstacles: ContactSet in all vertices, by the same law and with the same
/// scratch and memory. One step: gather and freeze in begin(), then evaluate() and add_blocks() as often as needed,
/// then commit(). Displacements u are fields of FullSpace. Immutable; no call but the constructor allocates.
class FullContacts {
 public:
  /// `origin` of the set's rest positions, world [m].
  FullContacts(const ContactSet& set, const FullSpace& space, const Eigen::Vector3d& origin);
  /// The vertices in the order of the data.
  FullContacts(const ContactData& data, const FullSpace& space);

  Eigen::Index vertices() const { return areas_.size(); }

  /// Candidates of a step from the displacement u with the velocity v, in which other bodies push a vertex `pushed` [m]
  /// far at most; false where there are none.
  bool begin(const Obstacles& obstacles, double end_time, double time_step, const Eigen::Vector3d& gravity,
             double pushed, const double* u, const double* v, const ContactState& held,
             ContactWorkspace& contact) const noexcept;

  /// Their forces at u, subtracted from `gradient`; sums without the generalised force are in `contact`, the torque
  /// about the world's origin. Returns the norm of the forces [N].
  double evaluate(const double* u, ContactWorkspace& contact, double* gradient) const noexcept;

  /// Adds the stiffness of the last evaluation, without scales.
  void add_blocks(const ContactWorkspace& contact, FullContactScratch& scratch) const noexcept;

  /// Writes the contacts of the last evaluation, anchors moved where they slid, the body at u.
  void commit(const double* u, const ContactWorkspace& contact, ContactState& held) const noexcept;

 private:
  Eigen::Vector3d point(int vertex, const double* u) const noexcept {
    return rest_.row(vertex).transpose() + at(vertex, u);
  }
  /// Entry of a vertex in a field.
  Eigen::Map<const Eigen::Vector3d> at(int vertex, const double* field) const noexcept {
    return Eigen::Map<const Eigen::Vector3d>(field + 4 * places_[static_cast<std::size_t>(vertex)]);
  }

  VertexArray rest_;                                       // k x 3, world [m]
  Eigen::VectorXd areas_;                                  // k
  double load_ = std::numeric_limits<double>::infinity();  // [kg/m^2]
  std::vector<Eigen::Index> places_;                       // of the set's vertices, in fields
};

}  // namespace exmat::runtime
