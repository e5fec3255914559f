#include <gtest/gtest.h>
#include <numbers>

#include "tests/runtime/sim/world/half_spheres.h"

namespace exmat::runtime {
namespace {

using test::HalfSphere;
using test::HalfSphereOptions;

/// Two equal half spheres whose equators are held, pole on pole.
struct Pressed {
  double force = 0;           ///< that holds them [N]
  double middle_force = 0;    ///< on the vertex at the pole [N]
  double contact_radius = 0;  ///< farthest vertex that is pressed [m]
};

/// Hertz's theory of two equal spheres of a radius R, the approach d [m] of whose centres is 2 a^2 / R, a the
/// radius of the contact (Johnson, Contact Mechanics, 1985, section 4.2).
struct Hertz {
  Hertz(const HalfSphereOptions& sphere, double contact_radius)
      : approach(2 * contact_radius * contact_radius / sphere.radius),
        modulus(sphere.youngs_modulus / 2 / (1 - sphere.poisson_ratio * sphere.poisson_ratio)),
        force(4.0 / 3 * modulus * std::sqrt(sphere.radius / 2) * std::pow(approach, 1.5)),
        pressure(1.5 * force / (std::numbers::pi * contact_radius * contact_radius)) {}
  double approach, modulus, force;
  double pressure;  ///< in the middle [Pa]
};

struct HeldBody {
  HeldBody(ReducedModel of, const StepScene& scene) : reduced(std::move(of)), model(build_model(reduced, {}).model) {
    const TetMesh& mesh = reduced.object->mesh;
    auto surface = std::make_shared<TouchingSurface>(
        *model->contact, BodySurface::of_tets(mesh.tets, mesh.vertices, reduced.modal->basis, model->frame->origin()),
        /*meets_itself=*/false);
    kind = {model.get(), &scene, std::move(surface)};
  }
  WorldBodyStart start() const {
    State state = make_state(*model);
    prepare_contacts(*model, 0, state);
    return {kind, std::move(state)};
  }
  ReducedModel reduced;
  std::unique_ptr<const Model> model;
  BodyKind kind;
};

Pressed press(const HalfSphere& sphere, const Eigen::MatrixXd& shapes, double approach, double stiffness) {
  StepScene scene;
  scene.time_step = 100;  // each step ends at rest, whatever the inertia
  scene.integrator = Integrator::kBackwardEuler;
  scene.gravity_force = Eigen::VectorXd::Zero(shapes.cols());
  const double radius = sphere.options().radius;
  const HeldBody lower(sphere.body(shapes, 0, /*upwards=*/true), scene),
      upper(sphere.body(shapes, 2 * radius - approach, /*upwards=*/false), scene);
  World world({lower.start(), upper.start()}, {stiffness, 0, 0});
  Pressed result;
  for (int i = 0; i < 4; ++i) {  // surfaces are where they were when the step began
    const double before = result.force;
    EXPECT_EQ(world.step(1).unconverged_islands, 0) << i;
    result.force = world.report(1).contact_force[2];
    EXPECT_NEAR(world.report(0).contact_force[2], -result.force, 1e-9 * result.force);
    if (i == 3) {
      EXPECT_NEAR(result.force, before, 2e-3 * result.force);
    }
  }
  std::vector<BodyTouch> touches;
  world.read_touches(touches);
  for (const BodyTouch& touch : touches) {
    const double away = touch.position.head<2>().norm();
    result.contact_radius = std::max(result.contact_radius, away);
    if (away < 1e-9) result.middle_force += touch.force.norm();
  }
  return result;
}

// Hertz takes spheres for half spaces, which they are where a is small beside R: that their equators are held, a
// distance R away, makes them stiffer by the order of a / R. Edges of 0.005 R and chords of 15 degrees do the rest:
// measured, 2.6 % at a / R = 0.03, where the contact is six edges wide, and 4.4 % at 0.07.
TEST(Hertz, TwoSpheresArePressedTogether) {
  HalfSphereOptions options;
  options.finest = 0.005;
  options.fine_until = 0.09;
  const HalfSphere sphere(options);
  const Eigen::MatrixXd shapes = sphere.pressed_shapes(options.fine_until);
  std::vector<double> approaches, forces;
  for (const double radius : {0.03, 0.07}) {
    SCOPED_TRACE(testing::Message() << "a / R = " << radius);
    const Hertz hertz(options, radius);
    // A thousand times as stiff as what it presses: pressure over approach.
    const Pressed run = press(sphere, shapes, hertz.approach, 1000 * hertz.pressure / hertz.approach);
    RecordProperty("force_" + std::to_string(radius), std::to_string(run.force / hertz.force));
    EXPECT_NEAR(run.force, hertz.force, 0.05 * hertz.force);
    EXPECT_NEAR(run.contact_radius, radius, options.finest);
    // Few edges lie across the contact: the mean over the vertex's share of the surface.
    EXPECT_NEAR(run.middle_force / sphere.pole_area(), hertz.pressure, 0.08 * hertz.pressure);
    approaches.push_back(hertz.approach);
    forces.push_back(run.force);
  }
  const double exponent = std::log(forces.back() / forces.front()) / std::log(approaches.back() / approaches.front());
  EXPECT_NEAR(exponent, 1.5, 0.015);
}

}  // namespace
}  // namespace exmat::runtime
