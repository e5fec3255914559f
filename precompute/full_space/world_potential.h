#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "precompute/full_space/full_space_step.h"
#include "precompute/full_space/sparse_potential.h"
#include "precompute/full_space/surface_contacts.h"

namespace exmat::precompute {

/// One of the bodies of a WorldPotential.
struct SteppedBody {
  const FullSpaceModel* model = nullptr;
  const FullSpaceState* state = nullptr;
  FullSpaceStep* step = nullptr;  ///< after begin()
};

/// The contacts of the vertices of one of them with the surface of another, by their places among the bodies.
struct DirectedContacts {
  std::size_t a = 0, b = 0;
  std::unique_ptr<SurfaceContacts> contacts;
};

/// Potential that one step of touching bodies minimises in the changes d of all of them: the sum of their own
/// potentials and that of the contacts between them. Its sparse Hessian has a block for each body; what couples them is
/// in the product alone.
class WorldPotential : public SparsePotential {
 public:
  WorldPotential(std::vector<SteppedBody> bodies, std::vector<DirectedContacts>& contacts);

  /// Pattern of the Hessian of bodies of these models.
  static LowerTriangle pattern(const std::vector<SteppedBody>& bodies);

  Eigen::VectorXd start() const;  ///< the d of the bodies
  void take(const Eigen::VectorXd& d);
  /// Elasticity at d, for evaluate_first().
  void restart(const Eigen::VectorXd& d);
  double refresh_friction();  ///< relative change

  runtime::PotentialEvaluation evaluate_first(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) override;
  runtime::PotentialEvaluation evaluate(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) override;
  runtime::PotentialValue value(const Eigen::VectorXd& d) const override;
  void accept(runtime::PotentialEvaluation& evaluation) override;
  void assemble(const Eigen::VectorXd& d, runtime::Tangent tangent) override;
  LowerTriangle& hessian() override { return hessian_; }
  Eigen::VectorXd product(const Eigen::VectorXd& x) const override;

 private:
  Eigen::VectorXd part(std::size_t body, const Eigen::VectorXd& x) const {
    return x.segment(offsets_[body], sizes_[body]);
  }
  std::vector<VertexArray> positions(const Eigen::VectorXd& d) const;
  runtime::PotentialEvaluation evaluate_all(const Eigen::VectorXd& d, bool is_first, Eigen::VectorXd& gradient);
  /// Index of the x of a vertex among all unknowns; negative: it is fixed.
  Eigen::Index unknown(std::size_t body, std::int32_t vertex) const {
    return unknowns_[body][static_cast<std::size_t>(vertex)];
  }
  void add_block(std::size_t body, std::int32_t row, std::int32_t column, const Eigen::Matrix3d& block);

  std::vector<SteppedBody> bodies_;
  std::vector<DirectedContacts>& contacts_;
  std::vector<Eigen::Index> offsets_, sizes_;
  std::vector<std::vector<Eigen::Index>> unknowns_;  // of each body's vertices
  double reach_ = 0;                                 // of the largest coordinates [m]
  LowerTriangle hessian_;
  std::vector<std::vector<SurfaceContacts::Stiffness>> coupling_;  // of the contacts
};

}  // namespace exmat::precompute
