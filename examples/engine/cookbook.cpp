// The recipes of docs/engines.md in one program, which a test compiles and runs.
//   cookbook BUNDLE.h5    (a free body with contact, as examples/10_pile/asset_bar.json makes)
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exmat/exmat.hpp>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

using Vector = std::array<double, 3>;

Vector operator-(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// recipe: model
exmat::Model load(const std::string& bundle) {
  exmat_settings settings = exmat::default_settings();
  settings.time_step = 1.0 / 240;
  settings.gravity[2] = -9.81;
  settings.stiffness_damping = 0.005;
  settings.use_examples = 1;
  settings.example_stiffness = 400;
  settings.example_damping = 10;
  settings.use_contact = 1;
  return exmat::Model(bundle, settings);
}

// recipe: world
exmat_obstacle floor() {
  exmat_obstacle plane = exmat::default_obstacle();  // through the origin, z up
  plane.stiffness = 1e6;                             // [N/m^3]
  plane.damping = 1e4;
  plane.friction = 0.5;
  return plane;
}

std::int64_t drop(exmat::World& world, const exmat::Model& model, const Vector& where) {
  exmat::Body body(model);
  exmat_motion motion = body.motion();
  for (std::size_t axis = 0; axis < 3; ++axis) motion.position[axis] += where[axis];
  body.set_motion(motion);
  return world.add(std::move(body));
}

exmat::World make_world() {
  exmat_contact_law law = exmat::default_contact_law();  // of bodies with each other
  law.stiffness = 1e6;
  law.damping = 1e4;
  law.friction = 0.5;
  exmat::World world(law);
  world.add_obstacle(floor());
  return world;
}

// recipe: sub-steps
class Clock {
 public:
  explicit Clock(double time_step) : time_step_(time_step) {}

  /// Steps that a frame of `seconds` needs; at most `most`, so that one slow frame does not make the next one slower.
  int steps(double seconds, int most = 16) {
    owed_ += seconds;
    const int steps = std::min(most, static_cast<int>(owed_ / time_step_));
    owed_ = steps == most ? 0 : owed_ - steps * time_step_;
    return steps;
  }
  /// Share of a step, in [0, 1), that the frame is beyond the last one.
  double beyond() const { return owed_ / time_step_; }

 private:
  double time_step_, owed_ = 0;
};

// recipe: drawing
struct Drawn {
  explicit Drawn(const exmat::Model& model)
      : surface(model), triangles(surface.triangles()), xyz(3 * surface.points()) {}

  void update(exmat::BodyRef body) { body.read_positions(surface, xyz); }  // then upload xyz

  exmat::Surface surface;
  std::vector<std::int32_t> triangles;  // [3f], constant
  std::vector<float> xyz;               // [3k], of this frame
};

// recipe: interpolation
/// Pictures between two steps: a step late, and smooth at any frame rate.
class Between {
 public:
  /// After each step.
  void add(const std::vector<float>& xyz) {
    last_.swap(now_);
    now_ = xyz;
    if (last_.size() != now_.size()) last_ = now_;
  }
  /// `beyond` in [0, 1): Clock::beyond().
  void read(double beyond, std::vector<float>& xyz) const {
    const auto share = static_cast<float>(beyond);
    for (std::size_t i = 0; i < xyz.size(); ++i) xyz[i] = (1 - share) * last_[i] + share * now_[i];
  }

 private:
  std::vector<float> last_, now_;
};

// recipe: picking
/// A spring from the picked point to the mouse, renewed before each step.
class Hand {
 public:
  Hand(const exmat::Surface& surface, const exmat::RayHit& picked)
      : points_(exmat::Points::on_surface(surface, std::array{picked.triangle}, picked.shares)) {}

  void pull(exmat::BodyRef body, const Vector& mouse) {
    std::array<float, 3> xyz;
    body.read_positions(points_, xyz);
    std::array<double, 3> force;
    for (std::size_t axis = 0; axis < 3; ++axis) force[axis] = stiffness_ * (mouse[axis] - xyz[axis]);
    if (id_ < 0)
      id_ = body.add_forces(points_, force);
    else
      body.set_forces(id_, points_, force);
  }
  void release(exmat::BodyRef body) { body.remove_forces(std::exchange(id_, -1)); }

 private:
  exmat::Points points_;
  std::int64_t id_ = -1;      // of its force on the body
  double stiffness_ = 30000;  // [N/m]
};

// recipe: poses
void take_pose(exmat::BodyRef body, const exmat::Model& model, std::size_t example) {
  std::vector<double> weights(model.examples(), 0.0);
  weights[example] = 1;
  body.set_example_weights(weights);
}

void forget_pose(exmat::BodyRef body) { body.set_example_weights({}); }  // weights follow the shape again

// recipe: touches
/// A sound for each two bodies that began to touch in the last call of step(); returns how many.
int hear(const exmat::World& world) {
  int sounds = 0;
  for (const exmat_touch& touch : world.touches())
    if (touch.change == EXMAT_TOUCH_BEGINS && touch.obstacle < 0) ++sounds;  // of touch.body and touch.other
  return sounds;
}

// recipe: coupling
/// A rigid ball of the host's own engine: exmat is told where it is, and says how hard it is pushed.
struct Ball {
  Vector position{}, velocity{};
  double mass = 50, radius = 0.4;
  std::int64_t id = -1;

  void add_to(exmat::World& world) {
    exmat_obstacle ball = exmat::default_obstacle();
    ball.shape = EXMAT_SPHERE;
    ball.radius = radius;
    ball.damping = 1e4;
    id = world.add_obstacle(ball);
    move_in(world);
  }

  void move_in(exmat::World& world) const {
    exmat_motion motion{};
    motion.orientation[0] = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      motion.position[axis] = position[axis];
      motion.linear_velocity[axis] = velocity[axis];
    }
    world.move_obstacle(id, motion);
  }

  void step(const exmat::World& world, double dt) {
    Vector force;
    world.read_obstacle_load(id, force.data(), nullptr);  // the mean over the last call that stepped
    for (std::size_t axis = 0; axis < 3; ++axis) {
      velocity[axis] += dt * (force[axis] / mass - (axis == 2 ? 9.81 : 0));
      position[axis] += dt * velocity[axis];
    }
  }
};

// recipe: pinning
/// A frame of the engine, a bone or a rigid body, as three rows of rotation and position.
using Frame = std::array<double, 12>;

Frame at(const Vector& position) { return {1, 0, 0, position[0], 0, 1, 0, position[1], 0, 0, 1, position[2]}; }

std::int64_t pin(exmat::BodyRef body, const std::vector<std::int64_t>& vertices, const Frame& frame) {
  exmat_attachment spring = exmat::default_attachment();
  spring.kind = EXMAT_ATTACHMENT_SPRING;
  spring.stiffness = 2e4;  // [N/m]
  spring.damping = 500;
  spring.break_force = 1e5;
  return body.attach(vertices, frame, spring);
}

// recipe: tying
/// Two bodies of a world, by patches of the object that each has, from where they are now.
std::int64_t tie(exmat::BodyRef body, const std::vector<std::int64_t>& vertices, exmat::BodyRef other,
                 const std::vector<std::int64_t>& other_vertices) {
  exmat_attachment ball = exmat::default_attachment();
  ball.kind = EXMAT_ATTACHMENT_BALL;
  ball.break_force = 1e6;  // [N]
  return body.attach_to(vertices, other, other_vertices, ball);
}

// recipe: impulses
/// A joint between a point of a body and a ball of the engine, solved once between two steps.
void join(exmat::BodyRef body, const exmat::Points& point, Ball& ball) {
  Vector velocity, impulse;
  std::array<double, 9> w;  // velocity of the point per impulse [1/kg]
  body.read_compliance(point, velocity, w);
  for (std::size_t axis = 0; axis < 3; ++axis) w[4 * axis] += 1 / ball.mass;
  const Vector a{w[0], w[1], w[2]}, b{w[3], w[4], w[5]}, c{w[6], w[7], w[8]};
  const Vector wanted = ball.velocity - velocity, bc = cross(b, c), ca = cross(c, a), ab = cross(a, b);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    impulse[axis] = (wanted[0] * bc[axis] + wanted[1] * ca[axis] + wanted[2] * ab[axis]) / dot(a, bc);
    ball.velocity[axis] -= impulse[axis] / ball.mass;
  }
  body.apply_impulses(point, impulse);
}

// recipe: reach
/// The examples pull points of the body to world places, three numbers each, as far as they can.
void reach(exmat::BodyRef body, const exmat::Points& points, const std::vector<double>& places) {
  exmat_reach settings = exmat::default_reach();
  settings.change = 0.02;  // most that a weight changes in a step: 0.2 s from pose to pose
  settings.horizon = 0.3;  // [s]
  body.reach(points, places, settings);
}

// recipe: detail
/// Bodies near the camera may step in all vertices of their mesh where something pushes them, others in their modes.
void set_detail(exmat::World& world, const exmat::Model& model, std::int64_t id, bool is_near) {
  exmat::BodyRef body = world.body(id);
  body.set_space(is_near ? EXMAT_SPACE_AUTO : EXMAT_SPACE_REDUCED);  // of a model of settings.space = EXMAT_SPACE_AUTO
  body.set_example_stiffness(model.examples() > 1 && is_near ? 400 : 0);
  world.set_full_bodies(4);  // at once, those that are pushed hardest
}

/// Another model, of fewer modes or without contact, takes a body's place and its motion.
std::int64_t change_model(exmat::World& world, std::int64_t id, const exmat::Model& other) {
  exmat::Body next(other);
  next.set_motion(world.body(id).motion());
  world.remove(id);
  return world.add(std::move(next));
}

// recipe: rollback
/// The last frames of a world in memory that is made once.
class History {
 public:
  explicit History(std::size_t frames) : frames_(frames) {}

  void save(const exmat::World& world, std::size_t frame) { world.save(frames_[frame % frames_.size()]); }
  void roll_back(exmat::World& world, std::size_t frame) const { world.restore(frames_[frame % frames_.size()]); }

 private:
  std::vector<std::vector<std::uint64_t>> frames_;
};

// recipe: threads
/// Stands for the engine's own: calls work(i) for each i < count, at the same time where it can, and waits.
struct Jobs {
  void parallel_for(int count, const std::function<void(int)>& work) {
    for (int i = 0; i < count; ++i) work(i);
  }
};

void use_threads_of(Jobs& jobs) {
  exmat_set_scheduler(
      [](void* user, void (*task)(void*, std::int32_t), void* data, std::int32_t count) {
        static_cast<Jobs*>(user)->parallel_for(count, [=](int i) { task(data, i); });
      },
      &jobs);
}

// recipe: memory
/// While a level loads: everything that later frames need is made and has its size.
exmat::World load_level(const exmat::Model& model, int bodies, History& history) {
  exmat::World world = make_world();
  for (int i = 0; i < bodies; ++i) drop(world, model, {0, 0, 0.2 + 0.8 * i});
  world.step(1, 4);  // scratch of four threads
  for (std::size_t frame = 0; frame < 8; ++frame) history.save(world, frame);
  return world;
}

// recipe: end

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    const exmat::Model model = load(argv[1]);
    exmat::World world = make_world();
    drop(world, model, {0, 0, 0.2});
    const std::int64_t upper = drop(world, model, {0.1, 0, 1.4});
    Drawn drawn(model);
    Clock clock(model.time_step());
    const auto frames = [&](int count, auto before_each_step) {
      for (int frame = 0; frame < count; ++frame)
        for (int step = clock.steps(1.0 / 60); step > 0; --step) {
          before_each_step();
          world.step();
        }
      drawn.update(world.body(upper));
    };

    int sounds = 0;
    frames(60, [&] { sounds += hear(world); });
    std::printf("dropped      the upper body at z = %.2f m\n", world.body(upper).motion().position[2]);
    std::printf("heard        %s\n", sounds > 0 ? "the bodies meet" : "nothing");
    History history(8);
    history.save(world, 0);
    const std::uint64_t saved = world.hash();

    const Vector eye{3.8, 0.5, 10}, down{0, 0, -1};
    const std::optional<exmat::RayHit> picked = world.cast_ray(std::array{&std::as_const(drawn.surface)}, eye, down);
    if (!picked || picked->body != upper) throw exmat::Error(EXMAT_FAILURE, "the ray does not meet the upper body");
    Hand hand(drawn.surface, *picked);
    const Vector mouse{3.8, 0.5, 10 - picked->distance + 0.5};
    frames(30, [&] { hand.pull(world.body(upper), mouse); });
    const double before = picked->distance,
                 after = world.body(upper).cast_ray(drawn.surface, eye, down).value_or(*picked).distance;
    std::printf("pulled       the picked point up by %.2f m\n", before - after);
    hand.release(world.body(upper));

    take_pose(world.body(upper), model, 1);
    frames(20, [] {});
    std::vector<double> weights(model.examples());
    world.body(upper).read_weights(weights);
    std::printf("posed        weight of the twist %.2f\n", weights[1]);
    forget_pose(world.body(upper));

    history.roll_back(world, 0);
    std::printf("rolled back  %s\n", world.hash() == saved ? "the same to the last bit" : "another state");

    Ball ball;
    ball.position = {2, 0.5, 2.6};
    ball.add_to(world);
    for (int step = 0; step < 240; ++step) {
      ball.move_in(world);
      world.step();
      ball.step(world, model.time_step());
    }
    std::printf("coupled      the ball rests at z = %.2f m\n", ball.position[2]);
    world.remove_obstacle(ball.id);

    Jobs jobs;
    use_threads_of(jobs);
    exmat::BodyRef body = world.body(upper);
    const std::array<std::int64_t, 1> corner{0};
    const exmat::Points points = exmat::Points::vertices(model, corner);
    const auto height = [&] {
      Vector place;
      body.read_positions(points, place);
      return place[2];
    };
    Vector place;
    body.read_positions(points, place);
    const std::int64_t pinned = pin(body, {corner[0]}, at(place));
    const double low = place[2];
    for (int step = 1; step <= 240; ++step) {
      body.move_attachment(pinned, at({place[0], place[1], low + step / 240.0}));
      world.step();
    }
    std::printf("pinned       its corner went up by %.2f m with the frame\n", height() - low);
    body.detach(pinned);

    Ball weight;
    weight.velocity = {0, 0, -3};
    join(body, points, weight);
    std::printf("joined       corner and weight go down by %.2f m/s\n", -weight.velocity[2]);

    Vector there;
    body.read_positions(points, there);
    reach(body, points, {there[0], there[1] + 0.3, there[2]});
    world.step(48);
    body.read_weights(weights);
    std::printf("reached      with weight %.2f of the twist\n", weights[1]);

    tie(body, {corner[0]}, world.body(0), {corner[0]});
    std::printf("tied         %d bodies step as one\n", static_cast<int>(world.step(48).largest_island));
  } catch (const exmat::Error& error) {
    std::fprintf(stderr, "cookbook: %s\n", error.what());
    return error.status();
  }
  return 0;
}
