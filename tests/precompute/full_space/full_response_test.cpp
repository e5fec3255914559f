#include "runtime/sim/space/full/full_response.h"

#include <gtest/gtest.h>
#include <utility>

#include "common/core/decompositions.h"
#include "runtime/sim/step/impulse_response.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/random.h"

// Impulses on bodies in all vertices, beside the same bodies in all of their modes, whose response is a dense factor in
// double precision.
namespace exmat::precompute {
namespace full_response_test {

struct PushedBarOptions {
  bool free = false;
  int examples = 0;
  bool elastic = false;  ///< their force
  double deformed = 0;   ///< coordinates of the modes, about [m kg^(1/2)]
  bool turns = false;    ///< and moves, a free one
};

struct PushedBar {
  explicit PushedBar(const PushedBarOptions& options) : bar(make(options)) {
    const bool pulls = options.examples > 0;
    model = std::move(runtime::build_model(bar.model, {.examples = pulls, .elastic = options.elastic}).model);
    full = std::move(runtime::build_full_model(bar.model, *model).model);
    if (pulls)
      scene.examples = {{.stiffness = options.elastic ? 2.0 : 3000.0,
                         .damping = options.elastic ? 0.0 : 2.0,
                         .bias = 0.4,
                         .elastic = options.elastic}};
    scene.time_step = 0.004;
    scene.mass_damping = 2;
    scene.stiffness_damping = 0.002;
    const Eigen::VectorXd q = options.deformed * test::random_vector(model->modes(), 1);
    state = runtime::make_state(*model, q, options.free && !options.turns ? 0 * q : 3 * q);
    if (options.turns) {
      runtime::FrameMotion motion;
      motion.orientation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
      motion.linear_velocity = {0.3, 0, -0.2};
      motion.angular_velocity = {1, -2, 3};
      runtime::set_motion(*model, motion, state);
    }
    workspace.emplace(*model, scene);
    runtime::refresh_weights(*model, scene, state, *workspace);
    own.emplace(*full, scene);
    in_full = state;
    runtime::enter_full_space(*full, *model, in_full);
    // A vertex of the last end, and a point within a tet.
    const TetMesh& mesh = bar.model.object->mesh;
    const Eigen::Index tet = mesh.tet_count() - 1;
    corners.setZero(2, 4);
    shares.setZero(2, 4);
    corners.row(0).setConstant(static_cast<std::int32_t>(mesh.vertex_count() - 1));
    shares(0, 0) = 1;
    corners.row(1) = mesh.tets.row(tet);
    shares.row(1) << 0.1, 0.2, 0.3, 0.4;
    rest = VertexArray::Zero(2, 3);
    rows = RowMatrix::Zero(6, model->modes());
    for (Eigen::Index i = 0; i < 2; ++i)
      for (Eigen::Index c = 0; c < 4; ++c) {
        rest.row(i) += shares(i, c) * mesh.vertices.row(corners(i, c));
        rows.middleRows<3>(3 * i) += shares(i, c) * bar.basis().middleRows<3>(3 * corners(i, c));
      }
  }

  static test::Bar make(const PushedBarOptions& options) {
    test::Bar bar = complete_bar({.cells = {4, 1, 1}, .free = options.free, .examples = options.examples});
    if (options.examples > 0) bar.model.full_space = full_space_data_of(bar.model);
    if (options.elastic) make_elastic(bar.model);
    return bar;
  }
  runtime::MaterialPoints points_in_modes() const { return {rest, rows}; }
  runtime::VertexPoints points() const { return {corners, shares}; }
  runtime::FullImpulseResponse response() { return {*full, *model, scene, in_full, *workspace, *own}; }
  /// With the tangent of all vertices, which is the exact one.
  runtime::ImpulseResponse expected() {
    runtime::ImpulseResponse response(*model, scene, state);
    response.update(scene.time_step, runtime::Tangent::kExact);
    return response;
  }

  test::Bar bar;
  std::unique_ptr<const runtime::Model> model;
  std::unique_ptr<const runtime::FullModel> full;
  runtime::StepScene scene;
  runtime::State state, in_full;
  std::optional<runtime::Workspace> workspace;
  std::optional<runtime::FullWorkspace> own;
  IndexMatrix corners;
  RowMatrix shares;
  VertexArray rest;
  RowMatrix rows;
};

std::vector<PushedBarOptions> cases() {
  return {{.deformed = 0.01},
          {.free = true, .deformed = 0.002},
          {.free = true, .deformed = 0.002, .turns = true},
          {.examples = 3, .deformed = 0.01},
          {.free = true, .examples = 3},
          {.examples = 3, .elastic = true, .deformed = 0.01}};
}

TEST(FullResponse, IsThatOfAllModes) {
  for (const PushedBarOptions& options : cases()) {
    PushedBar body(options);
    const runtime::ImpulseResponse reference = body.expected();
    const Eigen::MatrixXd J = reference.jacobian(body.points_in_modes());
    const Eigen::MatrixXd expected = J * reference.solve(J.transpose());
    const Eigen::MatrixXd W = body.response().compliance(body.points());
    EXPECT_LE((W - expected).norm(), 1e-4 * expected.norm());
    EXPECT_LE((W - W.transpose()).norm(), 1e-4 * expected.norm());
    const Eigen::VectorXd velocity = reference.velocity(body.points_in_modes());
    EXPECT_LE((body.response().velocity(body.points()) - velocity).norm(), 1e-12 * (1 + velocity.norm()));
  }
}

TEST(FullResponse, MovesTheBodyAsThatOfAllModes) {
  for (const PushedBarOptions& options : cases()) {
    PushedBar body(options);
    const Eigen::VectorXd impulses = 0.1 * test::random_vector(6, 2);
    const Eigen::VectorXd before = body.in_full.full->q, v_before = body.in_full.full->v;
    runtime::FrameMomenta momenta;
    if (options.free) momenta = *body.model->frame->momenta(body.state.frame);
    const Eigen::Vector3d centre = body.model->frame->placement(body.state.frame).position;
    for (Eigen::Index i = 0; i < 2; ++i) {
      const Eigen::Vector3d own = impulses.segment<3>(3 * i);
      momenta.linear += own;
      momenta.angular += (body.expected().place(body.points_in_modes(), i) - centre).cross(own);
    }
    body.response().apply(body.points(), impulses);
    body.expected().apply(body.points_in_modes(), impulses, *body.workspace, body.state);
    if (options.free) {
      const runtime::FrameMomenta after = *body.model->frame->momenta(body.in_full.frame);
      EXPECT_LE((after.linear - momenta.linear).norm(), 1e-12 * momenta.linear.norm());
      EXPECT_LE((after.angular - momenta.angular).norm(), 1e-12 * momenta.angular.norm());
    }
    // In the modes velocities turn along with the frame.
    if (options.turns) continue;
    runtime::enter_full_space(*body.full, *body.model, body.state);
    const double off = (body.in_full.full->q - body.state.full->q).norm(), way = (body.in_full.full->q - before).norm();
    const double v_off = (body.in_full.full->v - body.state.full->v).norm(),
                 change = (body.in_full.full->v - v_before).norm();
    EXPECT_LE(off, 1e-4 * way);
    EXPECT_LE(v_off, 1e-4 * change);
    EXPECT_NEAR(body.in_full.elastic_energy, body.state.elastic_energy, 1e-4 * body.state.elastic_energy);
  }
}

}  // namespace full_response_test
}  // namespace exmat::precompute
