#include "precompute/full_space/world_potential.h"

#include <algorithm>
#include <cmath>

namespace exmat::precompute {

using runtime::PotentialEvaluation;
using runtime::PotentialValue;

WorldPotential::WorldPotential(std::vector<SteppedBody> bodies, std::vector<DirectedContacts>& contacts)
    : bodies_(std::move(bodies)), contacts_(contacts), hessian_(pattern(bodies_)), coupling_(contacts.size()) {
  Eigen::Index size = 0;
  for (const SteppedBody& body : bodies_) {
    offsets_.push_back(size);
    sizes_.push_back(body.model->size());
    auto& unknowns = unknowns_.emplace_back(static_cast<std::size_t>(body.model->rest.rows()), -1);
    const auto& free_dofs = body.model->system.free_dofs;
    for (std::size_t i = 0; i < free_dofs.size(); i += 3)
      unknowns[static_cast<std::size_t>(free_dofs[i] / 3)] = size + static_cast<Eigen::Index>(i);
    size += body.model->size();
    reach_ = std::max(reach_, world_positions(*body.model, *body.state).cwiseAbs().maxCoeff());
  }
}

LowerTriangle WorldPotential::pattern(const std::vector<SteppedBody>& bodies) {
  Eigen::Index size = 0, entries = 0;
  for (const SteppedBody& body : bodies) {
    size += body.model->size();
    entries += body.model->elasticity.pattern().nonZeros();
  }
  LowerTriangle all(size, size);
  all.reserve(entries);
  Eigen::Index offset = 0;
  for (const SteppedBody& body : bodies) {
    const LowerTriangle& own = body.model->elasticity.pattern();
    for (Eigen::Index column = 0; column < own.cols(); ++column) {
      all.startVec(offset + column);
      for (LowerTriangle::InnerIterator entry(own, column); entry; ++entry)
        all.insertBack(offset + entry.row(), offset + column) = 0;
    }
    offset += body.model->size();
  }
  all.finalize();
  return all;
}

Eigen::VectorXd WorldPotential::start() const {
  Eigen::VectorXd d(hessian_.rows());
  for (std::size_t i = 0; i < bodies_.size(); ++i) d.segment(offsets_[i], sizes_[i]) = bodies_[i].step->d();
  return d;
}

void WorldPotential::take(const Eigen::VectorXd& d) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].step->d() = part(i, d);
}

void WorldPotential::restart(const Eigen::VectorXd& d) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].step->potential().start(part(i, d));
}

double WorldPotential::refresh_friction() {
  runtime::FrictionChange change;
  for (const SteppedBody& body : bodies_) body.step->refresh_friction(change);
  for (DirectedContacts& directed : contacts_) directed.contacts->refresh_friction(change);
  return change.relative();
}

std::vector<VertexArray> WorldPotential::positions(const Eigen::VectorXd& d) const {
  std::vector<VertexArray> positions;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Eigen::VectorXd displacement = bodies_[i].model->system.extend(bodies_[i].state->q + part(i, d));
    positions.push_back(bodies_[i].model->rest +
                        displacement.reshaped<Eigen::RowMajor>(bodies_[i].model->rest.rows(), 3));
  }
  return positions;
}

PotentialEvaluation WorldPotential::evaluate_all(const Eigen::VectorXd& d, bool is_first, Eigen::VectorXd& gradient) {
  const std::vector<VertexArray> places = positions(d);
  std::vector<VertexArray> forces;
  for (const VertexArray& place : places) forces.push_back(VertexArray::Zero(place.rows(), 3));
  PotentialEvaluation sum;
  for (DirectedContacts& directed : contacts_) {
    const double potential =
        directed.contacts->evaluate(places[directed.a], places[directed.b], forces[directed.a], forces[directed.b]);
    sum.potential.value += potential;
    sum.potential.magnitude += potential;
  }
  gradient.resize(d.size());
  double squares = 0;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    StepPotential& own = bodies_[i].step->potential();
    Eigen::VectorXd of_body;
    const Eigen::VectorXd d_i = part(i, d);
    const PotentialEvaluation evaluation = is_first ? own.evaluate_first(d_i, of_body) : own.evaluate(d_i, of_body);
    const Eigen::VectorXd force =
        bodies_[i].model->system.restrict(Eigen::VectorXd(forces[i].reshaped<Eigen::RowMajor>()));
    gradient.segment(offsets_[i], sizes_[i]) = of_body - force;
    sum.potential.value += evaluation.potential.value;
    sum.potential.magnitude += evaluation.potential.magnitude + reach_ * force.lpNorm<1>();
    squares += std::pow(evaluation.force_scale + force.norm(), 2);
  }
  sum.force_scale = std::sqrt(squares);
  return sum;
}

PotentialEvaluation WorldPotential::evaluate_first(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) {
  return evaluate_all(d, /*is_first=*/true, gradient);
}

PotentialEvaluation WorldPotential::evaluate(const Eigen::VectorXd& d, Eigen::VectorXd& gradient) {
  return evaluate_all(d, /*is_first=*/false, gradient);
}

PotentialValue WorldPotential::value(const Eigen::VectorXd& d) const {
  PotentialValue sum;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const PotentialValue own = bodies_[i].step->potential().value(part(i, d));
    sum.value += own.value;
    sum.magnitude += own.magnitude;
  }
  const std::vector<VertexArray> places = positions(d);
  for (const DirectedContacts& directed : contacts_) {
    const double potential = directed.contacts->potential(places[directed.a], places[directed.b]);
    sum.value += potential;
    sum.magnitude += potential;
  }
  return sum;
}

void WorldPotential::accept(PotentialEvaluation& evaluation) {
  for (const SteppedBody& body : bodies_) body.step->potential().accept(evaluation);
}

void WorldPotential::add_block(std::size_t body, std::int32_t row, std::int32_t column, const Eigen::Matrix3d& block) {
  const Eigen::Index i = unknown(body, row), k = unknown(body, column);
  if (i < k || k < 0) return;  // the lower triangle alone
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < (i == k ? r + 1 : 3); ++c) hessian_.coeffRef(i + r, k + c) += block(r, c);
}

void WorldPotential::assemble(const Eigen::VectorXd& d, runtime::Tangent tangent) {
  Eigen::Index entries = 0;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    StepPotential& own = bodies_[i].step->potential();
    own.assemble(part(i, d), tangent);
    hessian_.coeffs().segment(entries, own.hessian().nonZeros()) = own.hessian().coeffs();
    entries += own.hessian().nonZeros();
  }
  for (std::size_t p = 0; p < contacts_.size(); ++p) {
    coupling_[p] = contacts_[p].contacts->stiffness();
    for (const SurfaceContacts::Stiffness& part : coupling_[p]) {
      add_block(contacts_[p].a, part.vertex, part.vertex, part.matrix);
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c)
          add_block(
              contacts_[p].b, part.corners[r], part.corners[c],
              part.shares[static_cast<Eigen::Index>(r)] * part.shares[static_cast<Eigen::Index>(c)] * part.matrix);
    }
  }
}

Eigen::VectorXd WorldPotential::product(const Eigen::VectorXd& x) const {
  Eigen::VectorXd result = hessian_.selfadjointView<Eigen::Lower>() * x;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Eigen::VectorXd filtered = bodies_[i].step->potential().filter_product(part(i, x));
    if (filtered.size() > 0) result.segment(offsets_[i], sizes_[i]) += filtered;
  }
  for (std::size_t p = 0; p < contacts_.size(); ++p)
    for (const SurfaceContacts::Stiffness& part : coupling_[p]) {
      const Eigen::Index vertex = unknown(contacts_[p].a, part.vertex);
      for (std::size_t c = 0; c < 3; ++c) {
        const Eigen::Index corner = unknown(contacts_[p].b, part.corners[c]);
        const double share = part.shares[static_cast<Eigen::Index>(c)];
        if (vertex < 0 || corner < 0 || share == 0) continue;
        result.segment<3>(vertex) -= share * (part.matrix * x.segment<3>(corner));
        result.segment<3>(corner) -= share * (part.matrix * x.segment<3>(vertex));
      }
    }
  return result;
}

}  // namespace exmat::precompute
