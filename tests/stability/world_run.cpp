#include "tests/stability/world_run.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/core/timer.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/world/world.h"

namespace exmat::precompute {
namespace {

constexpr double kWorldRestTime = 20;     // over the rate of the slowest mode
constexpr double kWorldClearance = 0.02;  // between bodies, and between them and the ground [m]
constexpr double kGroundMass = 200;       // of a body on the area that it lies on [kg/m^2]
constexpr int kShortest = 120;            // steps

class WorldRun {
 public:
  WorldRun(const StabilityCase& test, const StudyBody& body, const StudyBody* carried, int most_steps)
      : test_(test), body_(body), most_steps_(most_steps) {
    make_scene(body, scene_);
    if (carried != nullptr) {
      make_scene(*carried, carried_scene_);
      swing();
    }
    if (test.ground == Ground::kPlane)
      scene_.obstacles.push_back(runtime::Obstacle{runtime::Plane{{0, 0, -kWorldClearance}, Eigen::Vector3d::UnitZ()},
                                                   runtime::RigidMotion(), test.contact_stiffness, damping(),
                                                   test.friction});
    kind_ = kind_of(body, scene_);
    place(carried);
    plan_steps();
  }

  StabilityResult finish();

 private:
  double damping() const { return 2 * std::sqrt(test_.contact_stiffness * kGroundMass); }
  Eigen::Vector3d lengths() const { return body_.reduced.object->mesh.vertices.colwise().maxCoeff(); }
  void make_scene(const StudyBody& body, runtime::StepScene& scene) const;
  runtime::BodyKind kind_of(const StudyBody& body, const runtime::StepScene& scene) const;
  void swing();
  void place(const StudyBody* carried);
  void add_body(const runtime::BodyKind& kind, const runtime::FrameMotion& motion, const Eigen::VectorXd& q);
  void plan_steps();
  double linear_displacement(const runtime::World& world) const;
  double largest(const runtime::World& world, int body) const;
  void judge_all(double linear);
  struct Momenta {
    Eigen::Vector3d linear = Eigen::Vector3d::Zero(), angular = Eigen::Vector3d::Zero();
  };
  Momenta momenta(const runtime::World& world) const;

  const StabilityCase& test_;
  const StudyBody& body_;
  int most_steps_;
  std::int64_t steps_ = 0;
  bool expects_rest_ = false;
  runtime::StepScene scene_, carried_scene_;
  runtime::BodyKind kind_, carried_kind_;
  std::vector<runtime::WorldBodyStart> bodies_;
  StabilityResult result_;
  RunRecord record_;
  double start_displacement_ = 0;
};

void WorldRun::make_scene(const StudyBody& body, runtime::StepScene& scene) const {
  scene.time_step = test_.time_step;
  scene.integrator = test_.integrator;
  scene.mass_damping = 2 * test_.damping * body_.lowest_frequency;
  scene.gravity = Eigen::Vector3d(0, 0, -test_.gravity);
  scene.gravity_force = runtime::gravity_force(*body.model, scene.gravity);
  scene.examples.assign(body.model->examples.size(), test_.examples);
}

runtime::BodyKind WorldRun::kind_of(const StudyBody& body, const runtime::StepScene& scene) const {
  const ObjectData& object = *body.reduced.object;
  auto surface = runtime::BodySurface::of_tets(object.mesh.tets, object.mesh.vertices, body.reduced.modal->basis,
                                               body.model->frame->origin());
  return {body.model.get(), &scene,
          std::make_shared<runtime::TouchingSurface>(*body.model->contact, std::move(surface),
                                                     test_.company == Company::kItself)};
}

/// Beside the body, a quarter turn through where it is, and back again.
void WorldRun::swing() {
  const double time = kLoadSteps * test_.time_step;
  const Eigen::Vector3d there(0, -lengths()[1], 0.5 * lengths()[2]);
  const auto turned = [](double angle) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
  };
  const double start = -0.25 * std::numbers::pi, end = 0.25 * std::numbers::pi;
  carried_scene_.carrier =
      runtime::RigidMotion({{0, there, turned(start)}, {time, there, turned(end)}, {2 * time, there, turned(start)}});
}

void WorldRun::add_body(const runtime::BodyKind& kind, const runtime::FrameMotion& motion, const Eigen::VectorXd& q) {
  runtime::State state = runtime::make_state(*kind.model, q, Eigen::VectorXd::Zero(q.size()));
  runtime::prepare_contacts(*kind.model, kind.scene->obstacles.size(), state);
  if (kind.model == body_.model.get() && test_.body.free) runtime::set_motion(*kind.model, motion, state);
  bodies_.push_back({kind, std::move(state)});
}

void WorldRun::place(const StudyBody* carried) {
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(body_.model->modes());
  const Eigen::Vector3d down(0, 0, -test_.velocity), along(0.5 * test_.velocity, 0, 0);
  const Eigen::Quaterniond across(Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitZ()));
  const double height = lengths()[2] + kWorldClearance;
  switch (test_.company) {
    case Company::kNone:
      break;
    case Company::kPile:
      for (int i = 0; i < 3; ++i)
        add_body(kind_, {{0, 0, i * height}, i == 1 ? across : Eigen::Quaterniond::Identity(), down, {0, 0, 0}}, rest);
      break;
    case Company::kPair: {
      const Eigen::Vector3d aside(lengths()[0] + kWorldClearance, 0.3 * lengths()[1], 0.2 * lengths()[2]);
      add_body(kind_, {{0, 0, 0}, Eigen::Quaterniond::Identity(), along, {0, 0, 0}}, rest);
      add_body(kind_, {aside, Eigen::Quaterniond::Identity(), -along, {0, 0, 0}}, rest);
      break;
    }
    case Company::kCarried:
      carried_kind_ = kind_of(*carried, carried_scene_);
      add_body(kind_, {}, rest);
      add_body(carried_kind_, {}, Eigen::VectorXd::Zero(carried->model->modes()));
      break;
    case Company::kItself:
      add_body(kind_, {}, random_pose(body_.basis(), test_.reach * body_.size));
      break;
  }
}

// Until the slowest mode is at rest, if that is soon enough, where something stops the bodies.
void WorldRun::plan_steps() {
  steps_ = most_steps_;
  double rate = 0.5 * body_.lowest_frequency;
  if (test_.ground != Ground::kNone) {  // a body rocks on the patch where it crosses the next
    const double width = lengths()[1];
    const double rocking =
        width * width / lengths()[0] * std::sqrt(test_.contact_stiffness / body_.reduced.rigid->mass);
    rate = std::min(rate, 0.7 * rocking);
  }
  const double needed = 2 * kLoadSteps + std::max<double>(kShortest, kWorldRestTime / (rate * test_.time_step));
  if (needed > most_steps_) return;
  steps_ = static_cast<std::int64_t>(std::ceil(needed));
  expects_rest_ = (test_.company == Company::kPile && scene_.examples.empty()) ||
                  (test_.company == Company::kItself && !test_.body.free);
}

/// As of one body, which may get the energy of all.
double WorldRun::linear_displacement(const runtime::World& world) const {
  const runtime::Energies energies = world.energies();
  double energy = energies.elastic + energies.kinetic;
  const double mass = body_.reduced.rigid ? body_.reduced.rigid->mass : 0;
  energy += world.count() * mass * test_.gravity * world.count() * (lengths()[2] + kWorldClearance);
  if (test_.company == Company::kCarried) {
    const double speed = 0.5 * std::numbers::pi * body_.size / (kLoadSteps * test_.time_step);
    energy += 2 * mass * speed * speed;  // of the body, thrown at twice the speed of the fastest point
  }
  return body_.reach * (2 * body_.load_norm(scene_.gravity_force) + std::sqrt(2 * energy));
}

double WorldRun::largest(const runtime::World& world, int body) const {
  return largest_displacement(body_.basis(), world.state(body).q);
}

/// Momenta of all free bodies, angular about the origin.
WorldRun::Momenta WorldRun::momenta(const runtime::World& world) const {
  Momenta sum;
  for (int i = 0; i < world.count(); ++i) {
    const runtime::FreeState& body = runtime::free_state(world.state(i));
    const Eigen::Vector3d centre = body_.model->frame->centre_of_mass() + body.position;
    sum.linear += body.linear_momentum;
    sum.angular += body.angular_momentum + centre.cross(body.linear_momentum);
  }
  return sum;
}

StabilityResult WorldRun::finish() {
  runtime::World world(bodies_, {test_.contact_stiffness, damping(), test_.friction});
  const double linear = linear_displacement(world);
  result_.linear_displacement = linear / body_.size;
  record_.start_energy = world.energies().total();
  record_.start_potential = world.energies().potential;
  const bool is_pair = test_.company == Company::kPair;
  const Momenta before = is_pair ? momenta(world) : Momenta();
  const double momentum = is_pair ? 0.5 * test_.velocity * body_.reduced.rigid->mass : 1;
  start_displacement_ = largest(world, 0);
  record_.displacement = start_displacement_ / body_.size;
  record_.peak_kinetic = world.energies().kinetic;
  const Timer timer;
  while (record_.steps < steps_) {
    const runtime::WorldReport report = world.step(1);
    StepFacts facts;
    bool unsolved = report.unconverged_islands > 0;
    for (int i = 0; i < world.count(); ++i) {
      const unsigned status = world.report(i).status;
      if ((status & runtime::kStepNonFinite) != 0) ++facts.non_finite;
      unsolved |= (status & (runtime::kStepIterationLimit | runtime::kStepStagnated)) != 0;
      if (world.model(i).modes() == body_.model->modes())
        facts.displacement = std::max(facts.displacement, largest(world, i) / body_.size);
      result_.projections += world.report(i).projections;
    }
    facts.unsolved = unsolved ? 1 : 0;
    facts.energies = world.energies();
    facts.kinetic = facts.energies.kinetic;
    if (is_pair) {
      const Momenta now = momenta(world);
      facts.momentum_error = std::max((now.linear - before.linear).norm() / momentum,
                                      (now.angular - before.angular).norm() / (momentum * body_.size));
    }
    if (!record_.add(facts)) break;
    const int iterations = std::max(report.newton_iterations, world.report(0).newton_iterations);
    result_.newton_iterations += iterations;
    result_.most_iterations = std::max(result_.most_iterations, iterations);
    result_.factorisations += world.report(0).factorisations;
    result_.line_search_evaluations += world.report(0).line_search_evaluations;
  }
  result_.seconds = timer.seconds();
  result_.steps = record_.steps;
  result_.stagnated_steps = record_.unsolved;
  result_.non_finite_steps = record_.non_finite;
  result_.largest_displacement = record_.displacement;
  judge_all(linear);
  return result_;
}

void WorldRun::judge_all(double linear) {
  Expectation expected{.displacement = displacement_bound(linear / body_.size, start_displacement_ / body_.size),
                       .rest = expects_rest_ && test_.damping > 0,
                       .integrator = test_.integrator};
  if (body_.reduced.examples)
    for (const ExampleData& example : body_.reduced.examples->examples)
      expected.displacement = std::max(
          expected.displacement, displacement_bound(largest_displacement(body_.basis(), example.pose) / body_.size, 0));
  expected.energy =
      test_.company != Company::kCarried && scene_.examples.empty() && test_.integrator != Integrator::kNewmark;
  expected.momentum = test_.company == Company::kPair;
  judge(test_, body_, record_, expected, result_);
}

}  // namespace

BodySpec carried_spec(const StabilityCase& test) {
  BodySpec spec = test.body;
  spec.free = false;
  spec.carried = true;
  return spec;
}

StabilityResult run_world_case(const StabilityCase& test, const StudyBody& body, const StudyBody* carried,
                               int most_steps) {
  return WorldRun(test, body, carried, most_steps).finish();
}

}  // namespace exmat::precompute
