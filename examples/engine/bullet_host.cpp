// A rigid-body host of Bullet and the C interface of exmat: they hold each other at any ratio of their masses.
//   bullet_host BUNDLE.h5    (a free bar of 4 x 1 x 1 m and 120 kg, as docs/engines.md makes)
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <algorithm>
#include <btBulletDynamicsCommon.h>
#include <cmath>
#include <cstdio>
#include <exmat/exmat.h>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <vector>

using Numbers = std::vector<double>;  // x y z of one point after another

constexpr double kGravity = 9.81, kMass = 120;  // [m/s^2], of the soft body [kg]

void check(exmat_status status) {
  if (status != EXMAT_OK) throw std::runtime_error(exmat_last_error());
}

btVector3 at(const Numbers& numbers, std::size_t point) {
  return {numbers[3 * point], numbers[3 * point + 1], numbers[3 * point + 2]};
}

void put(const btVector3& vector, std::size_t point, Numbers& numbers) {
  std::copy_n(&vector[0], 3, numbers.begin() + 3 * static_cast<std::ptrdiff_t>(point));
}

// recipe: bullet soft
/// A body of exmat as a solver sees it: k points that have velocities and an inverse mass, and take impulses.
class SoftBody {
 public:
  /// `rest` [3k]: places of the points where the body of the model is at rest [m].
  SoftBody(const exmat_model* model, const Numbers& rest)
      : places(rest), velocities(rest.size()), inverse_mass(rest.size() * rest.size()), count_(std::ssize(rest)) {
    check(exmat_body_create(model, &body));
    check(exmat_points_create_at(model, rest.data(), count_, &points_));
    check(exmat_body_add_forces(body, points_, velocities.data(), count_, &forces_));
  }
  SoftBody(const SoftBody&) = delete;
  SoftBody& operator=(const SoftBody&) = delete;
  ~SoftBody() {
    exmat_points_destroy(points_);
    exmat_body_destroy(body);
  }

  /// With constant forces [3k] [N] on the points.
  void step(const Numbers& forces) {
    check(exmat_body_set_forces(body, forces_, points_, forces.data(), count_));
    check(exmat_body_step(body, 1, nullptr));
  }
  void read() {
    check(exmat_body_read_positions_double(body, points_, places.data(), count_));
    check(exmat_body_read_compliance(body, points_, velocities.data(), inverse_mass.data(), count_));
  }
  void take(const Numbers& impulses) { check(exmat_body_apply_impulses(body, points_, impulses.data(), count_)); }

  Numbers places, velocities, inverse_mass;  // of the last read(): [3k], [3k], [3k x 3k]
  exmat_body* body = nullptr;

 private:
  exmat_points* points_ = nullptr;
  std::int64_t count_, forces_ = -1;
};

// recipe: bullet rigid
/// The host's side of the same points.
class RigidSide {
 public:
  virtual ~RigidSide() = default;
  virtual btVector3 place(std::size_t point) const = 0;
  virtual btVector3 velocity(std::size_t point) const = 0;
  /// Change of the velocities of all points [3k] by impulses [3k].
  virtual Numbers response(const Numbers& impulses) = 0;
  /// Impulses [3k] after a step. As in exmat, what they change of the velocity moves the bodies for the step, too.
  virtual void take(const Numbers& impulses, double dt) = 0;
  /// Bullet has moved it.
  virtual void update() {}
};

// recipe: end

/// Points of one rigid body.
class BodyPoints : public RigidSide {
 public:
  /// `own` [3k]: in the axes of the body, from its centre of mass.
  BodyPoints(btRigidBody& body, Numbers own) : body_(body), own_(std::move(own)) {}

  btVector3 place(std::size_t point) const override { return body_.getWorldTransform() * at(own_, point); }
  btVector3 velocity(std::size_t point) const override { return body_.getVelocityInLocalPoint(arm(point)); }
  Numbers response(const Numbers& impulses) override {
    const auto [linear, angular] = change(impulses);
    Numbers velocities(own_.size());
    for (std::size_t i = 0; 3 * i < own_.size(); ++i) put(linear + angular.cross(arm(i)), i, velocities);
    return velocities;
  }
  void take(const Numbers& impulses, double dt) override {
    const auto [linear, angular] = change(impulses);
    body_.setLinearVelocity(body_.getLinearVelocity() + linear);
    body_.setAngularVelocity(body_.getAngularVelocity() + angular);
    btTransform moved;
    btTransformUtil::integrateTransform(body_.getWorldTransform(), linear, angular, dt, moved);
    body_.setWorldTransform(moved);
    body_.updateInertiaTensor();
  }

 private:
  btVector3 arm(std::size_t point) const { return body_.getWorldTransform().getBasis() * at(own_, point); }
  /// Change of linear and angular velocity.
  std::pair<btVector3, btVector3> change(const Numbers& impulses) const {
    btVector3 linear(0, 0, 0), angular(0, 0, 0);
    for (std::size_t i = 0; 3 * i < own_.size(); ++i) {
      linear += at(impulses, i) * body_.getInvMass();
      angular += body_.getInvInertiaTensorWorld() * arm(i).cross(at(impulses, i));
    }
    return {linear, angular};
  }

  btRigidBody& body_;
  Numbers own_;
};

/// The end of a chain, which Bullet has in joint coordinates: it answers as one, however light its links are.
class ChainEnd : public RigidSide {
 public:
  /// Links in a row along x from `start`, each hung on the one before, the first on the world.
  ChainEnd(int links, double length, double mass, const btVector3& inertia, const btVector3& start)
      : chain(links, 0, btVector3(0, 0, 0), true, false), half_(length / 2, 0, 0) {
    chain.setBasePos(start);
    for (int i = 0; i < links; ++i)
      chain.setupSpherical(i, mass, inertia, i - 1, btQuaternion::getIdentity(), i == 0 ? btVector3(0, 0, 0) : half_,
                           half_, true);
    chain.finalizeMultiDof();
    update();
  }

  btVector3 place(std::size_t) const override { return chain.localPosToWorld(last(), half_); }
  btVector3 velocity(std::size_t) const override { return at_end(chain.getVelocityVector()); }
  Numbers response(const Numbers& impulses) override {
    Numbers velocity(3);
    put(at_end(change(impulses).data()), 0, velocity);
    return velocity;
  }
  void take(const Numbers& impulses, double dt) override {
    Numbers rates = change(impulses);
    chain.applyDeltaVeeMultiDof(rates.data(), 1);
    chain.stepPositionsMultiDof(dt, nullptr, rates.data());
    update();
  }
  /// The chain has been moved: finds its Jacobian and its inverse mass where it is now.
  void update() override {
    chain.forwardKinematics(turns_, shifts_);
    chain.computeAccelerationsArticulatedBodyAlgorithmMultiDof(0, scratch_, vectors_, matrices_, false, false, false);
    jacobian_.assign(3 * size(), 0);
    for (int axis = 0; axis < 3; ++axis) {
      btVector3 along(0, 0, 0);
      along[axis] = 1;
      chain.fillConstraintJacobianMultiDof(last(), place(0), btVector3(0, 0, 0), along, &jacobian_[axis * size()],
                                           scratch_, vectors_, matrices_);
    }
  }

  btMultiBody chain;

 private:
  int last() const { return chain.getNumLinks() - 1; }
  int size() const { return 6 + chain.getNumDofs(); }
  /// The velocity of the end by those of the joints.
  btVector3 at_end(const double* rates) const {
    btVector3 velocity(0, 0, 0);
    for (int axis = 0; axis < 3; ++axis)
      for (int i = 0; i < size(); ++i) velocity[axis] += jacobian_[axis * size() + i] * rates[i];
    return velocity;
  }
  /// Change of the joint velocities.
  Numbers change(const Numbers& impulses) {
    Numbers torques(size(), 0.0), rates(size(), 0.0);
    for (int axis = 0; axis < 3; ++axis)
      for (int i = 0; i < size(); ++i) torques[i] += jacobian_[axis * size() + i] * impulses[axis];
    chain.calcAccelerationDeltasMultiDof(torques.data(), rates.data(), scratch_, vectors_);
    return rates;
  }

  btVector3 half_;
  Numbers jacobian_;  // [3 x size()]
  btAlignedObjectArray<btScalar> scratch_;
  btAlignedObjectArray<btVector3> vectors_, shifts_;
  btAlignedObjectArray<btMatrix3x3> matrices_;
  btAlignedObjectArray<btQuaternion> turns_;
};

enum class Kind { kJoint, kUnderBody, kOnFloor };  // of a point: joined to, or pressed down by, the rigid side

/// Steps a soft body and what Bullet has together.
class Coupling {
 public:
  /// `kinds` [k] of the points: the first are those of the rigid side, those on the floor z = 0 are last.
  Coupling(SoftBody& soft, RigidSide& rigid, btDynamicsWorld& world, std::vector<Kind> kinds, double friction,
           bool carries)
      : impulses(3 * kinds.size(), 0.0),
        soft_(soft),
        rigid_(rigid),
        world_(world),
        kinds_(std::move(kinds)),
        friction_(friction),
        carries_(carries),
        shared_(3 * (kinds_.size() - std::ranges::count(kinds_, Kind::kOnFloor))) {}

  void step(double dt) {
    // A held body carries the impulses of the last step as forces through this one, so that little is left to correct
    // at its end, and nothing where it rests. A free light body between heavy ones would turn away under such forces.
    limits_ = impulses;
    if (!carries_) std::ranges::fill(impulses, 0);
    Numbers forces = impulses;
    for (double& force : forces) force /= dt;
    soft_.step(forces);
    world_.stepSimulation(dt, 0);
    rigid_.update();
    Numbers given(shared_, 0.0);
    soft_.read();
    for (int round = 0; round < 2 || (round < 8 && error() > 1e-12); ++round) {  // two for friction, more after impacts
      correct(dt, given);
      soft_.read();
    }
  }

  /// Largest distance of the two sides of a joint, or depth of a contact [m].
  double error() const {
    double most = 0;
    for (std::size_t i = 0; i < kinds_.size(); ++i) {
      const btVector3 gap = gap_of(i);
      most = std::max(most, kinds_[i] == Kind::kJoint     ? gap.length()
                            : kinds_[i] == Kind::kOnFloor ? -gap.z()
                                                          : gap.z());
    }
    return most;
  }

  Numbers impulses;  // of the last step, on the soft body [N s]

 private:
  bool is_rigid(std::size_t point) const { return 3 * point < shared_; }
  btVector3 gap_of(std::size_t point) const {
    const btVector3 place = at(soft_.places, point);
    return is_rigid(point) ? place - rigid_.place(point) : btVector3(0, 0, place.z());
  }

  /// One system of all points: relative velocity and impulse by the sum of both sides' inverse masses. Joints close by
  /// the end of the step, contacts push alone, and friction holds as far as they do. `given` [3k]: what the rigid side
  /// has got.
  void correct(double dt, Numbers& given) {
    const int size = static_cast<int>(impulses.size());
    btMatrixXu mass(size, size);  // inverse
    btVectorXu wanted(size), total(size), least(size), most(size);
    wanted.setZero();
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) {
        mass.setElem(row, column, soft_.inverse_mass[static_cast<std::size_t>(row * size + column)]);
        wanted[row] += mass(row, column) * impulses[static_cast<std::size_t>(column)];
      }
    for (std::size_t column = 0; column < shared_; ++column) {
      Numbers unit(shared_, 0.0);
      unit[column] = 1;
      const Numbers response = rigid_.response(unit);
      for (std::size_t row = 0; row < shared_; ++row) {
        mass.addElem(static_cast<int>(row), static_cast<int>(column), response[row]);
        wanted[static_cast<int>(row)] += response[row] * given[column];
      }
    }
    btAlignedObjectArray<int> alone;  // no row limits another
    for (int row = 0; row < size; ++row) {
      const auto point = static_cast<std::size_t>(row / 3);
      const int axis = row % 3;
      const bool slides = kinds_[point] != Kind::kJoint && axis < 2;
      const btVector3 velocity =
          at(soft_.velocities, point) - (is_rigid(point) ? rigid_.velocity(point) : btVector3(0, 0, 0));
      wanted[row] -= slides ? velocity[axis] : gap_of(point)[axis] / dt;
      const bool pulls = kinds_[point] == Kind::kJoint;
      const double grip = friction_ * std::abs(limits_[3 * point + 2]);
      least[row] = slides ? -grip : pulls || kinds_[point] == Kind::kUnderBody ? -BT_INFINITY : 0;
      most[row] = slides ? grip : pulls || kinds_[point] == Kind::kOnFloor ? BT_INFINITY : 0;
      alone.push_back(-1);
    }
    total.setZero();
    if (!solver_.solveMLCP(mass, wanted, total, least, most, alone, 0)) throw std::runtime_error("no impulses");
    Numbers change(impulses.size()), back(shared_);
    for (std::size_t i = 0; i < change.size(); ++i) {
      change[i] = total[static_cast<int>(i)] - impulses[i];
      impulses[i] = total[static_cast<int>(i)];
    }
    for (std::size_t i = 0; i < shared_; ++i) back[i] = given[i] - impulses[i];
    std::copy_n(impulses.begin(), shared_, given.begin());
    limits_ = impulses;
    soft_.take(change);
    rigid_.take(back, dt);
  }

  SoftBody& soft_;
  RigidSide& rigid_;
  btDynamicsWorld& world_;
  std::vector<Kind> kinds_;
  double friction_;
  bool carries_;
  Numbers limits_;      // impulses whose pressure limits friction: those found last
  std::size_t shared_;  // numbers of the rigid side
  btDantzigSolver solver_;
};

struct Figures {
  double error = 0;     // of joints and contacts at the ends of all steps [m]
  double momentum = 0;  // that no load explains, as a share of what the loads gave
  double at_rest = 0;   // the way from where the rigid body has to come to rest [m]
};

btVector3 momentum_of(const exmat_body* body) {
  exmat_motion motion;
  motion.size = sizeof motion;
  check(exmat_body_read_motion(body, &motion));
  return kMass * btVector3(motion.linear_velocity[0], motion.linear_velocity[1], motion.linear_velocity[2]);
}

/// A free body at rest `by` above where its mesh is, or moving along x.
void start(exmat_body* body, double speed, double by) {
  exmat_motion motion;
  motion.size = sizeof motion;
  check(exmat_body_read_motion(body, &motion));
  motion.position[2] += by;
  motion.linear_velocity[0] = speed;
  check(exmat_body_set_motion(body, &motion));
}

/// The parts of a world of Bullet.
struct Bullet {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btMultiBodyConstraintSolver solver;
  btMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  Bullet() { world.setGravity(btVector3(0, 0, -kGravity)); }
};

/// A box of Bullet.
struct Box {
  btBoxShape shape;
  btRigidBody body;
  Box(double mass, const btVector3& half_extents, const btVector3& place)
      : shape(half_extents), body(mass, nullptr, &shape, inertia(mass)) {
    body.setWorldTransform(btTransform(btQuaternion::getIdentity(), place));
    body.updateInertiaTensor();
    body.setActivationState(DISABLE_DEACTIVATION);
  }
  btVector3 inertia(double mass) const {
    btVector3 of_box;
    shape.calculateLocalInertia(mass, of_box);
    return of_box;
  }
};

/// Ten links in a row, and the body, start level and swing down.
Figures chain(const exmat_model* model, double ratio, double dt) {
  constexpr int kLinks = 10;
  const double length = 0.4, mass = ratio * kMass / kLinks;
  // Light links under a heavy load swing faster than the step can follow: they get inertia that makes them slower.
  const double tension = 3 * kMass * kGravity;
  const double inertia = mass * length * length / 12 + tension * length * dt * dt;
  Bullet bullet;
  SoftBody soft(model, {0, 0.5, 0.5});
  ChainEnd end(kLinks, length, mass, btVector3(inertia, inertia, inertia), btVector3(-kLinks * length, 0.5, 0.5));
  bullet.world.addMultiBody(&end.chain);
  Coupling coupling(soft, end, bullet.world, {Kind::kJoint}, 0, false);
  Figures figures;
  btVector3 given = momentum_of(soft.body);
  double throughput = 0;
  for (int step = 0; step < std::lround(4 / dt); ++step) {
    coupling.step(dt);
    figures.error = std::max(figures.error, coupling.error());
    given += at(coupling.impulses, 0) + btVector3(0, 0, -kMass * kGravity * dt);
    throughput += at(coupling.impulses, 0).length();
  }
  figures.momentum = (momentum_of(soft.body) - given).length() / throughput;
  bullet.world.removeMultiBody(&end.chain);
  return figures;
}

/// A cart on a soft pad lands with 3 m/s and slides until friction has stopped it.
Figures cart(const exmat_model* model, double ratio, double dt) {
  const double mass = ratio * kMass, friction = 0.3, speed = 3, drop = 0.02;
  Bullet bullet;
  SoftBody soft(model, {0.5, 0, 1, 3.5, 0, 1, 0.5, 1, 1, 3.5, 1, 1, 0.5, 0, 0, 3.5, 0, 0, 0.5, 1, 0, 3.5, 1, 0});
  start(soft.body, speed, drop);
  Box box(mass, btVector3(2, 0.5, 0.25), btVector3(2, 0.5, 1.25 + drop));
  box.body.setLinearVelocity(btVector3(speed, 0, 0));
  bullet.world.addRigidBody(&box.body);
  BodyPoints under(box.body, {-1.5, -0.5, -0.25, 1.5, -0.5, -0.25, -1.5, 0.5, -0.25, 1.5, 0.5, -0.25});
  Coupling coupling(soft, under, bullet.world,
                    {Kind::kJoint, Kind::kJoint, Kind::kJoint, Kind::kJoint, Kind::kOnFloor, Kind::kOnFloor,
                     Kind::kOnFloor, Kind::kOnFloor},
                    friction, false);
  const auto momentum = [&] { return mass * box.body.getLinearVelocity() + momentum_of(soft.body); };
  Figures figures;
  btVector3 given = momentum();
  double throughput = 0;
  for (int step = 0; step < std::lround(4 / dt); ++step) {
    coupling.step(dt);
    figures.error = std::max(figures.error, coupling.error());
    given += btVector3(0, 0, -(mass + kMass) * kGravity * dt);
    for (std::size_t i = 4; i < 8; ++i) {
      given += at(coupling.impulses, i);
      throughput += at(coupling.impulses, i).length();
    }
  }
  figures.momentum = (momentum() - given).length() / throughput;
  const double way = box.body.getWorldTransform().getOrigin().x() - 2;
  figures.at_rest = way - speed * speed / (2 * friction * kGravity);
  bullet.world.removeRigidBody(&box.body);
  return figures;
}

/// Vertices of the bar's underside, held where they are.
std::int64_t hold(const exmat_model* model, exmat_body* body) {
  std::vector<std::int64_t> all(static_cast<std::size_t>(exmat_model_vertices(model))), below;
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::int64_t>(i);
  exmat_points* points = nullptr;
  check(exmat_points_create_vertices(model, all.data(), std::ssize(all), &points));
  Numbers rest(3 * all.size());
  check(exmat_points_read_rest(points, rest.data(), std::ssize(rest)));
  exmat_points_destroy(points);
  for (const std::int64_t vertex : all)
    if (rest[static_cast<std::size_t>(3 * vertex + 2)] < 1e-6) below.push_back(vertex);
  exmat_attachment fixed;
  check(exmat_attachment_default(&fixed, sizeof fixed));
  const double frame[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  std::int64_t id = -1;
  check(exmat_body_attach(body, below.data(), std::ssize(below), &fixed, frame, &id));
  return id;
}

/// A box falls onto a cushion and comes to rest where statics say: where a cushion is under the same load.
Figures cushion(const exmat_model* model, double ratio, double dt) {
  const double mass = ratio * kMass;
  const Numbers places{1, 0, 1, 3, 0, 1, 1, 1, 1, 3, 1, 1};
  Bullet bullet;
  SoftBody soft(model, places), still(model, places);
  const std::int64_t held = hold(model, soft.body);
  hold(model, still.body);
  Box box(mass, btVector3(1, 0.5, 0.5), btVector3(2, 0.5, 1.52));
  bullet.world.addRigidBody(&box.body);
  BodyPoints under(box.body, {-1, -0.5, -0.5, 1, -0.5, -0.5, -1, 0.5, -0.5, 1, 0.5, -0.5});
  Coupling coupling(soft, under, bullet.world, {4, Kind::kUnderBody}, 0.5, true);
  Figures figures;
  for (int step = 0; step < std::lround(6 / dt); ++step) {
    coupling.step(dt);
    figures.error = std::max(figures.error, coupling.error());
  }
  btVector3 force;
  check(exmat_body_read_attachment_load(soft.body, held, &force[0], nullptr, nullptr));
  const double weight = (mass + kMass) * kGravity;
  figures.momentum = (force + btVector3(0, 0, weight)).length() / weight;

  Numbers load = coupling.impulses;
  for (double& number : load) number /= dt;
  check(exmat_body_set_damping(still.body, 0, 0.05));
  for (int step = 0; step < 2000; ++step) still.step(load);
  still.read();
  for (std::size_t i = 0; i < 4; ++i)
    if (load[3 * i + 2] < 0)  // a light box may stand on three of them
      figures.at_rest = std::max(figures.at_rest, std::abs(still.places[3 * i + 2] - under.place(i).z()));
  bullet.world.removeRigidBody(&box.body);
  return figures;
}

struct Deleter {
  void operator()(exmat_model* model) const { exmat_model_destroy(model); }
};

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const struct {
    const char* name;
    Figures (*run)(const exmat_model*, double, double);
    double error, momentum, at_rest;  // that they may reach
  } scenes[] = {
      {"chain", chain, 1e-9, 1e-9, 0}, {"cart", cart, 1e-6, 1e-9, 0.05}, {"cushion", cushion, 1e-6, 1e-9, 1e-6}};
  int status = 0;
  try {
    std::printf("scene    host : body    Hz   error [m]   momentum   at rest [m]\n");
    for (const auto& scene : scenes)
      for (const double ratio : {0.001, 1000.0})
        for (const int rate : {60, 240}) {
          exmat_settings settings;
          check(exmat_settings_default(&settings, sizeof settings));
          settings.time_step = 1.0 / rate;
          settings.gravity[2] = -kGravity;
          settings.stiffness_damping = 0.02;
          settings.integrator = EXMAT_BACKWARD_EULER;
          exmat_model* model = nullptr;
          check(exmat_model_create(argv[1], &settings, &model));
          const std::unique_ptr<exmat_model, Deleter> owner(model);
          const Figures figures = scene.run(model, ratio, settings.time_step);
          std::printf("%-8s %11s   %3d   %9.0e   %8.0e   %11.0e\n", scene.name, ratio < 1 ? "1 : 1000" : "1000 : 1",
                      rate, figures.error, figures.momentum, figures.at_rest);
          std::fflush(stdout);
          if (!(figures.error <= scene.error && figures.momentum <= scene.momentum &&
                std::abs(figures.at_rest) <= scene.at_rest))
            status = 1;
        }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bullet_host: %s\n", error.what());
    return 1;
  }
  if (status != 0) std::fprintf(stderr, "bullet_host: a figure is not what it has to be\n");
  return status;
}
