#include "precompute/full_space/full_space_world.h"

#include <algorithm>

#include "common/core/timer.h"
#include "precompute/full_space/full_space_step.h"
#include "precompute/full_space/sparse_newton.h"
#include "precompute/full_space/world_potential.h"

namespace exmat::precompute {

using runtime::NewtonReport;
using runtime::NewtonStatus;

struct FullSpaceWorld::Touching {
  std::vector<std::optional<MovingSurface>> surfaces;  // of each body of the world
  std::vector<DirectedContacts> contacts;              // by places among `bodies`
  std::vector<std::size_t> bodies;                     // of the world, ascending
};

void FullSpaceWorld::add(const ReducedModel& data, const FullSpaceModel& model, const FullSpaceScene& scene,
                         FullSpaceState state) {
  bodies_.push_back(std::make_unique<FullSpaceBody>(data, model, scene, std::move(state)));
}

bool FullSpaceWorld::find_contacts(Touching& touching) {
  for (const auto& body : bodies_) touching.surfaces.emplace_back().emplace(*body->data, *body->model, body->state);
  const double dt = bodies_.front()->scene->time_step;
  const auto reach = [&](std::size_t i) {
    return runtime::kContactMarginSteps * dt * touching.surfaces[i]->speed() +
           dt * dt * bodies_[i]->scene->gravity.norm();
  };
  std::vector<bool> touches(count(), false);
  for (std::size_t a = 0; a < count(); ++a)
    for (std::size_t b = 0; b < count(); ++b) {
      const double margin = reach(a) + reach(b);
      if (a == b || touching.surfaces[a]->box().exteriorDistance(touching.surfaces[b]->box()) > margin) continue;
      auto contacts = std::make_unique<SurfaceContacts>(half_, *touching.surfaces[a], *touching.surfaces[b], dt, margin,
                                                        anew_, held_[{a, b}]);
      if (contacts->empty()) continue;
      touches[a] = touches[b] = true;
      touching.contacts.push_back({a, b, std::move(contacts)});
    }
  std::vector<std::size_t> place(count());
  for (std::size_t i = 0; i < count(); ++i) {
    place[i] = touching.bodies.size();
    if (touches[i]) touching.bodies.push_back(i);
  }
  for (DirectedContacts& directed : touching.contacts) {
    directed.a = place[directed.a];
    directed.b = place[directed.b];
  }
  return !touching.bodies.empty();
}

void FullSpaceWorld::solve(Touching& touching, FullSpaceWorldReport& report) {
  std::vector<std::unique_ptr<FullSpaceStep>> steps;
  std::vector<SteppedBody> stepped;
  bool sound = true;
  for (const std::size_t i : touching.bodies) {
    FullSpaceBody& body = *bodies_[i];
    steps.push_back(std::make_unique<FullSpaceStep>(*body.model, *body.scene, body.state, body.workspace));
    sound = steps.back()->begin(/*touches_others=*/true) && sound;
    stepped.push_back({body.model, &body.state, steps.back().get()});
  }
  NewtonReport total;
  if (!sound) total.status = NewtonStatus::kNonFinite;
  if (sound) {
    WorldPotential potential(stepped, touching.contacts);
    if (touching.bodies != solved_ || !direction_) {
      direction_ = std::make_unique<SparseDirection>(WorldPotential::pattern(stepped));
      solved_ = touching.bodies;
    }
    Eigen::VectorXd d = potential.start();
    for (int round = 0; round < runtime::kFrictionRounds; ++round) {
      if (round > 0) potential.restart(d);
      const NewtonReport newton =
          minimise_step(potential, bodies_[touching.bodies.front()]->scene->newton, *direction_, d);
      total.iterations += newton.iterations;
      total.factorisations += newton.factorisations;
      total.projections += newton.projections;
      total.line_search_evaluations += newton.line_search_evaluations;
      total.residual = newton.residual;
      total.status = newton.status;
      if (newton.status == NewtonStatus::kNonFinite || potential.refresh_friction() <= runtime::kSameFriction) break;
    }
    potential.take(d);
  }
  report.newton = total;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    steps[k]->add(total);
    bodies_[touching.bodies[k]]->report = steps[k]->finish(total.status);
  }
}

void FullSpaceWorld::remember(const Touching& touching) {
  held_.clear();
  for (const DirectedContacts& directed : touching.contacts) {
    const std::size_t a = touching.bodies[directed.a], b = touching.bodies[directed.b];
    const FullSpaceBody& other = *bodies_[b];
    const Eigen::Matrix3d rotation =
        other.model->frame ? other.model->frame->place(other.state.q).rotation : Eigen::Matrix3d::Identity();
    held_[{a, b}] = directed.contacts->held(rotation);
  }
}

FullSpaceWorldReport FullSpaceWorld::step() {
  const Timer timer;
  FullSpaceWorldReport report;
  Touching touching;
  if (find_contacts(touching)) solve(touching, report);
  report.touching_bodies = static_cast<int>(touching.bodies.size());
  for (const DirectedContacts& directed : touching.contacts) report.contacts += directed.contacts->touching();
  for (std::size_t i = 0; i < count(); ++i)
    if (!std::ranges::binary_search(touching.bodies, i)) {
      FullSpaceBody& body = *bodies_[i];
      body.report = precompute::step(*body.model, *body.scene, body.state, body.workspace);
    }
  for (const auto& body : bodies_) {
    report.unconverged |= (body->report.status & runtime::kStepUnconverged) != 0;
    report.non_finite |= (body->report.status & runtime::kStepNonFinite) != 0;
  }
  if (!report.non_finite) remember(touching);
  anew_ = false;
  report.seconds = timer.seconds();
  return report;
}

}  // namespace exmat::precompute
