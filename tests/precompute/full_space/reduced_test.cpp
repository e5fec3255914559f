#include <Eigen/Core>
#include <gtest/gtest.h>
#include <tuple>

#include "common/core/error.h"
#include "precompute/shape_space/region_window.h"
#include "tests/precompute/full_space/full_space_bar.h"

// With all modes in its basis the reduced model is the full space in other coordinates: a clamped body's trajectories
// differ by the tolerances of the two Newton methods alone.

namespace exmat::precompute {
namespace {

// Both methods solve to residuals of 1e-11 of the forces, and targets to 1e-10 of the examples' gradients.
constexpr double kSame = 1e-10;

struct Case {
  MaterialModel material = MaterialModel::kStVenantKirchhoff;
  Integrator integrator = Integrator::kBdf2;
  int examples = 0;
  double density_gradient = 0, damping = 0;
  bool floor = false, region = false, elastic = false;
};

class ReducedTwin {
 public:
  explicit ReducedTwin(const Case& options)
      : bar_(complete_bar({.cells = {2, 1, 1},
                           .material = options.material,
                           .density_gradient = options.density_gradient,
                           .examples = options.examples})) {
    if (options.floor) bar_.model.contact = movable_contact();
    runtime::ModelOptions reduced_options;
    FullSpaceOptions full_options = targets_of({.examples = options.examples});
    if (options.region) {
      FlagVector outer = FlagVector::Zero(bar_.model.object->mesh.vertex_count());
      outer.tail(2 * outer.size() / 3).setOnes();
      add_region(bar_.model, "outer", outer);
      reduced_options.regions = {{"outer"}};
      full_options.regions = {{"outer"}};
    }
    if (options.elastic) make_elastic(reduced_options);
    auto built = runtime::build_model(bar_.model, reduced_options);
    if (!built.model) throw InputError(built.complaint);
    reduced_ = std::move(built.model);
    full_ = build_sparse_model(bar_.model, full_options);
    reduced_scene_.integrator = full_scene_.integrator = options.integrator;
    reduced_scene_.time_step = full_scene_.time_step = 0.01;
    reduced_scene_.newton = full_scene_.newton = {60, 1e-11};
    reduced_scene_.mass_damping = full_scene_.mass_damping = options.damping;
    reduced_scene_.stiffness_damping = full_scene_.stiffness_damping = 0.01 * options.damping;
    if (options.examples > 0) reduced_scene_.examples = {{400, 2, 0.5}};
    if (options.region) reduced_scene_.examples.push_back({2000, 1, 0.2});
    if (options.elastic)
      for (runtime::ExampleSettings& examples : reduced_scene_.examples) {
        examples.stiffness = examples.stiffness / 500;  // 0.8 and 4 times the material
        examples.elastic = true;
      }
    full_scene_.examples = reduced_scene_.examples;
    if (options.floor)
      reduced_scene_.obstacles = {runtime::Obstacle{runtime::Plane{{0, -0.05, 0}, {0, 1, 0}}, {}, 1e6, 1e3, 0.4}};
    full_scene_.obstacles = reduced_scene_.obstacles;
    set_loads();
  }

  /// Largest distance of the two trajectories, relative to the largest displacement.
  double difference(int steps) {
    runtime::State state = runtime::make_state(*reduced_);
    runtime::prepare_contacts(*reduced_, reduced_scene_.obstacles.size(), state);
    FullSpaceState full_state = at_rest(full_);
    runtime::Workspace workspace(*reduced_, reduced_scene_);
    SparseWorkspace full_workspace(full_);
    double largest = 0, size = 0;
    for (int i = 0; i < steps; ++i) {
      EXPECT_EQ(runtime::step(*reduced_, reduced_scene_, state, workspace).status & ~runtime::kStepSubnormal, 0U) << i;
      const SparseReport report = step(full_, full_scene_, full_state, full_workspace);
      EXPECT_EQ(report.status, 0U) << i;
      contacts_ += report.contacts;
      const Eigen::VectorXd u = bar_.basis() * state.q;
      largest = std::max(largest, (u - full_.system.extend(full_state.q)).lpNorm<Eigen::Infinity>());
      size = std::max(size, u.lpNorm<Eigen::Infinity>());
      for (std::size_t k = 0; k < full_.examples.size(); ++k)
        weights_off_ = std::max(weights_off_, (state.examples[k].weights - full_state.examples[k].weights).norm());
    }
    size_ = size / bar_.length;
    return largest / size;
  }

  double size() const { return size_; }
  double weights_off() const { return weights_off_; }
  int contacts() const { return contacts_; }

 private:
  /// Elastic examples on all tets; targets in reduced coordinates.
  void make_elastic(runtime::ModelOptions& options) {
    const CubatureData& all = *bar_.model.cubature;
    TargetElasticityData data;
    data.weights = all.weights;
    data.volumes = all.volumes;
    data.gradient = data.target_gradient = all.gradient;
    data.youngs_modulus = all.youngs_modulus;
    data.poisson_ratio = all.poisson_ratio;
    bar_.model.target_elasticity = data;
    options.elastic = true;
    for (std::size_t i = 0; i < options.regions.size(); ++i) {
      RegionData& region = bar_.model.regions[i];
      const ObjectData& body = *bar_.model.object;
      FlagVector inside = FlagVector::Zero(body.mesh.vertex_count());
      inside(region.vertices).setOnes();
      const Eigen::VectorXd window = region_window(body.mesh, inside).values;
      region.target_elasticity = data;
      for (Eigen::Index j = 0; j < all.elements.size(); ++j) {
        const auto corners = body.mesh.tets.row(all.elements[j]).transpose();
        region.target_elasticity->weights[j] *= inside(corners).all() ? window(corners).mean() : 0;
      }
      options.regions[i].elastic = true;
    }
  }

  ContactData movable_contact() const {
    const ContactData all = test::surface_contact(bar_.model);
    std::vector<Eigen::Index> ids;
    for (Eigen::Index i = 0; i < all.vertices.size(); ++i)
      if (bar_.model.object->fixed[all.vertices[i]] == 0) ids.push_back(i);
    ContactData data;
    data.vertices = all.vertices(ids);
    data.positions = all.positions(ids, Eigen::all);
    data.areas = all.areas(ids);
    data.basis.resize(3 * std::ssize(ids), all.basis.cols());
    for (std::size_t i = 0; i < ids.size(); ++i)
      data.basis.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = all.basis.middleRows<3>(3 * ids[i]);
    return data;
  }

  void set_loads() {
    full_scene_.gravity = reduced_scene_.gravity = Eigen::Vector3d(0, -12, 4);
    reduced_scene_.gravity_force = runtime::gravity_force(*reduced_, full_scene_.gravity);
    const auto last = static_cast<int>(full_.rest.rows()) - 1;
    const Eigen::Vector3d force(0, 30, 90);
    full_scene_.forces = {{{last}, force, 0.05, 0.15}};
    reduced_scene_.forces = {{runtime::vertex_force(bar_.basis().middleRows<3>(3 * last), force), 0.05, 0.15}};
  }

  test::Bar bar_;
  std::unique_ptr<const runtime::Model> reduced_;
  SparseModel full_;
  runtime::StepScene reduced_scene_;
  FullSpaceScene full_scene_;
  double size_ = 0, weights_off_ = 0;
  int contacts_ = 0;
};

class ReducedOfAllModes : public testing::TestWithParam<std::tuple<MaterialModel, Integrator>> {};

TEST_P(ReducedOfAllModes, IsTheFullSpace) {
  ReducedTwin twin({.material = std::get<0>(GetParam()), .integrator = std::get<1>(GetParam())});
  EXPECT_LE(twin.difference(40), kSame);
  EXPECT_GE(twin.size(), 0.1) << "the motion is too small to tell";
}

TEST_P(ReducedOfAllModes, IsTheFullSpaceWithDampingAndExamples) {
  ReducedTwin twin(
      {.material = std::get<0>(GetParam()), .integrator = std::get<1>(GetParam()), .examples = 3, .damping = 0.5});
  EXPECT_LE(twin.difference(40), kSame);
  EXPECT_LE(twin.weights_off(), kSame);
  EXPECT_GE(twin.size(), 0.1) << "the motion is too small to tell";
}

INSTANTIATE_TEST_SUITE_P(
    All, ReducedOfAllModes,
    testing::Combine(testing::Values(MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                     MaterialModel::kCorotational),
                     testing::Values(Integrator::kBdf2, Integrator::kBackwardEuler, Integrator::kNewmark)));

TEST(ReducedOfAllModesAndARegion, IsTheFullSpace) {
  for (const double density_gradient : {0, 3}) {
    ReducedTwin twin({.examples = 3, .density_gradient = density_gradient, .damping = 0.5, .region = true});
    EXPECT_LE(twin.difference(40), kSame) << density_gradient;
    EXPECT_LE(twin.weights_off(), kSame) << density_gradient;
    EXPECT_GE(twin.size(), 0.1) << "the motion is too small to tell";
  }
}

TEST_P(ReducedOfAllModes, IsTheFullSpaceWithAnElasticExampleForce) {
  ReducedTwin twin({.material = std::get<0>(GetParam()),
                    .integrator = std::get<1>(GetParam()),
                    .examples = 3,
                    .damping = 0.5,
                    .elastic = true});
  EXPECT_LE(twin.difference(40), kSame);
  EXPECT_LE(twin.weights_off(), kSame);
  EXPECT_GE(twin.size(), 0.05) << "the motion is too small to tell";
}

TEST(ReducedOfAllModesAndARegion, IsTheFullSpaceWithElasticExampleForces) {
  ReducedTwin twin({.examples = 3, .density_gradient = 3, .damping = 0.5, .region = true, .elastic = true});
  EXPECT_LE(twin.difference(40), kSame);
  EXPECT_LE(twin.weights_off(), kSame);
  EXPECT_GE(twin.size(), 0.05) << "the motion is too small to tell";
}

// P_s is not symmetric then.
TEST(ReducedOfAllModesAndMixedDensity, IsTheFullSpace) {
  ReducedTwin twin({.examples = 3, .density_gradient = 3});
  EXPECT_LE(twin.difference(40), kSame);
}

// Backward Euler throughout: with another integrator the two may come near, and change to it, in different steps.
TEST(ReducedOfAllModesInContact, IsTheFullSpace) {
  ReducedTwin twin({.integrator = Integrator::kBackwardEuler, .floor = true});
  EXPECT_LE(twin.difference(60), 10 * kSame);  // penalties are stiff
  EXPECT_GT(twin.contacts(), 20) << "nothing touches";
}

}  // namespace
}  // namespace exmat::precompute
