#include "tests/support/sparse_space/step_potential.h"

#include <Eigen/Geometry>
#include <array>
#include <gtest/gtest.h>
#include <tuple>

#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

/// A step of a bar with damping, examples and a floor under it, far from its minimum.
class StepPotentialTest : public testing::TestWithParam<std::tuple<bool, bool>> {
 protected:
  static bool is_free() { return std::get<0>(GetParam()); }
  static bool is_elastic() { return std::get<1>(GetParam()); }

  void prepare(double density_gradient) {
    bar_ = test::make_bar({.cells = {2, 1, 1},
                           .density_gradient = density_gradient,
                           .free = is_free(),
                           .eigenfunctions = 4,
                           .examples = 2});
    bar_.model.contact = test::surface_contact(bar_.model);
    if (!is_free()) drop_fixed(*bar_.model.contact);
    FlagVector half = FlagVector::Zero(bar_.model.object->mesh.vertex_count());
    half.tail(2 * half.size() / 3).setOnes();
    add_region(bar_.model, "half", half);
    model_ = build_sparse_model(bar_.model, {.whole_body = true, .regions = {{"half"}}});
    scene_.time_step = 0.01;
    scene_.mass_damping = 3;
    scene_.stiffness_damping = 0.01;
    scene_.examples = {{300, 20, 0.5}, {200, 0, 1}};
    if (is_elastic())
      scene_.examples = {{.stiffness = 0.7, .damping = 20, .bias = 0.5, .elastic = true},
                         {.stiffness = 2, .elastic = true}};
    scene_.obstacles = {runtime::Obstacle{runtime::Plane{{0, 0.02, 0}, {0, 1, 0}}, {}, 1e6, 1e3, 0.4}};
    state_ = at_rest(model_);
    state_.v = 0.3 * test::random_vector(model_.size(), 1);
    if (is_free()) turn();
    runtime::backward_euler_form({state_.q, state_.v, state_.q_previous, state_.v, state_.v_previous}, scene_.time_step,
                                 terms_.form);
    terms_.rate_centre = Deformation(model_, state_.q).u();
    terms_.external_force = 10 * test::random_vector(model_.size(), 2);
    for (std::size_t i = 0; i < 2; ++i) {
      const FullSpaceExamples& examples = model_.examples[i];
      terms_.examples.push_back({&examples, &scene_.examples[i], examples.pose_basis() * examples.pose(1)});
      if (!is_elastic()) continue;
      MeshElasticity& own = elasticities_[i] = model_.elasticity;
      if (const auto& shares = examples.tet_shares()) own.set_shares(*shares);
      const Eigen::VectorXd target = model_.system.extend(terms_.examples.back().target);
      own.set_undeformed(model_.rest + target.reshaped<Eigen::RowMajor>(model_.rest.rows(), 3));
      terms_.examples.back().elasticity = &own;
    }
    contacts_ =
        model_.contacts->begin(scene_.obstacles, scene_.time_step, scene_.time_step, state_.q, state_.v, 0.1, {});
    for (auto& candidate : contacts_.candidates) candidate.friction_force = 5;
    terms_.contacts = &contacts_;
  }

  static void drop_fixed(ContactData& contact) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < contact.areas.size(); ++i)
      if (contact.positions(i, 0) > 1e-9) free.push_back(i);
    contact.vertices = IndexVector(contact.vertices(free));
    contact.positions = VertexArray(contact.positions(free, Eigen::all));
    contact.areas = Eigen::VectorXd(contact.areas(free));
  }

  void turn() {
    runtime::FrameMotion motion;
    motion.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()));
    const Eigen::VectorXd v = state_.v;
    state_ = make_full_space_state(model_, 0.02 * test::random_vector(model_.size(), 3), motion);
    state_.v = v;
  }

  test::Bar bar_;
  SparseModel model_;
  FullSpaceScene scene_;
  FullSpaceState state_;
  StepTerms terms_;
  VertexContacts::Step contacts_;
  std::array<MeshElasticity, 2> elasticities_;
};

TEST_P(StepPotentialTest, GradientIsTheDerivativeOfTheValue) {
  prepare(2);
  StepPotential potential(model_, scene_, state_, terms_);
  const Eigen::VectorXd d = scene_.time_step * state_.v + 2e-3 * test::random_vector(model_.size(), 4);
  Eigen::VectorXd gradient;
  potential.start(scene_.time_step * state_.v);
  potential.prepare();
  const auto evaluation = potential.evaluate(d, gradient);
  ASSERT_GT(contacts_.touching, 2);
  EXPECT_NEAR(potential.value(d).value, evaluation.potential.value, 1e-12 * evaluation.potential.magnitude);
  const Eigen::VectorXd direction = test::random_vector(model_.size(), 5);
  // The contacts' second derivative jumps: forward and backward differences would not agree to more.
  constexpr double kStep = 1e-7;
  const double difference =
      (potential.value(d + kStep * direction).value - potential.value(d - kStep * direction).value) / (2 * kStep);
  EXPECT_NEAR(gradient.dot(direction), difference, 1e-6 * gradient.norm() * direction.norm());
}

// All of it for a clamped body; of a free one without how its frame turns.
TEST_P(StepPotentialTest, ProductIsThatOfTheSecondDerivative) {
  prepare(0);
  StepPotential potential(model_, scene_, state_, terms_);
  const Eigen::VectorXd d = scene_.time_step * state_.v + 2e-3 * test::random_vector(model_.size(), 4);
  Eigen::VectorXd gradient, ahead, behind;
  potential.start(scene_.time_step * state_.v);
  potential.prepare();
  const Eigen::VectorXd direction = test::random_vector(model_.size(), 5);
  constexpr double kStep = 1e-8;
  potential.evaluate(d + kStep * direction, ahead);
  potential.evaluate(d - kStep * direction, behind);
  potential.evaluate(d, gradient);
  potential.assemble(d, runtime::Tangent::kExact);
  const Eigen::VectorXd expected = (ahead - behind) / (2 * kStep);
  const double error = (potential.product(direction) - expected).norm() / expected.norm();
  RecordProperty("error", std::to_string(error));
  EXPECT_LE(error, is_free() ? 0.02 : 1e-6);  // 1e-6: of differences over 1e-8
}

// Parameters: clamped or free, linear or elastic example forces.
INSTANTIATE_TEST_SUITE_P(ClampedAndFree, StepPotentialTest, testing::Combine(testing::Bool(), testing::Bool()));

}  // namespace
}  // namespace exmat::precompute
