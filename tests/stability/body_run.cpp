#include "tests/stability/body_run.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "common/core/decompositions.h"
#include "common/core/timer.h"
#include "runtime/sim/lanes/lane_step.h"
#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/world/world.h"

namespace exmat::precompute {
namespace {

constexpr double kSmall = 0.2, kSmallMargin = 1.5;  // of L: up to there u_lin itself, and half, is the bound
constexpr double kLinearRange = 0.01;  // of L: linear elasticity, for which Newmark's method keeps the energy
constexpr double kRestTime = 20;       // over the rate of the slowest mode
constexpr int kLeastRestSteps = 60, kUndampedSteps = 300;
constexpr double kClearance = 0.02;  // between body and ground [m]

/// Steps one body: by itself, in mixed precision as one of instances, in a lane of its own, or in a world, where it may
/// step in all vertices. What is beside it in lanes changes nothing, so nothing is. Where lanes leave a step to the
/// body alone it is one in double precision.
class Stepper {
 public:
  Stepper(const runtime::Model& model, const runtime::FullModel* full, const runtime::StepScene& scene,
          const runtime::NewtonPolicy& policy, runtime::State& state)
      : model_(model), scene_(scene), state_(state) {
    if (scene.space.space != Space::kReduced) {
      world_.emplace(runtime::ContactLaw());
      world_->add({&model, &scene, nullptr, full}, state);
      return;
    }
    if (scene.precision == Precision::kMixed)
      lanes_.emplace(model, scene);
    else
      alone_.emplace(model, scene);
    runtime::Workspace& workspace = lanes_ ? lanes_->body(0) : *alone_;
    workspace.newton.policy = policy;
    if (workspace.near) workspace.near->newton.policy = policy;
  }

  runtime::StepReport step() {
    if (world_) {
      world_->step(1);
      return world_->report(0);
    }
    if (alone_) return runtime::step(model_, scene_, state_, *alone_);
    runtime::StepReport report;
    const runtime::LaneBody body{&scene_, &state_};
    runtime::step_in_lanes(model_, {&body, 1}, *lanes_, {&report, 1});
    return report;
  }

 private:
  const runtime::Model& model_;
  const runtime::StepScene& scene_;
  runtime::State& state_;
  std::optional<runtime::Workspace> alone_;
  std::optional<runtime::LaneWorkspace> lanes_;
  std::optional<runtime::World> world_;
};

class Run {
 public:
  Run(const StabilityCase& test, const StudyBody& body, int most_steps, const runtime::NewtonPolicy& policy)
      : test_(test),
        body_(body),
        model_(*body.model),
        full_(test.space != Space::kReduced ? body.full.get() : nullptr),
        policy_(policy),
        most_steps_(most_steps),
        steps_(most_steps) {
    make_scene();
    make_start();
    plan_steps();
  }

  StabilityResult finish();

 private:
  void make_scene();
  void add_tip_load();
  void add_ground();
  void make_start();
  Eigen::VectorXd start_pose() const;
  void plan_steps();
  void go_on_after_rest(bool was_at_rest);
  void step_all();
  void watch(const runtime::StepReport& report, const Eigen::VectorXd& before);
  double linear_displacement() const;
  double largest(const Eigen::VectorXd& q) const { return largest_displacement(body_.basis(), q); }
  double displacement() const;
  runtime::Energies energies() const { return runtime::energies(full_, model_, scene_, state_); }
  Eigen::VectorXd coordinates() const;
  double kinetic() const;
  double rotation_energy() const;
  Eigen::Vector3d angular_momentum() const;
  // Place of a vertex of a body that steps in all vertices.
  Eigen::Vector3d place_in_full(Eigen::Index vertex, const runtime::Placement& frame) const {
    return full_->rest.row(vertex).transpose() + runtime::full_displacement(*full_, frame, *state_.full, vertex);
  }
  RowMatrix end_rows() const;
  Eigen::VectorXd force_on_end(const Eigen::Vector3d& force) const;
  double surface_density() const {  // mass over the area that it lies on [kg/m^2]
    return test_.body.density * body_.reduced.object->mesh.vertices.col(2).maxCoeff();
  }
  /// True if the body ends up in a rotation about another axis than a principal one, which bends it for ever.
  bool tumbles() const {
    return test_.body.free && ((test_.spin > 0 && !test_.principal_axis) || !scene_.forces.empty() || rocks());
  }
  /// True if it rocks or rolls for long: on round ground, or as it is bent itself.
  bool rocks() const {
    return test_.ground == Ground::kSphere || test_.ground == Ground::kCapsule ||
           (test_.ground != Ground::kNone && !scene_.examples.empty());
  }
  /// True if the run stays in the range where displacements are below so many L in linear elasticity.
  bool small(double sizes) const;
  bool conservative() const;
  void judge_all();

  const StabilityCase& test_;
  const StudyBody& body_;
  const runtime::Model& model_;
  const runtime::FullModel* const full_;  // null for one that steps in its modes alone
  const runtime::NewtonPolicy policy_;
  const std::int64_t most_steps_;
  std::int64_t steps_, rest_steps_ = 0;
  bool expects_rest_ = false;
  runtime::StepScene scene_;
  runtime::State state_;
  StabilityResult result_;
  RunRecord record_;
  double bound_u_linear_ = 0, work_ = 0, peak_rotation_ = 0, start_displacement_ = 0;
  Eigen::Vector3d start_momentum_ = Eigen::Vector3d::Zero();
};

void Run::make_scene() {
  scene_.time_step = test_.time_step;
  scene_.integrator = test_.integrator;
  scene_.precision = test_.precision;
  scene_.space.space = test_.space;
  // Parts of a step would mend what a test breaks.
  if (!policy_.line_search || !policy_.projection)
    scene_.newton.max_iterations = runtime::NewtonSettings{}.max_iterations - 1;
  scene_.mass_damping = 2 * test_.damping * body_.lowest_frequency;
  scene_.stiffness_damping = test_.stiffness_damping / body_.lowest_frequency;
  scene_.gravity = Eigen::Vector3d(0, 0, -test_.gravity);
  scene_.gravity_force = runtime::gravity_force(model_, scene_.gravity);
  scene_.examples.assign(model_.examples.size(), test_.examples);
  if (test_.tip_load.norm() > 0) add_tip_load();
  if (test_.ground != Ground::kNone) add_ground();
}

// Rows of the basis of the vertices at the far end.
RowMatrix Run::end_rows() const {
  const VertexArray& X = body_.reduced.object->mesh.vertices;
  const double end = X.col(0).maxCoeff() - 1e-9;
  RowMatrix rows(0, model_.modes());
  for (Eigen::Index v = 0; v < X.rows(); ++v) {
    if (X(v, 0) < end) continue;
    rows.conservativeResize(rows.rows() + 3, Eigen::NoChange);
    rows.bottomRows<3>() = body_.reduced.modal->basis.middleRows<3>(3 * v);
  }
  return rows;
}

// Force on each vertex at the far end, of those that move.
Eigen::VectorXd Run::force_on_end(const Eigen::Vector3d& force) const {
  const VertexArray& X = body_.reduced.object->mesh.vertices;
  const double end = X.col(0).maxCoeff() - 1e-9;
  Eigen::VectorXd forces = Eigen::VectorXd::Zero(full_->space.size());
  for (Eigen::Index v = 0; v < X.rows(); ++v)
    if (X(v, 0) >= end) forces.segment<3>(3 * full_->space.number(v)) = force;
  return forces;
}

void Run::add_tip_load() {
  const RowMatrix rows = end_rows();
  runtime::ScriptedForce load;
  load.end = (kLoadSteps - 0.25) * test_.time_step;
  const Eigen::VectorXd unit = runtime::vertex_force(rows, test_.tip_load.normalized());
  const double moved = largest(body_.rest_stiffness.llt().solve(unit));
  const Eigen::Vector3d force = body_.size / moved * test_.tip_load;  // on each vertex
  const double count = static_cast<double>(rows.rows()) / 3;
  load.force = runtime::vertex_force(rows, force);
  load.total = count * force;
  if (full_ != nullptr) load.on_vertices = force_on_end(force);
  load.mean_basis.setZero(3, rows.cols());
  for (Eigen::Index v = 0; v < rows.rows() / 3; ++v) load.mean_basis += rows.middleRows<3>(3 * v) / count;
  const VertexArray& X = body_.reduced.object->mesh.vertices;
  if (test_.body.free)
    load.lever = Eigen::Vector3d(X.col(0).maxCoeff(), 0.5 * X.col(1).maxCoeff(), 0.5 * X.col(2).maxCoeff()) -
                 model_.frame->centre_of_mass();
  scene_.forces.push_back(load);
}

/// A slab whose top is at z = 0, cut into triangles.
runtime::Shape slab_of_triangles(double size, double thickness) {
  constexpr int kCells = 8;
  constexpr int kRow = kCells + 1, kLayer = kRow * kRow;
  VertexArray vertices(2 * kLayer, 3);
  for (int layer = 0; layer < 2; ++layer)
    for (int y = 0; y < kRow; ++y)
      for (int x = 0; x < kRow; ++x)
        vertices.row(layer * kLayer + y * kRow + x) << size * (2.0 * x / kCells - 1), size * (2.0 * y / kCells - 1),
            (layer - 1) * thickness;
  TriangleArray triangles(0, 3);
  const auto add = [&](int a, int b, int c, int d) {
    triangles.conservativeResize(triangles.rows() + 2, 3);
    triangles.bottomRows<2>() << a, b, c, a, c, d;
  };
  const auto at = [](int layer, int y, int x) { return layer * kLayer + y * kRow + x; };
  for (int y = 0; y < kCells; ++y)
    for (int x = 0; x < kCells; ++x) {
      add(at(1, y, x), at(1, y, x + 1), at(1, y + 1, x + 1), at(1, y + 1, x));
      add(at(0, y, x), at(0, y + 1, x), at(0, y + 1, x + 1), at(0, y, x + 1));
    }
  for (int i = 0; i < kCells; ++i) {
    add(at(0, 0, i), at(0, 0, i + 1), at(1, 0, i + 1), at(1, 0, i));
    add(at(0, kCells, i + 1), at(0, kCells, i), at(1, kCells, i), at(1, kCells, i + 1));
    add(at(0, i + 1, 0), at(0, i, 0), at(1, i, 0), at(1, i + 1, 0));
    add(at(0, i, kCells), at(0, i + 1, kCells), at(1, i + 1, kCells), at(1, i, kCells));
  }
  return runtime::MeshShape{std::make_shared<runtime::RigidMesh>(vertices, triangles, 0)};
}

/// Hills of a hundredth of their distance, the highest at z = 0.
runtime::Shape hills(double size) {
  constexpr int kPoints = 65;
  RowMatrix heights(kPoints, kPoints);
  const double spacing = 2 * size / (kPoints - 1);
  for (int y = 0; y < kPoints; ++y)
    for (int x = 0; x < kPoints; ++x) heights(y, x) = 0.04 * spacing * (std::sin(1.5 * x) * std::cos(1.5 * y) - 1);
  return runtime::HeightFieldShape{std::make_shared<runtime::HeightField>(heights, Eigen::Vector2d(spacing, spacing)),
                                   Eigen::Vector3d(-size, -size, 0)};
}

void Run::add_ground() {
  const VertexArray& X = body_.reduced.object->mesh.vertices;
  const double height = X.col(2).maxCoeff();
  runtime::Obstacle ground;
  ground.shape = runtime::Plane{{0, 0, -kClearance}, Eigen::Vector3d::UnitZ()};
  ground.stiffness = test_.contact_stiffness;
  ground.damping = 2 * std::sqrt(test_.contact_stiffness * surface_density());  // a vertex of that mass does not bounce
  ground.friction = test_.friction;
  constexpr double kGroundSizes = 20;
  const Eigen::Vector3d below(0.5 * X.col(0).maxCoeff(), 0.5 * X.col(1).maxCoeff(), -kClearance);
  const double radius = 2 * body_.size;
  if (test_.ground == Ground::kSphere)
    ground.shape = runtime::Sphere{below - radius * Eigen::Vector3d::UnitZ(), radius};
  if (test_.ground == Ground::kCapsule) {
    const Eigen::Vector3d axis = below - radius * Eigen::Vector3d::UnitZ(), along(0, kGroundSizes * body_.size, 0);
    ground.shape = runtime::Capsule{axis - along, axis + along, radius};
  }
  if (test_.ground == Ground::kBox) {
    const double half = kGroundSizes * body_.size, thick = 0.05 * body_.size;
    ground.shape = runtime::Box{below - thick * Eigen::Vector3d::UnitZ(), {half, half, thick}};
  }
  if (test_.ground == Ground::kMesh) ground.shape = slab_of_triangles(kGroundSizes * body_.size, 0.1 * body_.size);
  if (test_.ground == Ground::kHills) ground.shape = hills(kGroundSizes * body_.size);
  if (test_.ground == Ground::kMesh || test_.ground == Ground::kHills)
    ground.motion = runtime::RigidMotion({{0, {0, 0, -kClearance}, Eigen::Quaterniond::Identity()}});
  scene_.obstacles.push_back(ground);
  if (test_.ground != Ground::kPress) return;
  runtime::Obstacle press = ground;
  press.shape = runtime::Plane{{0, 0, height + kClearance}, -Eigen::Vector3d::UnitZ()};
  const double time = kLoadSteps * test_.time_step, way = height + 2 * kClearance;  // the planes meet
  press.motion = runtime::RigidMotion(
      {{0, Eigen::Vector3d::Zero()}, {time, Eigen::Vector3d(0, 0, -way)}, {2 * time, Eigen::Vector3d::Zero()}});
  scene_.obstacles.push_back(press);
}

Eigen::VectorXd Run::start_pose() const {
  const RowMatrix& basis = body_.reduced.modal->basis;
  const Eigen::Index modes = model_.modes();
  if (test_.start == Start::kRest || test_.start == Start::kImpulse) return Eigen::VectorXd::Zero(modes);
  if (test_.start == Start::kTangled) return random_pose(basis, test_.reach * body_.size);
  VertexArray field = body_.reduced.object->mesh.vertices;
  const Eigen::RowVector3d middle = 0.5 * field.colwise().maxCoeff();
  field.rowwise() -= Eigen::RowVector3d(test_.body.free ? middle[0] : 0, middle[1], middle[2]);
  if (test_.start != Start::kCollapsed) field.rightCols<2>().setZero();
  const double factor = test_.start == Start::kInverted ? -2 : -1;
  return factor * nearest_pose(basis, field);
}

void Run::make_start() {
  const Eigen::VectorXd q = start_pose();
  Eigen::VectorXd v = Eigen::VectorXd::Zero(model_.modes());
  if (test_.start == Start::kImpulse) {
    v = runtime::vertex_force(end_rows(), test_.impulse.normalized());
    v *= test_.impulse.norm() * body_.size / body_.reach / v.norm();
  }
  state_ = runtime::make_state(model_, q, v);
  runtime::prepare_contacts(model_, scene_.obstacles.size(), state_);
  if (full_ != nullptr) runtime::prepare_full(*full_, state_);
  if (test_.body.free) {
    runtime::FrameMotion motion;
    motion.linear_velocity = Eigen::Vector3d(0, 0, -test_.velocity);
    const Eigen::Vector3d inclined(0.5, std::sqrt(0.5), 0.5);
    motion.angular_velocity = test_.spin * (test_.principal_axis ? Eigen::Vector3d::UnitZ() : inclined);
    runtime::set_motion(model_, motion, state_);
    start_momentum_ = angular_momentum();
  }
  const CubatureData& cubature = *body_.reduced.cubature;
  const Eigen::VectorXd H = cubature.gradient * q;
  for (Eigen::Index j = 0; j < cubature.weights.size(); ++j) {
    const RowMatrix3 F = Eigen::Map<const RowMatrix3>(H.data() + 9 * j) + RowMatrix3::Identity();
    result_.start_determinant = std::min(result_.start_determinant, F.determinant());
    result_.start_inverted += F.determinant() <= 0 ? 1.0 / static_cast<double>(cubature.weights.size()) : 0;
  }
  start_displacement_ = largest(q);
  const runtime::Energies energies = this->energies();
  record_.start_energy = energies.total();
  record_.start_potential = energies.potential;
  record_.kinetic = record_.peak_kinetic = kinetic();
}

// Until the slowest mode is at rest after the load, if that is soon enough.
void Run::plan_steps() {
  if (!(test_.damping > 0)) {
    steps_ = std::min<std::int64_t>(most_steps_, kUndampedSteps);
    return;
  }
  double rate = body_.lowest_frequency * std::min(test_.damping, 1 / (2 * test_.damping));
  if (test_.ground != Ground::kNone) rate = std::min(rate, std::sqrt(test_.contact_stiffness / surface_density()));
  const int load_steps = test_.ground == Ground::kPress ? 2 * kLoadSteps : kLoadSteps;
  const double rest_steps = std::ceil(std::max<double>(kLeastRestSteps, kRestTime / (rate * test_.time_step)));
  const bool ends = load_steps + rest_steps <= static_cast<double>(most_steps_);
  expects_rest_ = ends && !tumbles();
  if (!ends) return;
  rest_steps_ = static_cast<std::int64_t>(rest_steps);
  steps_ = load_steps + rest_steps_;
}

// A body that lies still in a shape that is not its lowest, pressed inside out, may leave it in any step: from there it
// has its time again.
void Run::go_on_after_rest(bool was_at_rest) {
  if (!expects_rest_ || !was_at_rest || record_.is_at_rest()) return;
  steps_ = std::clamp(record_.steps + rest_steps_, steps_, most_steps_);
}

// Kinetic energy of what comes to rest: the deformation, and all of a body that may touch the ground.
double Run::kinetic() const {
  if (test_.ground != Ground::kNone) return energies().kinetic;
  if (!state_.full) return 0.5 * state_.v.squaredNorm();
  // The vertices turn and shift with the body's frame, and deform by what is left.
  const runtime::Placement frame = model_.frame->placement(state_.frame);
  const runtime::FrameVelocity velocity = model_.frame->velocity(state_.frame);
  Eigen::VectorXd own = state_.full->v;
  for (Eigen::Index v = 0; v < full_->rest.rows(); ++v)
    if (const std::int32_t number = full_->space.number(v); number >= 0)
      own.segment<3>(3 * number) -= velocity.at(place_in_full(v, frame) - frame.position);
  // Velocities are known to rounding: the kinetic energy to that and its product with the largest of them.
  constexpr double kVelocityRounding = 1e-12;
  return std::max(0.0, 0.5 * own.dot(full_->space.momentum(own)) - kVelocityRounding * energies().kinetic);
}

// Coordinates that the loads of the scene do work on.
Eigen::VectorXd Run::coordinates() const {
  if (state_.full) return state_.full->q;
  return full_ != nullptr ? full_->basis * state_.q : state_.q;
}

// Angular momentum of a free body about its centre of mass, from its motion.
Eigen::Vector3d Run::angular_momentum() const {
  if (!state_.full) return precompute::angular_momentum(runtime::DeformingInertia(*body_.reduced.rigid), state_);
  const runtime::Placement frame = model_.frame->placement(state_.frame);
  const Eigen::VectorXd momenta = full_->space.momentum(state_.full->v);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (Eigen::Index v = 0; v < full_->rest.rows(); ++v)
    sum += (place_in_full(v, frame) - frame.position).cross(momenta.segment<3>(3 * full_->space.number(v)));
  return sum;
}

// The largest displacement of a vertex, of a free body beside that of its frame.
double Run::displacement() const {
  if (!state_.full) return largest(state_.q);
  const runtime::Placement frame = model_.frame->placement(state_.frame);
  double most = 0;
  for (Eigen::Index v = 0; v < full_->rest.rows(); ++v)
    most = std::max(most, (place_in_full(v, frame) - frame.to_world(full_->rest.row(v))).norm());
  return most;
}

/// Displacement by the start and the loads in linear elasticity: a body of the energy W deflects to |q|_K = sqrt(2 W),
/// a load that sets in at once to 2 |f|_(K^-1), and |u| <= reach |q|_K.
double Run::linear_displacement() const {
  const runtime::Energies energies = this->energies();
  double energy = energies.elastic + energies.kinetic;
  double norm = 2 * body_.load_norm(scene_.gravity_force);
  if (test_.body.free && test_.ground == Ground::kNone)
    energy -= 0.5 * runtime::free_state(state_).linear_momentum.squaredNorm() / runtime::free_state(state_).mass;
  if (test_.body.free && test_.ground != Ground::kNone)
    energy += runtime::free_state(state_).mass * test_.gravity * body_.size;
  for (const runtime::ScriptedForce& load : scene_.forces) norm += 2 * body_.load_norm(load.force);
  const double elastic = body_.reach * (norm + std::sqrt(2 * energy));
  if (test_.body.free) return elastic;
  // Nor does it move farther than if nothing held it.
  const double time = static_cast<double>(steps_) * test_.time_step;
  Eigen::VectorXd force = scene_.gravity_force;
  for (const runtime::ScriptedForce& load : scene_.forces) force += load.force;
  return std::min(elastic, body_.mass_reach * time * (std::sqrt(2 * energy) + 0.5 * time * force.norm()));
}

bool Run::small(double sizes) const {
  return bound_u_linear_ < sizes * body_.size && scene_.examples.empty() && test_.ground == Ground::kNone &&
         !(test_.spin > 0);
}

// True if the energy that energies() adds up may not grow but by the work of the tip's load: obstacles that stand
// still store some of it.
bool Run::conservative() const {
  return scene_.examples.empty() && test_.ground != Ground::kPress && !(test_.body.free && !scene_.forces.empty());
}

void Run::watch(const runtime::StepReport& report, const Eigen::VectorXd& before) {
  result_.newton_iterations += report.newton_iterations;
  result_.factorisations += report.factorisations;
  result_.line_search_evaluations += report.line_search_evaluations;
  result_.projections += report.projections;
  result_.most_iterations = std::max(result_.most_iterations, report.newton_iterations);
  result_.limited_steps += (report.status & runtime::kStepIterationLimit) != 0 ? 1 : 0;
  result_.stagnated_steps += (report.status & runtime::kStepStagnated) != 0 ? 1 : 0;
  result_.target_steps += (report.status & runtime::kTargetNotConverged) != 0 ? 1 : 0;
  if (test_.body.free && !scene_.forces.empty()) peak_rotation_ = std::max(peak_rotation_, rotation_energy());
  const double midpoint = state_.time - 0.5 * test_.time_step;
  for (const runtime::ScriptedForce& load : scene_.forces)
    if (midpoint < load.end) work_ += (full_ != nullptr ? load.on_vertices : load.force).dot(coordinates() - before);
  const bool spins = test_.spin > 0;
  record_.add({.unsolved = ((report.status & runtime::kStepIterationLimit) != 0 ? 1 : 0) +
                           ((report.status & runtime::kStepStagnated) != 0 ? 1 : 0),
               .displacement = displacement() / body_.size,
               .kinetic = kinetic(),
               .energies = energies(),
               .work = work_,
               .momentum_error = spins ? (angular_momentum() - start_momentum_).norm() / start_momentum_.norm() : 0});
}

// Energy of a free body's turn as a rigid one.
double Run::rotation_energy() const {
  const runtime::DeformingInertia inertia(*body_.reduced.rigid);
  auto moments = inertia.make_moments();
  inertia.moments(state_.q, moments);
  const Eigen::Vector3d& spin = runtime::free_state(state_).spin;
  return 0.5 * spin.dot(moments.inertia * spin);
}

void Run::step_all() {
  Stepper stepper(model_, full_, scene_, policy_, state_);
  record_.displacement = start_displacement_ / body_.size;
  const runtime::Energies energies = this->energies();
  record_.exchanged = energies.kinetic + energies.elastic;
  Eigen::VectorXd before;
  const Timer timer;
  while (record_.steps < steps_) {
    before = coordinates();
    const runtime::StepReport report = stepper.step();
    if ((report.status & runtime::kStepNonFinite) != 0) {
      record_.add({.non_finite = 1});
      break;
    }
    const bool was_at_rest = record_.is_at_rest();
    watch(report, before);
    go_on_after_rest(was_at_rest);
  }
  result_.seconds = timer.seconds();
  result_.steps = record_.steps;
  result_.non_finite_steps = record_.non_finite;
  result_.largest_displacement = record_.displacement;
}

void Run::judge_all() {
  const double spun = body_.reach * std::sqrt(2 * peak_rotation_) / body_.size;
  Expectation expected{
      .displacement = displacement_bound(result_.linear_displacement + spun, start_displacement_ / body_.size),
      .rest = expects_rest_,
      .integrator = test_.integrator};
  if (full_ == nullptr && small(kSmall)) expected.displacement = kSmallMargin * result_.linear_displacement;
  if (!scene_.examples.empty() && body_.reduced.examples)
    for (const ExampleData& example : body_.reduced.examples->examples)
      expected.displacement =
          std::max(expected.displacement, displacement_bound(largest(example.pose) / body_.size, 0));
  expected.energy = conservative() && (test_.integrator != Integrator::kNewmark || small(kLinearRange));
  expected.momentum = test_.spin > 0 && test_.ground == Ground::kNone && scene_.forces.empty();
  judge(test_, body_, record_, expected, result_);
}

StabilityResult Run::finish() {
  bound_u_linear_ = linear_displacement();
  result_.linear_displacement = bound_u_linear_ / body_.size;
  step_all();
  judge_all();
  return result_;
}

}  // namespace

void judge(const StabilityCase& test, const StudyBody& body, const RunRecord& run, const Expectation& expected,
           StabilityResult& result) {
  result.checks = judge(run, expected);
  for (std::size_t i = 0; i < result.checks.size(); ++i) {
    CheckResult& check = result.checks[i];
    if (check.verdict != Verdict::kFail) continue;
    for (const KnownLimit& known : known_limits()) {
      if (static_cast<std::size_t>(known.check) != i || !(check.value <= known.most) || !known.covers(test, body))
        continue;
      check.verdict = Verdict::kKnownLimit;
      result.limit_ids[i] = known.id;
      break;
    }
  }
}

StabilityResult run_case(const StabilityCase& test, const StudyBody& body, int most_steps,
                         const runtime::NewtonPolicy& policy) {
  return Run(test, body, most_steps, policy).finish();
}

}  // namespace exmat::precompute
