#include "runtime/sim/frame/skeleton.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

#include "precompute/full_space/mesh_elasticity.h"
#include "precompute/shape_space/filter_functions.h"
#include "runtime/sim/space/full/full_body.h"
#include "tests/precompute/full_space/full_space_bar.h"

// Bodies on bones, beside carried bodies in the modes of their frame, which know fictitious forces in place of inertia
// in the world, and beside the balance of forces of their steps.
namespace exmat::precompute {
namespace skeleton_test {

constexpr double kTight = 1e-9;  // of Newton's method

/// A skeleton of so many bones in a row along x, whose weights go over from one to the next along the bar.
SkeletonData row_of_bones(const ObjectData& object, int bones) {
  SkeletonData data;
  const VertexArray& rest = object.mesh.vertices;
  const double length = rest.col(0).maxCoeff();
  data.parents = IndexVector::LinSpaced(bones, -1, bones - 2);
  data.bind.setZero(3 * bones, 4);
  data.weights.setZero(rest.rows(), bones);
  data.first_frames = IndexVector::Zero(1);
  data.times.resize(0);
  data.poses.resize(0, 7);
  for (int b = 0; b < bones; ++b) {
    data.bones.push_back("bone " + std::to_string(b));
    data.bind.block<3, 3>(3 * b, 0) = Eigen::AngleAxisd(0.3 * b, Eigen::Vector3d::UnitY()).toRotationMatrix();
    data.bind(3 * b, 3) = b * length / bones;
  }
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    const double at = bones == 1 ? 0 : rest(v, 0) / length * (bones - 1);
    const int before = std::min(static_cast<int>(at), std::max(0, bones - 2));
    data.weights(v, before) = 1 - (at - before);
    if (bones > 1) data.weights(v, before + 1) = at - before;
  }
  return data;
}

/// A bar on a row of bones, which hold its first end, and with several its last one.
struct BoneBar {
  explicit BoneBar(int bones, int examples = 0)
      : bar(complete_bar({.cells = {4, 1, 1}, .carried = bones == 1, .examples = examples})) {
    ReducedModel& data = bar.model;
    const VertexArray& rest = data.object->mesh.vertices;
    for (Eigen::Index v = 0; v < rest.rows(); ++v)
      if (bones > 1 && rest(v, 0) == rest.col(0).maxCoeff()) {
        data.object->fixed[v] = 1;
        data.modal->basis.middleRows<3>(3 * v).setZero();
      }
    data.skeleton = row_of_bones(*data.object, bones);
    if (examples > 0) {
      const FilterFunctions functions(laplace_basis_of(data), data.object->mesh, data.object->materials.density);
      FullSpaceData full_data;
      full_data.filter = functions.root_over_analysis * functions.analysis;
      for (Eigen::Index v = 0; v < rest.rows(); ++v)
        if (data.object->fixed[v] != 0) full_data.filter.row(v).setZero();
      full_data.slopes.setZero(data.examples->gram.rows(), 3 * full_data.filter.cols());
      full_data.from_target = Eigen::MatrixXd::Random(data.modal->basis.cols(), 3 * full_data.filter.cols()) * 0.01;
      data.full_space = full_data;
    }
    model = std::move(runtime::build_model(data, {.examples = examples > 0}).model);
    full = std::move(runtime::build_full_model(data, *model).model);
    state = runtime::make_state(*model);
    runtime::prepare_full(*full, state);
    runtime::enter_full_space(*full, *model, state);
  }

  runtime::StepScene scene(double time_step) const {
    runtime::StepScene scene;
    scene.time_step = time_step;
    scene.mass_damping = 0.5;
    scene.stiffness_damping = 0.005;
    scene.newton = scene.space.newton = {100, kTight};
    scene.space.space = Space::kFull;
    scene.gravity = {0, -9, 3};
    scene.gravity_force = runtime::gravity_force(*model, scene.gravity);
    return scene;
  }

  runtime::SkeletonMotion& bones() { return *state.full->skeleton; }
  const VertexArray& rest() const { return bar.model.object->mesh.vertices; }
  Eigen::Vector3d position(Eigen::Index v) const {
    return rest().row(v).transpose() + runtime::full_displacement(*full, {}, *state.full, v);
  }

  test::Bar bar;
  std::unique_ptr<const runtime::Model> model;
  std::unique_ptr<const runtime::FullModel> full;
  runtime::State state;
};

runtime::RigidMotion swing() {
  const Eigen::Vector3d axis = Eigen::Vector3d(0.4, -0.3, 0.8).normalized();
  const auto turned = [&](double angle) { return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)); };
  return runtime::RigidMotion(std::vector<runtime::Keyframe>{
      {0, {0, 0, 0}, turned(0)}, {0.16, {0.1, 0.2, -0.1}, turned(0.9)}, {0.32, {-0.1, 0.3, 0.2}, turned(1.6)}});
}

/// Largest distance at the end of `swing` from the body of all modes in its frame, over the displacement there.
double distance_from_carried(double time_step) {
  BoneBar body(1);
  const runtime::Skeleton& skeleton = *body.model->skeleton;
  runtime::StepScene scene = body.scene(time_step);
  const runtime::RigidMotion motion = swing();
  ReducedModel frame_model = body.bar.model;
  frame_model.skeleton.reset();
  const auto carried = std::move(runtime::build_model(frame_model, {.examples = false, .carried = true}).model);
  runtime::StepScene carried_scene = scene;
  carried_scene.carrier = motion;
  runtime::State reduced = runtime::make_state(*carried);
  runtime::FrameWorkspace frame = carried->frame->make_workspace();
  carried->frame->follow(carried_scene, 0, reduced.q, reduced.v, frame, reduced.frame);
  runtime::Workspace workspace(*body.model, scene), beside(*carried, carried_scene);
  runtime::FullWorkspace own(*body.full, scene);
  const auto set_bones = [&](double time) {
    runtime::BoneMatrix world = skeleton.bind(0);
    const runtime::MotionSample at = motion.sample(time);
    world.leftCols<3>() = at.rotation * world.leftCols<3>();
    world.col(3) = at.to_world(world.col(3));
    body.bones().next[0] = skeleton.pose(0, world);
  };
  set_bones(0);
  runtime::put_on_bones(*body.full, body.bones().next, body.state);
  body.bones().anew = false;  // the motion begins at rest
  for (int i = 0; i < static_cast<int>(std::lround(0.32 / time_step)); ++i) {
    set_bones((i + 1) * time_step);
    EXPECT_EQ(runtime::step_in_full_space(*body.full, *body.model, scene, body.state, workspace, own).status, 0U) << i;
    EXPECT_EQ(runtime::step(*carried, carried_scene, reduced, beside).status, 0U) << i;
  }
  const runtime::MotionSample at = motion.sample(0.32);
  double off = 0, size = 0;
  for (Eigen::Index v = 0; v < body.rest().rows(); ++v) {
    const Eigen::Vector3d in_frame = body.bar.model.modal->basis.middleRows<3>(3 * v) * reduced.q;
    size = std::max(size, in_frame.norm());
    const Eigen::Vector3d here = body.position(v);
    const double distance = (here - at.to_world(body.rest().row(v).transpose() + in_frame)).norm();
    off = std::max(off, distance);
    if (body.bar.model.object->fixed[v] != 0) EXPECT_LE(distance, 1e-14);
  }
  EXPECT_GE(size, 0.02);
  const runtime::Energies now = runtime::energies(body.full.get(), *body.model, scene, body.state),
                          expected = runtime::energies(*carried, carried_scene, reduced);
  EXPECT_NEAR(now.kinetic / expected.kinetic, 1, 0.02);
  EXPECT_NEAR(now.elastic / expected.elastic, 1, 0.02);
  EXPECT_NEAR(now.potential / expected.potential, 1, 0.02);
  return off / size;
}

// Both are of second order, of errors of their own: a quarter as far apart at half the time step.
TEST(Skeleton, OfOneBoneCarriesTheBodyAsItsFrameDoes) {
  const double coarse = distance_from_carried(0.002), fine = distance_from_carried(0.001);
  EXPECT_GE(coarse / fine, 3);
  EXPECT_LE(fine, 5e-3);
}

/// The bones bend by `angle` each beside the one before, about z, the first is at `shift`.
runtime::BonePoses bent(const runtime::Skeleton& skeleton, double angle, const Eigen::Vector3d& shift) {
  runtime::BonePoses poses = skeleton.bound();
  const runtime::BonePoses bound = poses;
  for (std::size_t b = 0; b < poses.size(); ++b) {
    const Eigen::Quaterniond own(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
    poses[b].turn = b == 0 ? own : poses[b - 1].turn * own;
    poses[b].joint = b == 0 ? bound[0].joint + shift
                            : poses[b - 1].joint + poses[b - 1].turn * (bound[b].joint - bound[b - 1].joint);
  }
  return poses;
}

/// Steps with bones that bend, at 4 ms.
class Bending {
 public:
  explicit Bending(BoneBar& of, const runtime::StepScene& its_scene)
      : body(of), scene(its_scene), workspace(*of.model, scene), own(*of.full, scene) {}

  void step(double angle, const Eigen::Vector3d& shift) {
    body.bones().next = bent(*body.model->skeleton, angle, shift);
    EXPECT_EQ(runtime::step_in_full_space(*body.full, *body.model, scene, body.state, workspace, own).status, 0U);
  }

  BoneBar& body;
  const runtime::StepScene& scene;
  runtime::Workspace workspace;
  runtime::FullWorkspace own;
};

/// Positions, displacements and velocities of all vertices [3n].
Eigen::VectorXd all_displacements(const BoneBar& body) {
  Eigen::VectorXd u(3 * body.rest().rows());
  for (Eigen::Index v = 0; v < body.rest().rows(); ++v)
    u.segment<3>(3 * v) = runtime::full_displacement(*body.full, {}, *body.state.full, v);
  return u;
}
Eigen::VectorXd all_velocities(const BoneBar& body) {
  Eigen::VectorXd u(3 * body.rest().rows());
  for (Eigen::Index v = 0; v < body.rest().rows(); ++v)
    u.segment<3>(3 * v) = runtime::full_velocity(*body.full, {}, {}, *body.state.full, v);
  return u;
}

// The forces at the end of a step are in balance by what this test makes of positions, element by element: inertia of
// all vertices with those that bones hold, elasticity, gravity and the pull of examples, which act in the bones' axes.
TEST(Skeleton, BalancesTheForcesOfItsSteps) {
  BoneBar body(3, 3);
  runtime::StepScene scene = body.scene(0.004);
  scene.mass_damping = scene.stiffness_damping = 0;
  scene.examples = {{.stiffness = 300, .target_iterations = 50}};
  Bending bending(body, scene);
  const ObjectData& object = *body.bar.model.object;
  const ElasticSystem system = build_elastic_system(object.mesh, object.materials, object.fixed);
  std::vector<std::int32_t> all(static_cast<std::size_t>(3 * body.rest().rows()));
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::int32_t>(i);
  const MeshElasticity elasticity(object.mesh, object.materials, all);
  const RowMatrix& filter = body.bar.model.full_space->filter;
  Eigen::VectorXd u = all_displacements(body), v = all_velocities(body), u_before = u, v_before = v;
  double largest_pull = 0;
  for (int i = 0; i < 40; ++i) {
    const double angle = 0.5 * std::sin(0.08 * (i + 1));
    bending.step(angle, {0.01 * (i + 1), 0, 0});
    const Eigen::VectorXd u_now = all_displacements(body), v_now = all_velocities(body);
    if (i >= 2) {
      const Eigen::VectorXd rate = (3 * u_now - 4 * u + u_before) / (2 * scene.time_step);
      EXPECT_LE((v_now - rate).norm(), 1e-9 * rate.norm()) << i;
      const Eigen::VectorXd acceleration = (3 * rate - 4 * v + v_before) / (2 * scene.time_step);
      Eigen::VectorXd force;
      elasticity.force(u_now, force);
      const Eigen::VectorXd inertia = system.full_mass * acceleration;
      Eigen::VectorXd balance = inertia + force - system.unit_weights() * scene.gravity;
      const runtime::BonePoses poses = bent(*body.model->skeleton, angle, {0.01 * (i + 1), 0, 0});
      const runtime::BonePoses bound = body.model->skeleton->bound();
      Eigen::MatrixXd own(body.rest().rows(), 3), pull;
      std::vector<Eigen::Matrix3d> turns;
      for (Eigen::Index at = 0; at < body.rest().rows(); ++at) {
        const Eigen::Vector3d rest = body.rest().row(at);
        Eigen::Vector3d base = Eigen::Vector3d::Zero();
        Eigen::Vector4d mean = Eigen::Vector4d::Zero();
        for (std::size_t b = 0; b < poses.size(); ++b) {
          const double weight = body.bar.model.skeleton->weights(at, static_cast<Eigen::Index>(b));
          base += weight * (poses[b].turn.toRotationMatrix() * (rest - bound[b].joint) + poses[b].joint);
          mean += weight * poses[b].turn.coeffs();
        }
        turns.emplace_back(Eigen::Quaterniond(mean.normalized()).toRotationMatrix());
        own.row(at) = turns.back().transpose() * (rest + u_now.segment<3>(3 * at) - base);
      }
      const Eigen::Map<const RowMatrix> target(bending.own.examples.front().target.data(), filter.cols(), 3);
      pull = 300 * filter * (filter.transpose() * own - target);
      for (Eigen::Index at = 0; at < body.rest().rows(); ++at)
        balance.segment<3>(3 * at) += turns[static_cast<std::size_t>(at)] * pull.row(at).transpose();
      largest_pull = std::max(largest_pull, pull.norm() / force.norm());
      for (Eigen::Index at = 0; at < body.rest().rows(); ++at)
        if (object.fixed[at] != 0) balance.segment<3>(3 * at).setZero();
      EXPECT_LE(balance.norm(), 1e-7 * (inertia.norm() + force.norm())) << i;
    }
    u_before = u;
    v_before = v;
    u = u_now;
    v = v_now;
  }
  EXPECT_GE(largest_pull, 0.01);
}

// Vertices that hang on one bone alone go exactly where it goes: at a run, at two turns a second, after a jump.
TEST(Skeleton, HoldsVerticesExactlyAtTheirBones) {
  BoneBar body(3);
  const runtime::StepScene scene = body.scene(0.004);
  Bending bending(body, scene);
  const auto off = [&](const runtime::BonePoses& poses) {
    const runtime::BonePoses bound = body.model->skeleton->bound();
    double worst = 0;
    for (Eigen::Index v = 0; v < body.rest().rows(); ++v) {
      if (body.bar.model.object->fixed[v] == 0) continue;
      const std::size_t b = body.rest()(v, 0) == 0 ? 0 : 2;
      const Eigen::Vector3d rest = body.rest().row(v);
      worst = std::max(worst, (body.position(v) - poses[b].joint - poses[b].turn * (rest - bound[b].joint)).norm());
    }
    return worst;
  };
  for (int i = 0; i < 60; ++i) {
    const double turn = 4 * std::numbers::pi * 0.004 * i;
    const Eigen::Quaterniond own(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()));
    runtime::BonePoses poses = bent(*body.model->skeleton, 0.1, Eigen::Vector3d::Zero());
    for (runtime::BonePose& pose : poses)
      pose = {own * pose.joint + Eigen::Vector3d(0, 0, 10 * 0.004 * i), own * pose.turn};
    body.bones().next = poses;
    ASSERT_EQ(
        runtime::step_in_full_space(*body.full, *body.model, scene, body.state, bending.workspace, bending.own).status,
        0U);
    EXPECT_LE(off(poses), 1e-14) << i;
  }
  const Eigen::VectorXd shape = body.bones().own;
  const runtime::BonePoses elsewhere = bent(*body.model->skeleton, -0.2, {100, 20, -3});
  runtime::put_on_bones(*body.full, elsewhere, body.state);
  EXPECT_LE(off(elsewhere), 1e-13);
  EXPECT_EQ((body.bones().own - shape).norm(), 0);
  EXPECT_EQ(body.state.full->v.norm(), 0);
}

// A body that was put onto bones in a steady motion goes along: nothing moves beside them, in no step.
TEST(Skeleton, TakesTheBodyAlongFromTheFirstStep) {
  BoneBar body(3);
  runtime::StepScene scene = body.scene(0.004);
  scene.gravity.setZero();
  scene.gravity_force.setZero();
  Bending bending(body, scene);
  for (int i = 1; i <= 20; ++i) {
    bending.step(0, {0.03 * i, -0.01 * i, 0.02 * i});
    EXPECT_LE(body.bones().own.lpNorm<Eigen::Infinity>(), 1e-12) << i;
  }
}

// Far from the origin a body does what it does there, to what rounding leaves of its digits.
TEST(Skeleton, GoesOnFarFromTheOriginAsThere) {
  Eigen::VectorXd here, there;
  for (const double far : {0.0, 1e5}) {
    BoneBar body(3);
    const runtime::StepScene scene = body.scene(0.004);
    Bending bending(body, scene);
    runtime::put_on_bones(*body.full, bent(*body.model->skeleton, 0, {far, 0, 0}), body.state);
    for (int i = 0; i < 50; ++i) bending.step(0.3 * std::sin(0.1 * (i + 1)), {far + 0.01 * i, 0, 0});
    (far == 0 ? here : there) = body.bones().own;
  }
  EXPECT_GE(here.lpNorm<Eigen::Infinity>(), 1e-3);
  EXPECT_LE((here - there).lpNorm<Eigen::Infinity>(), 1e-8);
}

// A state as numbers goes on to the last bit.
TEST(Skeleton, GoesOnFromItsNumbers) {
  BoneBar body(3), other(3);
  const runtime::StepScene scene = body.scene(0.004);
  Bending bending(body, scene), others(other, scene);
  const auto run = [](Bending& of, int from) {
    for (int i = from; i < from + 10; ++i) of.step(0.3 * std::sin(0.1 * i), {0.01 * i, 0, 0});
  };
  run(bending, 0);
  static_cast<runtime::Motion&>(*other.state.full) = *body.state.full;
  other.state.step = body.state.step;
  other.state.time = body.state.time;
  other.state.begins_anew = body.state.begins_anew;
  const Eigen::VectorXd bones = runtime::numbers_of(body.bones());
  runtime::set_numbers({bones.data(), static_cast<std::size_t>(bones.size())}, other.bones());
  run(bending, 10);
  run(others, 10);
  EXPECT_EQ((body.state.full->q - other.state.full->q).norm(), 0);
}

}  // namespace skeleton_test
}  // namespace exmat::precompute
