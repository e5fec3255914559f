#include "runtime/sim/step/impulse_response.h"

#include <cmath>
#include <gtest/gtest.h>

#include "common/core/decompositions.h"
#include "runtime/sim/step/stepper.h"
#include "tests/support/random.h"
#include "tests/support/synthetic_model.h"

// Impulses that a host gives to points of a body, beside the momenta of its vertices and beside one solution for a body
// and a mass that is joined to it.
namespace exmat::runtime {
namespace impulse_response_test {

struct Pushed {
  explicit Pushed(const test::BarOptions& options) : bar(test::make_bar(options)) {
    model = std::move(build_model(bar.model, {}).model);
    scene.time_step = 1.0 / 240;
    scene.integrator = Integrator::kBackwardEuler;
    scene.newton.tolerance = 1e-10;
    scene.gravity = {0, 0, -9.81};
    scene.gravity_force = gravity_force(*model, scene.gravity);
    state = make_state(*model);
  }

  void add_point(Eigen::Index vertex) {
    rest.conservativeResize(rest.rows() + 1, 3);
    rows.conservativeResize(rows.rows() + 3, model->modes());
    rest.row(rest.rows() - 1) = bar.model.object->mesh.vertices.row(vertex);
    rows.bottomRows<3>() = bar.basis().middleRows<3>(3 * vertex);
  }
  MaterialPoints points() const { return {rest, rows}; }
  Eigen::Index tip() const {
    Eigen::Index found = 0;
    bar.model.object->mesh.vertices.col(0).maxCoeff(&found);
    return found;
  }
  Eigen::Vector3d position(Eigen::Index i) const {
    const Eigen::Vector3d own = rest.row(i).transpose() + rows.middleRows<3>(3 * i) * state.q;
    return model->frame->placement(state.frame).to_world(own);
  }

  test::Bar bar;
  std::unique_ptr<const Model> model;
  StepScene scene;
  State state;
  VertexArray rest;
  RowMatrix rows;
};

TEST(ImpulseResponse, ChangesMomentaByTheImpulses) {
  Pushed body({.free = true});
  body.add_point(0);
  body.add_point(body.tip());
  Workspace workspace(*body.model, body.scene);
  const Eigen::VectorXd q = 0.02 * test::random_vector(body.model->modes(), 1);
  body.state = make_state(*body.model, q, 3 * q);
  FrameMotion motion;
  motion.orientation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
  motion.angular_velocity = Eigen::Vector3d(1, -2, 3);
  set_motion(*body.model, motion, body.state);
  const Eigen::VectorXd impulses = test::random_vector(6, 2);
  const FrameMomenta before = *body.model->frame->momenta(body.state.frame);
  const Eigen::Vector3d centre = body.model->frame->placement(body.state.frame).position;
  Eigen::Vector3d linear = before.linear, angular = before.angular;
  for (Eigen::Index i = 0; i < 2; ++i) {
    linear += impulses.segment<3>(3 * i);
    angular += (body.position(i) - centre).cross(Eigen::Vector3d(impulses.segment<3>(3 * i)));
  }
  ImpulseResponse(*body.model, body.scene, body.state).apply(body.points(), impulses, workspace, body.state);
  const FrameMomenta after = *body.model->frame->momenta(body.state.frame);
  EXPECT_LE((after.linear - linear).norm(), 1e-12 * linear.norm());
  EXPECT_LE((after.angular - angular).norm(), 1e-12 * angular.norm());
}

// Velocities after a step to which the force P / dt is added, less those without it.
TEST(ImpulseResponse, IsThatOfAStep) {
  for (const bool free : {true, false}) {
    Pushed body({.free = free});
    body.add_point(body.tip());
    Workspace workspace(*body.model, body.scene);
    const double dt = body.scene.time_step;
    const ImpulseResponse response(*body.model, body.scene, body.state);
    const Eigen::MatrixXd J = response.jacobian(body.points());
    const Eigen::Matrix3d W = J * response.solve(J.transpose());
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d impulse = 1e-3 * Eigen::Vector3d::Unit(axis);
      Eigen::Vector3d ends[2];
      for (const int pushed : {0, 1}) {
        State state = make_state(*body.model);
        if (pushed == 1) {
          state.applied_force = body.rows.transpose() * impulse / dt;
          const Eigen::Vector3d arm = body.rest.row(0).transpose() - body.model->frame->placement(state.frame).position;
          body.model->frame->apply(impulse / dt, arm.cross(impulse) / dt, state.frame);
        }
        ASSERT_EQ(step(*body.model, body.scene, state, workspace).status, 0U);
        ends[pushed] = ImpulseResponse(*body.model, body.scene, state).velocity(body.points());
      }
      EXPECT_LE((ends[1] - ends[0] - W * impulse).norm(), 2e-3 * (W * impulse).norm()) << free << axis;
    }
  }
}

/// The z of a clamped bar's tip, to which a point mass is joined, by one Newton's method of backward Euler for both.
std::vector<double> joint_solution(const Pushed& body, double mass, int steps) {
  const Eigen::Index modes = body.model->modes();
  const double dt = body.scene.time_step;
  const Eigen::MatrixXd J = body.rows;
  const Eigen::MatrixXd M = Eigen::MatrixXd::Identity(modes, modes) + mass * J.transpose() * J;
  const Eigen::VectorXd load = body.scene.gravity_force + mass * J.transpose() * body.scene.gravity;
  auto scratch = body.model->internal_force.make_workspace();
  Eigen::VectorXd q = Eigen::VectorXd::Zero(modes), v = q, force(modes);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(modes, modes);
  std::vector<double> z;
  for (int i = 0; i < steps; ++i) {
    const Eigen::VectorXd start = q;
    for (int iteration = 0; iteration < 20; ++iteration) {
      body.model->internal_force.force_and_stiffness(q, scratch, force, stiffness);
      const Eigen::MatrixXd K = stiffness.selfadjointView<Eigen::Lower>();
      const Eigen::VectorXd residual = M * ((q - start) / dt - v) / dt + force - load;
      q -= (M / (dt * dt) + K).partialPivLu().solve(residual);
    }
    v = (q - start) / dt;
    z.push_back((J * q)[2]);
  }
  return z;
}

// A mass of the host's own, held by the impulses that make its velocity that of the tip, 1 : 1000 and 1000 : 1. Each
// step begins with those of the last one as forces.
TEST(ImpulseResponse, HoldsAMassAsOneSolutionDoes) {
  for (const double ratio : {1e-3, 1.0, 1e3}) {
    Pushed body({.youngs_modulus = ratio > 1 ? 1e8 : 1e5});
    body.add_point(body.tip());
    Workspace workspace(*body.model, body.scene);
    const double mass = ratio * 62.5, dt = body.scene.time_step;
    const int steps = 240;
    const std::vector<double> expected = joint_solution(body, mass, steps);
    Eigen::Vector3d place = body.position(0), velocity = Eigen::Vector3d::Zero();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double off = 0, size = 0;
    for (int i = 0; i < steps; ++i) {
      body.state.applied_force = body.rows.transpose() * sum / dt;
      velocity -= sum / mass;
      ASSERT_EQ(step(*body.model, body.scene, body.state, workspace).status, 0U);
      velocity += dt * body.scene.gravity;
      for (int round = 0; round < 3; ++round) {
        const ImpulseResponse response(*body.model, body.scene, body.state);
        const Eigen::MatrixXd J = response.jacobian(body.points());
        const Eigen::Matrix3d W = J * response.solve(J.transpose()) + Eigen::Matrix3d::Identity() / mass;
        const Eigen::Vector3d gap = place + dt * velocity - body.position(0);
        const Eigen::Vector3d impulse = W.inverse() * (gap / dt);
        response.apply(body.points(), impulse, workspace, body.state);
        velocity -= impulse / mass;
        sum += impulse;
      }
      place += dt * velocity;
      off = std::max(off, std::abs(body.position(0)[2] - body.rest(0, 2) - expected[static_cast<std::size_t>(i)]));
      size = std::max(size, std::abs(expected[static_cast<std::size_t>(i)]));
    }
    EXPECT_GT(size, 1e-4);
    EXPECT_LE(off, 0.02 * size) << ratio;
  }
}

}  // namespace impulse_response_test
}  // namespace exmat::runtime
