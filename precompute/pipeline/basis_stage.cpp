#include "precompute/pipeline/basis_stage.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <utility>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/geometry.h"
#include "precompute/contact/contact_vertices.h"
#include "precompute/cubature/cubature.h"
#include "precompute/fem/rigid_moments.h"
#include "precompute/modes/basis.h"
#include "precompute/pipeline/target_elasticity_stage.h"

namespace exmat::precompute {
namespace {

constexpr int kSizes[] = {6, 10, 15, 20, 30, 42, 60, 85, 120};  // that basis.tolerance tries

ModalData modal_data(const ElasticSystem& system, const LinearModes& modes, RowMatrix basis) {
  ModalData modal;
  modal.frequencies = modes.eigenvalues.cwiseSqrt() / (2 * std::numbers::pi);
  modal.gravity_load = system.unit_weights().transpose() * basis;
  modal.basis = std::move(basis);
  return modal;
}

// The run of the scene's own loads, which comes first, counts as much as all others together.
Eigen::MatrixXd balanced_snapshots(const BodyStages& stages, const Motions& motions) {
  Eigen::MatrixXd snapshots = motions.set.runs.snapshots;
  const Eigen::Index own = motions.own_columns(), others = snapshots.cols() - own;
  const auto size = [&](const auto& columns) { return columns.cwiseProduct(stages.system.mass * columns).sum(); };
  const double own_size = size(snapshots.leftCols(own)), other_size = size(snapshots.rightCols(others));
  if (own_size > 0 && other_size > 0) snapshots.leftCols(own) *= std::sqrt(other_size / own_size);
  return snapshots;
}

class BasisChooser {
 public:
  BasisChooser(const BodyStages& stages, const ReducedModel& body, const Motions* motions)
      : stages_(stages), body_(body), motions_(motions) {
    if (stages.fitter != nullptr && stages.asset.example_fields) fields_ = stages.fitter->fields();
  }

  BasisChoice choose() const;

 private:
  BasisChoice choose(int size) const;
  RollOut run(const Eigen::MatrixXd& basis) const;

  const BodyStages& stages_;
  const ReducedModel& body_;
  const Motions* motions_;
  Eigen::MatrixXd fields_;
};

// Runs a body with all elements that the motions had.
RollOut BasisChooser::run(const Eigen::MatrixXd& basis) const {
  ReducedModel model;
  model.asset_name = body_.asset_name;
  model.object = body_.object;
  put_basis(stages_, basis, model);
  const ObjectData& object = *model.object;
  const RowMatrix& rows = model.modal->basis;
  return cubature_roll_out(stages_, model,
                           motions_->elements ? with_basis(*motions_->elements, object.mesh, object.materials, rows)
                                              : all_elements(object.mesh, object.materials, rows),
                           *motions_);
}

BasisChoice BasisChooser::choose(int size) const {
  const double body_size = bounding_box_diagonal(stages_.object.mesh.vertices);
  const BasisInput input{stages_.system, stages_.modes, stages_.derivatives, body_size, fields_};
  BasisChoice choice;
  choice.basis = modal_basis(input, size);
  if (motions_ == nullptr) return choice;
  Eigen::MatrixXd trained = trained_basis(input, balanced_snapshots(stages_, *motions_), motions_->general, size,
                                          !stages_.asset.basis_size && !stages_.asset.basis_tolerance);
  choice.modal = run(choice.basis);
  choice.exact = run(trained);
  choice.trained = choice.exact.shape <= choice.modal.shape;
  log::info(fmt::format("basis of {}: error in held-out runs {:.2f} % trained, {:.2f} % of modes", size,
                        100 * choice.exact.shape, 100 * choice.modal.shape));
  if (choice.trained)
    choice.basis = std::move(trained);
  else
    choice.exact = choice.modal;
  return choice;
}

BasisChoice BasisChooser::choose() const {
  const auto& tolerance = stages_.asset.basis_tolerance;
  if (!tolerance) return choose(stages_.asset.basis_size.value_or(basis_size_for(stages_.system, fields_)));
  if (motions_ == nullptr)
    throw InputError({"", "/basis/tolerance", "loads to train on, which the error is measured by", "none",
                      "name a scene by --scene or loads by basis.loads, or give basis.size"});
  double best = 1;
  for (const int size : kSizes) {
    BasisChoice choice = choose(size);
    if (choice.exact.shape <= *tolerance) return choice;
    best = std::min(best, choice.exact.shape);
  }
  throw WorkError(
      fmt::format("basis.tolerance: expected an error of at most {:.3g} in held-out runs, found {:.3g} with "
                  "up to {} modes; raise it, or ask for more basis.training_segments",
                  *tolerance, best, *std::ranges::max_element(kSizes)));
}

}  // namespace

EnergyReference reference_of(const BodyStages& stages) {
  return stages.targets.empty() ? EnergyReference::kExample : stages.targets.front().energy_reference;
}

BasisChoice choose_basis(const BodyStages& stages, const ReducedModel& body, const Motions* motions) {
  return BasisChooser(stages, body, motions).choose();
}

void put_basis(const BodyStages& stages, const Eigen::MatrixXd& basis, ReducedModel& model) {
  model.modal = modal_data(stages.system, stages.modes, stages.system.extend(basis));
  if (stages.fitter != nullptr) stages.fitter->put(stages.targets, model);
}

RollOut cubature_roll_out(const BodyStages& stages, const ReducedModel& model, const CubatureData& cubature,
                          const Motions& motions) {
  ReducedModel body = model;
  const ObjectData& object = *body.object;
  body.cubature = cubature;
  body.cubature->internal_force = ForceMethod::kCubature;
  put_target_elasticity(stages, all_target_elements, body);
  if (!stages.system.constrained())
    body.rigid = rigid_moments(object.mesh, object.materials.density, body.modal->basis);
  if (motions.loads.obstacle)
    body.contact = contact_data(object, body.modal->basis, stages.object.contact, stages.asset.contact_count);
  return final_roll_out(stages, body, motions);
}

RollOut final_roll_out(const BodyStages& stages, const ReducedModel& model, const Motions& motions) {
  const SparseMatrix& mass = stages.system.full_mass;
  return roll_out(model, reference_of(stages), motions.chains.heldout, motions.set.heldout, mass,
                  motions.chains.options);
}

}  // namespace exmat::precompute
