#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

#include "common/mesh/geometry.h"
#include "tests/runtime/sim/world/touching_blocks.h"
#include "tests/support/mesh_distance.h"

namespace exmat::runtime {
namespace {

constexpr double kLength = 2, kWidth = 0.1;  // [m]
constexpr int kArcs = 9;

/// A bar that is held at its beginning and bends into arcs of up to 1.2 turns: its basis spans some of them.
struct BendingBar {
  explicit BendingBar(double time_step, bool meets_itself)
      : bar(exmat::test::make_bar({.cells = {16, 2, 2}, .lengths = {kLength, kWidth, kWidth}, .linear_modes = 1})) {
    RowMatrix basis(bar.mass.rows(), kArcs);
    for (int k = 0; k < kArcs; ++k) {
      Eigen::VectorXd column = arc(2.4 * std::numbers::pi * (k + 1) / kArcs);
      for (int pass = 0; pass < 2; ++pass)
        column -= basis.leftCols(k) * (basis.leftCols(k).transpose() * (bar.mass * column)).eval();
      basis.col(k) = column / std::sqrt(column.dot(bar.mass * column));
    }
    const ObjectData& object = *bar.model.object;
    bar.model.modal->basis = basis;
    bar.model.modal->gravity_load.setZero(3, kArcs);
    RowMatrix& gradient = bar.model.cubature->gradient;
    gradient.setZero(9 * object.mesh.tet_count(), kArcs);
    bar.model.cubature->heldout_poses.resize(0, kArcs);
    for (Eigen::Index t = 0; t < object.mesh.tet_count(); ++t) {
      const auto shape = shape_gradients(tet_positions(object.mesh, t));
      for (int corner = 0; corner < 4; ++corner)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            gradient.row(9 * t + 3 * a + b) += shape(corner, b) * basis.row(3 * object.mesh.tets(t, corner) + a);
    }
    bar.model.contact = exmat::test::surface_contact(bar.model);
    model = build_model(bar.model, {}).model;
    scene.time_step = time_step;
    scene.mass_damping = 4;
    scene.gravity_force = Eigen::VectorXd::Zero(kArcs);
    surface = std::make_shared<TouchingSurface>(
        *model->contact, BodySurface::of_tets(object.mesh.tets, object.mesh.vertices, basis, model->frame->origin()),
        meets_itself);
  }

  /// Displacements [3n] of the middle into an arc of so many radians, up from the x axis.
  Eigen::VectorXd arc(double angle) const {
    const VertexArray& rest = bar.model.object->mesh.vertices;
    Eigen::VectorXd field(3 * rest.rows());
    const double radius = kLength / angle;
    for (Eigen::Index i = 0; i < rest.rows(); ++i) {
      const double turn = angle * rest(i, 0) / kLength, away = radius + kWidth / 2 - rest(i, 2);
      field.segment<3>(3 * i) << away * std::sin(turn) - rest(i, 0), 0,
          kWidth / 2 + radius - away * std::cos(turn) - rest(i, 2);
    }
    return field;
  }
  Eigen::VectorXd reduced(const Eigen::VectorXd& field) const { return bar.basis().transpose() * (bar.mass * field); }

  /// Depth of the deepest vertex of its second half in the first [m].
  double deepest(const Eigen::VectorXd& q) const {
    const ObjectData& object = *bar.model.object;
    const VertexArray now =
        object.mesh.vertices + (bar.basis() * q).reshaped<Eigen::RowMajor>(object.mesh.vertex_count(), 3);
    const auto in_first = [&](std::int32_t vertex) { return object.mesh.vertices(vertex, 0) < 0.5 * kLength - 1e-9; };
    TriangleArray first(0, 3);
    for (Eigen::Index t = 0; t < object.surface.rows(); ++t) {
      const auto corners = object.surface.row(t);
      if (!in_first(corners[0]) || !in_first(corners[1]) || !in_first(corners[2])) continue;
      first.conservativeResize(first.rows() + 1, 3);
      first.bottomRows<1>() = corners;
    }
    double depth = 0;
    for (std::int32_t i = 0; i < now.rows(); ++i) {
      const Eigen::Vector3d x = now.row(i);
      if (object.mesh.vertices(i, 0) < 0.75 * kLength || exmat::test::winding_number(now, first, x) < 0.5) continue;
      depth = std::max(depth, exmat::test::distance_to_all(now, first, x));
    }
    return depth;
  }

  exmat::test::Bar bar;
  std::unique_ptr<const Model> model;
  StepScene scene;
  std::shared_ptr<const TouchingSurface> surface;
};

// A steady pull bends the bar on and on; as a ring it meets its own beginning, and stops there.
TEST(Ring, OfABarThatIsBentTouchesItsOwnEnd) {
  for (const double time_step : {1e-3, 1.0 / 120}) {
    double deepest[2] = {};
    for (const bool meets_itself : {false, true}) {
      SCOPED_TRACE(testing::Message() << time_step << " s, " << meets_itself);
      const BendingBar ring(time_step, meets_itself);
      const Eigen::VectorXd start = ring.reduced(ring.arc(5));
      State state = make_state(*ring.model, start, Eigen::VectorXd::Zero(kArcs));
      prepare_contacts(*ring.model, 0, state);
      Workspace scratch(*ring.model, ring.scene);
      // Force that holds an arc of 1.05 turns.
      const Eigen::VectorXd held = ring.reduced(ring.arc(2.1 * std::numbers::pi));
      state.applied_force = ring.bar.basis().transpose() * full_internal_force(ring.bar, ring.bar.basis() * held);
      World world({{{ring.model.get(), &ring.scene, ring.surface}, std::move(state)}}, {1e8, 1e5, 0.3});
      int touching = 0;
      for (int i = 0; i < static_cast<int>(3 / time_step); ++i) {
        const WorldReport report = world.step(1);
        ASSERT_EQ(report.unconverged_islands, 0) << i;
        touching += report.touching_pairs;
      }
      deepest[meets_itself ? 1 : 0] = ring.deepest(world.state(0).q);
      EXPECT_EQ(touching > 0, meets_itself);
    }
    EXPECT_GT(deepest[0], 0.02);
    EXPECT_LT(deepest[1], 1e-3);
  }
}

}  // namespace
}  // namespace exmat::runtime
