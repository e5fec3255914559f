#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/decompositions.h"
#include "common/hdf5/hdf5_file.h"
#include "precompute/shape_space/laplace_basis.h"
#include "precompute/shape_space/region_view.h"
#include "tests/integration/support.h"
#include "tests/support/scene_run.h"

namespace exmat {
namespace {

using test::Json;
using testing::HasSubstr;

const Json kOuterHalf = {{"box", {{"min", {1.99, -1, -1}}, {"max", {9, 2, 2}}}}};

// A clamped bar whose outer half has the twist for its example.
Json outer_half(const Json& changes = Json::object()) {
  Json asset = {{"regions", {{{"name", "outer"}, {"vertices", kOuterHalf}, {"examples", {"twist"}}}}},
                {"internal_force", "cubature"}};
  asset.merge_patch(changes);
  return asset;
}

// Norms of a field [3n] over the vertices inside and outside, each weighing the same.
std::pair<double, double> norms(const Eigen::VectorXd& field, const IndexVector& inside) {
  Eigen::VectorXd outside = field;
  double square = 0;
  for (const int v : inside) {
    square += field.segment<3>(3 * v).squaredNorm();
    outside.segment<3>(3 * v).setZero();
  }
  return {std::sqrt(square), outside.norm()};
}

// The part of a displacement that the shape space has, with the mean that it drops.
Eigen::VectorXd in_shape_space(const ReducedModel& model, const Eigen::VectorXd& displacement) {
  const ShapeSpaceData& space = *model.shape_space;
  Eigen::VectorXd field = Eigen::VectorXd::Zero(displacement.size());
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(displacement.size() / 3);
  const Eigen::VectorXd density = Eigen::VectorXd::Ones(model.object->mesh.tet_count());
  const auto along = [&](const Eigen::VectorXd& function, int axis) {
    Eigen::VectorXd lifted = Eigen::VectorXd::Zero(displacement.size());
    lifted(Eigen::seqN(axis, function.size(), 3)) = function;
    return lifted;
  };
  const auto project = [&](const Eigen::VectorXd& function) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::VectorXd lifted = along(function, axis);
      field += test::mass_product(model.object->mesh, density, lifted, displacement) / space.volume * lifted;
    }
  };
  project(ones);
  for (Eigen::Index i = 0; i < space.eigenvalues.size(); ++i) project(space.eigenfunctions.col(i));
  return field;
}

class Regions : public testing::Test {
 protected:
  ReducedModel build_bar(const Json& changes = Json::object()) {
    built_ = test::build(test::write_bar(folder_, bar_, outer_half(changes)));
    return test::through_bundle(built_.model, folder_.path("bundle.h5"));
  }
  // Reduced coordinates after so many steps of a scene.
  Eigen::VectorXd run(const Json& scene) {
    const test::LoadedRun loaded(load_scene(test::write_scene(folder_, scene)));
    runtime::Bodies bodies = loaded.bodies();
    while (bodies.steps() < loaded.config.steps) bodies.step();
    return bodies.world().state(0).q;
  }

  test::TemporaryFolder folder_;
  test::BarFiles bar_;
  test::Built built_;
};

TEST_F(Regions, HaveTheirOwnPartOfTheBundle) {
  const ReducedModel model = build_bar();
  ASSERT_EQ(model.regions.size(), 1U);
  const RegionData& region = model.regions.front();
  EXPECT_FALSE(model.examples || model.projection || model.targets);  // no example is left for the body as a whole
  EXPECT_EQ(region.name, "outer");
  ASSERT_EQ(region.examples.examples.size(), 2U);
  EXPECT_EQ(region.examples.examples[1].name, "twist");
  EXPECT_TRUE(region.targets);
  for (const int v : region.vertices) EXPECT_GE(model.object->mesh.vertices(v, 0), 1.99);
  const auto& [T, T_plus, scale, Z] = region.projection;
  const RowMatrix filter = T_plus * T;
  EXPECT_LE((filter - filter.transpose()).norm(), 1e-12 * filter.norm());
  EXPECT_GE(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(filter)).eigenvalues().minCoeff(), -1e-12);
  EXPECT_THAT(validate_bundle(folder_.path("bundle.h5")), testing::IsEmpty());
  EXPECT_LE(region.examples.examples[1].basis_error, 0.01);  // the basis holds the pose
}

// The target leaves the inner half where it is, and so does the body that is drawn to it: what it feels is that the
// outer half is twisted against its own border. A stiffer force brings it nearer to its pose.
TEST_F(Regions, MoveAndLeaveTheRestToPhysics) {
  const ReducedModel model = build_bar();
  const RegionData& region = model.regions.front();
  const Eigen::VectorXd target = model.modal->basis * region.examples.examples[1].pose;
  const auto [target_inside, target_outside] = norms(in_shape_space(model, target), region.vertices);
  double reached = 0;
  for (const double stiffness : {100.0, 500.0}) {
    const Eigen::VectorXd q =
        run({{"steps", 2000},
             {"time_step", 0.01},
             {"integrator", "backward_euler"},
             {"regions", {{{"name", "outer"}, {"stiffness", stiffness}, {"damping", 20}, {"bias", 0}}}}});
    const Eigen::VectorXd moved = model.modal->basis * q;
    const auto [inside, outside] = norms(in_shape_space(model, moved), region.vertices);
    fmt::print("kappa {}: outside over inside {:.4f}, of the target {:.4f}; inside over the target's {:.3f}\n",
               stiffness, outside / inside, target_outside / target_inside, inside / target_inside);
    EXPECT_LE(outside, 0.05 * inside) << stiffness;
    EXPECT_GT(inside, reached);
    reached = inside;
  }
  EXPECT_LE(target_outside, 0.05 * target_inside);
  EXPECT_GE(reached, 0.5 * target_inside);
}

TEST_F(Regions, ActBesideTheWholeBody) {
  bar_.bend = 0.3;
  const Json both = {{"examples",
                      {{{"name", "rest"}, {"mesh", "rest.msh"}, {"rest", true}},
                       {{"name", "twist"}, {"mesh", "twist.msh"}},
                       {{"name", "everywhere"}, {"mesh", "twist.msh"}}}}};
  const ReducedModel model = build_bar(both);
  ASSERT_TRUE(model.examples);
  EXPECT_EQ(model.examples->examples[1].name, "everywhere");
  EXPECT_EQ(model.examples->examples.size(), 2U);
  EXPECT_EQ(model.regions.front().examples.examples.size(), 2U);

  // A scene takes what it names.
  const auto config = load_scene(test::write_scene(folder_, {{"regions", {{{"name", "outer"}, {"stiffness", 10}}}}}));
  const auto loaded = runtime::load_run(config);
  EXPECT_FALSE(loaded.model->has_whole_body_examples());
  EXPECT_EQ(loaded.model->region_count(), 1);
  for (const ReadRecord& record : loaded.records) EXPECT_FALSE(record.dataset.starts_with("/examples/"));
  const test::Built lean = test::build(folder_.path("asset.json"), needs_of(config));
  EXPECT_FALSE(lean.model.examples);
  EXPECT_EQ(lean.model.regions.size(), 1U);
  const test::Built without = test::build(folder_.path("asset.json"), needs_of(SceneConfig{}));
  EXPECT_TRUE(without.model.regions.empty());
  EXPECT_FALSE(without.model.shape_space);
}

// An example's descriptor is that of the body when it has the example's shape: both are seen through one window. The
// pose is of the object's own mesh, brought back by the rotation and the scale that the bundle names.
TEST_F(Regions, SeeTheirExamplesAsTheySeeTheBody) {
  bar_.example_cells = bar_.cells;
  const ReducedModel model = build_bar();
  const RegionData& region = model.regions.front();
  const TetMesh& mesh = model.object->mesh;
  FlagVector inside = FlagVector::Zero(mesh.vertex_count());
  inside(region.vertices).setOnes();
  const precompute::RegionView view(mesh, inside, model.object->fixed);
  const ExampleData& twist = region.examples.examples[1];
  const VertexArray pose =
      twist.scale * test::twisted(mesh.vertices, bar_) * twist.rotation.transpose() - mesh.vertices;
  const precompute::LaplaceBasis object = precompute::laplace_basis_of(model);
  const Eigen::VectorXd moved = pose.reshaped<Eigen::RowMajor>() / std::cbrt(object.volume);
  const VertexArray seen = view.see(moved).reshaped<Eigen::RowMajor>(pose.rows(), 3);
  const RowMatrix expected = object.eigenvalues.asDiagonal() * precompute::coefficients(object, seen);
  const RowMatrix found = twist.descriptor - model.shape_space->rest_descriptor;
  EXPECT_LE((found - expected).norm(), 1e-9 * expected.norm());  // digits of the mesh files
}

// Vertices of the example that are not named keep still: of the twist only the tip's part comes over.
TEST_F(Regions, TakeTheNamedVerticesOfAnExample) {
  const ReducedModel all = build_bar();
  const ReducedModel tip = build_bar({{"regions",
                                       {{{"name", "outer"},
                                         {"vertices", kOuterHalf},
                                         {"example_vertices", {{"box", {{"min", {3.3, -1, -1}}, {"max", {9, 2, 2}}}}}},
                                         {"examples", {"twist"}}}}}});
  const auto change = [](const ReducedModel& model) {
    const RowMatrix difference = model.regions[0].examples.examples[1].descriptor - model.shape_space->rest_descriptor;
    return (model.shape_space->eigenvalues.cwiseInverse().asDiagonal() * difference).norm();
  };
  EXPECT_LE(change(tip), 0.9 * change(all));
  EXPECT_GE(change(tip), 0.1 * change(all));
}

TEST_F(Regions, ThatAreBadAreRefused) {
  const auto refusal = [&](const Json& region) -> std::string {
    Json regions = Json::array({{{"name", "outer"}, {"vertices", kOuterHalf}, {"examples", {"twist"}}}});
    regions[0].merge_patch(region);
    try {
      build_bar({{"regions", regions}});
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_THAT(refusal({{"examples", {"twst"}}}), HasSubstr("/regions/0/examples/0: expected the name of an example"));
  EXPECT_THAT(refusal({{"examples", {"rest"}}}), HasSubstr("expected the name of a posed example"));
  EXPECT_THAT(refusal({{"name", "a/b"}}), HasSubstr("/regions/0/name: expected a name without '/'"));
  EXPECT_THAT(refusal({{"vertices", {{"box", {{"min", {-1, -1, -1}}, {"max", {0.001, 2, 2}}}}}}}),
              HasSubstr("/regions/0/vertices: expected vertices of the object, some of them not fixed"));
  EXPECT_THAT(refusal({{"vertices", {{"box", {{"min", {50, -1, -1}}, {"max", {60, 2, 2}}}}}}}),
              HasSubstr("expected at least one vertex of the mesh"));

  build_bar();
  const auto loading = [&](const Json& scene) -> std::string {
    try {
      runtime::load_run(load_scene(test::write_scene(folder_, scene)));
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_THAT(loading({{"regions", {{{"name", "inner"}, {"stiffness", 1}}}}}),
              HasSubstr("scene.json: /regions/0/name: expected a region of"));
  EXPECT_THAT(loading({{"regions", {{{"name", "inner"}, {"stiffness", 1}}}}}), HasSubstr("it has \"outer\", found"));
  EXPECT_THAT(loading({{"examples", {{"stiffness", 1}}}}), HasSubstr("/examples: expected this group"));
  EXPECT_THAT(loading({{"regions",
                        {{{"name", "outer"}, {"stiffness", 1}, {"target", "table"}, {"energy_reference", "rest"}}}}}),
              HasSubstr("/regions/outer/targets: expected targets of energy_reference \"rest\""));
}

// The trajectory has the weights of each region in its own group.
TEST_F(Regions, HaveTheirWeightsInTheTrajectory) {
  build_bar();
  const SceneConfig config =
      load_scene(test::write_scene(folder_, {{"regions", {{{"name", "outer"}, {"stiffness", 100}, {"bias", 0.5}}}},
                                             {"steps", 3},
                                             {"output", {{"trajectory", "run.h5"}, {"every", 1}}}}));
  test::run(config);
  auto file = Hdf5File::open(folder_.path("run.h5"));
  EXPECT_TRUE(file.has_dataset("/regions/outer/weights"));
  EXPECT_FALSE(file.has_group("/examples"));
  const Hdf5Dataset weights = file.open_dataset("/regions/outer/weights");
  EXPECT_THAT(weights.sizes(), testing::ElementsAre(4, 2));
  RowMatrix values(4, 2);
  weights.read(values.data(), ElementType::kFloat64);
  EXPECT_LE((values.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-12);
  EXPECT_LE(values(3, 0), 0.5);
}

}  // namespace
}  // namespace exmat
