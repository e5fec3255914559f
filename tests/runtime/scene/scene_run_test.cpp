#include "runtime/scene/scene_run.h"

#include <Eigen/Geometry>
#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <iterator>
#include <map>
#include <set>

#include "common/bundle/file_schemas.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "runtime/output/momentum.h"
#include "tests/support/scene_run.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime {
namespace {

using test::Bar;
using ::testing::HasSubstr;

std::string slurp(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::vector<double> doubles(const Hdf5File& file, const std::string& path) {
  const Hdf5Dataset dataset = file.open_dataset(path);
  std::vector<double> values(dataset.element_count());
  dataset.read(values.data(), ElementType::kFloat64);
  return values;
}

std::vector<std::int64_t> shape(const Hdf5File& file, const std::string& path) {
  return file.open_dataset(path).sizes();
}

/// A folder with a bundle of a bar of three examples, removed at the end.
class SceneRunTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "exmat-run-XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    bar_ = test::make_bar({.examples = 3});
    write_bundle(bar_.model, folder_ / "bar.h5");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  SceneConfig scene(const std::string& members) const {
    const auto file = folder_ / "scene.json";
    std::ofstream(file) << "{\"bundle\": \"bar.h5\", \"time_step\": 0.01, \"steps\": 20, \"gravity\": [0, -9.81, 0]"
                        << members << "}";
    return load_scene(file);
  }

  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) names.insert(entry.path().filename());
    return names;
  }

  static std::string failure_of(const std::function<void()>& action) {
    try {
      action();
    } catch (const InputError& error) {
      return error.what();
    }
    return "no InputError";
  }

  std::filesystem::path folder_;
  Bar bar_;
};

/// Three points: in a tet, on a vertex, and outside.
RenderData drawn_on(const ObjectData& object) {
  RenderData render;
  render.tets = IndexVector{{0, 5, 7}};
  render.barycentric.resize(3, 4);
  render.barycentric << 0.4, 0.3, 0.2, 0.1, 0, 0, 1, 0, 1.5, -1, 0.25, 0.25;
  render.vertices.setZero(3, 3);
  for (Eigen::Index k = 0; k < 3; ++k)
    for (int c = 0; c < 4; ++c)
      render.vertices.row(k) +=
          render.barycentric(k, c) * object.mesh.vertices.row(object.mesh.tets(render.tets[k], c));
  render.triangles = TriangleArray{{0, 1, 2}};
  render.outside = 1;
  return render;
}

std::set<std::string> datasets(const LoadedScene& loaded) {
  std::set<std::string> names;
  for (const ReadRecord& record : loaded.records) names.insert(record.dataset);
  return names;
}

const std::set<std::string> kStepDatasets{"/modal/gravity_load",      "/cubature/weights",       "/cubature/volumes",
                                          "/cubature/youngs_modulus", "/cubature/poisson_ratio", "/cubature/gradient",
                                          "/cubature/variance"};

TEST_F(SceneRunTest, ReadsNoMoreThanSteppingNeeds) {
  const LoadedScene loaded = load_run(scene(""));
  EXPECT_EQ(datasets(loaded), kStepDatasets);
  EXPECT_EQ(loaded.model->example_count(), 0);
  for (const LedgerEntry& entry : loaded.ledger)
    EXPECT_EQ(entry.bytes > 0, entry.group == "modal" || entry.group == "cubature") << entry.group;
}

TEST_F(SceneRunTest, ReadsTheExamplesOnlyForAnExampleForce) {
  const LoadedScene loaded = load_run(scene(", \"examples\": {\"stiffness\": 100}"));
  std::set<std::string> expected = kStepDatasets;
  expected.insert({"/examples/gram", "/examples/h0", "/examples/hq", "/examples/rest/reduced",
                   "/examples/pose1/reduced", "/examples/pose2/reduced", "/examples/rest/pose", "/examples/pose1/pose",
                   "/examples/pose2/pose", "/projection/shape_from_reduced", "/projection/reduced_from_shape",
                   "/projection/filter_scale", "/projection/target_basis"});
  EXPECT_EQ(datasets(loaded), expected);
  EXPECT_EQ(loaded.model->example_count(), 3);
}

TEST_F(SceneRunTest, ReadsPositionsOnlyForATrajectory) {
  const LoadedScene loaded = load_run(scene(", \"output\": {\"trajectory\": \"t.h5\"}"));
  std::set<std::string> expected = kStepDatasets;
  expected.insert({"/object/vertices", "/object/tets", "/object/density", "/modal/basis"});
  EXPECT_EQ(datasets(loaded), expected);
}

TEST_F(SceneRunTest, ReadsOnlyTheBasisRowsOfAScriptedForce) {
  const std::string force = ", \"forces\": [{\"vertices\": {\"ids\": [60, 62]}, \"force\": [1, 2, 3], \"end\": 0.1}]";
  const LoadedScene loaded = load_run(scene(force));
  ASSERT_EQ(loaded.scene.forces.size(), 1U);
  Eigen::VectorXd expected = Eigen::VectorXd::Zero(bar_.modes());
  for (const int vertex : {60, 62})
    expected += bar_.basis().middleRows<3>(3 * vertex).transpose() * Eigen::Vector3d(1, 2, 3);
  EXPECT_LE((loaded.scene.forces[0].force - expected).norm(), 1e-14 * expected.norm());
  EXPECT_EQ(loaded.records.back().dataset, "/modal/basis");
  EXPECT_EQ(loaded.records.back().bytes, 2 * 3 * static_cast<std::size_t>(bar_.modes()) * sizeof(double));

  const LoadedScene with_positions = load_run(scene(force + ", \"output\": {\"trajectory\": \"t.h5\"}"));
  EXPECT_EQ(with_positions.scene.forces[0].force, loaded.scene.forces[0].force);
}

TEST_F(SceneRunTest, PlanNamesStagesSizesAndWhatIsLeftOut) {
  const SceneConfig plain = scene(""), full = scene(", \"examples\": {\"stiffness\": 100}, \"damping\": {\"mass\": 1}");
  EXPECT_THAT(describe_plan(load_run(plain), plain),
              ::testing::IsSupersetOf({HasSubstr("target, example_force: left out, the scene names no examples"),
                                       HasSubstr("s = 144 elements"), HasSubstr("damping: left out"),
                                       HasSubstr("contact: left out"), HasSubstr("output: left out")}));
  EXPECT_THAT(describe_plan(load_run(full), full),
              ::testing::IsSupersetOf({HasSubstr("K = 3 examples"), HasSubstr("damping: mass 1")}));
}

TEST_F(SceneRunTest, BadInputIsNamed) {
  const auto load = [this](const std::string& members) { return failure_of([&] { load_run(scene(members)); }); };
  EXPECT_THAT(load(", \"forces\": [{\"vertices\": {\"ids\": [63]}, \"force\": [0, 0, 1]}]"),
              ::testing::AllOf(HasSubstr("/forces/0/vertices"), HasSubstr("0 to 62"), HasSubstr("found 63")));

  Bar inverted = test::make_bar({.examples = 4});
  inverted.model.examples->examples[3].pose *= -20;
  write_bundle(inverted.model, folder_ / "bar.h5");
  EXPECT_THAT(load(", \"examples\": {\"stiffness\": 1}"),
              ::testing::AllOf(HasSubstr("bar.h5: /examples/pose3"), HasSubstr("cubature element")));
  EXPECT_EQ(load(", \"examples\": {\"stiffness\": 1, \"energy_reference\": \"rest\"}"), "no InputError");

  write_bundle(test::make_bar().model, folder_ / "bar.h5");
  EXPECT_THAT(load(", \"examples\": {\"stiffness\": 1}"), HasSubstr("/examples"));

  // Its rigid motion needs /rigid.
  Bar free = test::make_bar();
  free.model.object->fixed.setZero();
  write_bundle(free.model, folder_ / "bar.h5");
  EXPECT_THAT(load(""), HasSubstr("bar.h5: /rigid: expected the group (the body is free), found none"));
}

TEST_F(SceneRunTest, TrajectoryHoldsTheRun) {
  const SceneConfig config = scene(
      ", \"examples\": {\"stiffness\": 100, \"bias\": 0.5}, \"output\": {\"trajectory\": \"t.h5\", \"every\": 3}");
  const RunSummary summary = test::run(config, {.profiled = true});
  EXPECT_EQ(summary.steps, 20);
  EXPECT_EQ(files(), (std::set<std::string>{"bar.h5", "scene.json", "t.h5", "t.xdmf"}));

  const Hdf5File file = Hdf5File::open(folder_ / "t.h5");
  const std::int64_t frames = 7, n = bar_.basis().rows() / 3, r = bar_.modes();
  using Sizes = std::vector<std::int64_t>;
  for (const char* path : {"/time", "/energy/kinetic", "/energy/elastic", "/energy/potential", "/step_time"})
    EXPECT_EQ(shape(file, path), Sizes{frames}) << path;
  for (const char* path : {"/body/position", "/linear_momentum", "/angular_momentum", "/examples/weights"})
    EXPECT_EQ(shape(file, path), (Sizes{frames, 3})) << path;
  for (const char* path : {"/reduced", "/reduced_velocity"}) EXPECT_EQ(shape(file, path), (Sizes{frames, r})) << path;
  EXPECT_EQ(shape(file, "/vertices"), (Sizes{frames, n, 3}));
  EXPECT_EQ(file.open_dataset("/vertices").type(), ElementType::kFloat32);
  EXPECT_EQ(shape(file, "/body/orientation"), (Sizes{frames, 4}));
  EXPECT_EQ(shape(file, "/tets"), (Sizes{bar_.model.object->mesh.tet_count(), 4}));
  EXPECT_EQ(std::get<std::string>(file.read_attribute("/", "integrator")), "bdf2");
  EXPECT_EQ(std::get<std::string>(file.read_attribute("/", "input_sha256")), bar_.model.input_sha256);

  const auto times = doubles(file, "/time"), vertices = doubles(file, "/vertices"), reduced = doubles(file, "/reduced");
  for (std::int64_t frame = 0; frame < frames; ++frame) {
    EXPECT_DOUBLE_EQ(times[frame], 0.03 * static_cast<double>(frame));
    const Eigen::Map<const Eigen::VectorXd> q(reduced.data() + frame * r, r);
    const Eigen::VectorXd expected = bar_.model.object->mesh.vertices.reshaped<Eigen::RowMajor>() + bar_.basis() * q;
    const Eigen::Map<const Eigen::VectorXd> written(vertices.data() + frame * 3 * n, 3 * n);
    EXPECT_LE((written - expected).lpNorm<Eigen::Infinity>(), 1e-6);
  }
  EXPECT_EQ(Eigen::Map<const Eigen::VectorXd>(reduced.data(), r).norm(), 0);
  EXPECT_EQ(doubles(file, "/energy/elastic").front(), 0);
  const auto weights = doubles(file, "/examples/weights");
  EXPECT_NEAR(weights[0], 0.5, 1e-12) << "at rest, after the bias";
  EXPECT_NEAR(weights[1], 0.25, 1e-12);
  EXPECT_LT(doubles(file, "/energy/potential").back(), 0);
}

// A turn and a shift of the start carry the render mesh exactly, also what is outside the body: 1e-6 is single
// precision.
TEST_F(SceneRunTest, TheRenderMeshMovesWithTheBody) {
  bar_ = test::make_bar({.free = true});
  const RenderData& render = bar_.model.render.emplace(drawn_on(*bar_.model.object));
  write_bundle(bar_.model, folder_ / "bar.h5");
  const SceneConfig config = scene(R"(, "body": {"orientation": [0.6, 0, 0.8, 0], "position": [1, 2, 3],
      "angular_velocity": [0, 0, 5]}, "output": {"trajectory": "t.h5", "every": 5, "render": true})");
  const LoadedScene loaded = load_run(config);
  EXPECT_THAT(describe_plan(loaded, config), ::testing::Contains(HasSubstr("and 3 of the render mesh every 5 steps")));
  test::run(config);
  EXPECT_EQ(files(), (std::set<std::string>{"bar.h5", "scene.json", "t.h5", "t.xdmf", "t_render.xdmf"}));

  const Hdf5File file = Hdf5File::open(folder_ / "t.h5");
  EXPECT_EQ(shape(file, "/render/vertices"), (std::vector<std::int64_t>{5, 3, 3}));
  EXPECT_EQ(doubles(file, "/render/triangles"), (std::vector<double>{0, 1, 2}));
  const auto drawn = doubles(file, "/render/vertices");
  const Eigen::RowVector3d centre = bar_.model.rigid->centre_of_mass.transpose();
  const Eigen::Matrix3d turn = Eigen::Quaterniond(0.6, 0, 0.8, 0).toRotationMatrix();
  for (Eigen::Index k = 0; k < 3; ++k) {
    const Eigen::RowVector3d expected =
        (render.vertices.row(k) - centre) * turn.transpose() + centre + Eigen::RowVector3d(1, 2, 3);
    EXPECT_LE((Eigen::RowVector3d(&drawn[static_cast<std::size_t>(3 * k)]) - expected).norm(), 1e-6) << k;
  }
  // Later by the frame's vertices, which are in single precision: weights of up to 3 in all.
  const auto vertices = doubles(file, "/vertices");
  const Eigen::Index n = bar_.model.object->mesh.vertex_count(), last = 4;
  for (Eigen::Index k = 0; k < 3; ++k) {
    Eigen::RowVector3d expected = Eigen::RowVector3d::Zero();
    for (int c = 0; c < 4; ++c) {
      const Eigen::Index corner = last * n + bar_.model.object->mesh.tets(render.tets[k], c);
      expected += render.barycentric(k, c) * Eigen::RowVector3d(&vertices[static_cast<std::size_t>(3 * corner)]);
    }
    EXPECT_LE((Eigen::RowVector3d(&drawn[static_cast<std::size_t>(3 * (last * 3 + k))]) - expected).norm(), 3e-6) << k;
  }
  const std::string xdmf = slurp(folder_ / "t_render.xdmf");
  for (const char* text : {"t.h5:/render/vertices", "t.h5:/render/triangles", "TopologyType=\"Triangle\"",
                           "NumberOfElements=\"1\"", "4 0 0 1 1 1 1 3 3", "Dimensions=\"5 3 3\""})
    EXPECT_THAT(xdmf, HasSubstr(text));
}

TEST_F(SceneRunTest, ARenderMeshIsReadForItsTrajectoryAlone) {
  bar_.model.render = drawn_on(*bar_.model.object);
  write_bundle(bar_.model, folder_ / "bar.h5");
  const std::set<std::string> render{"/render/tets", "/render/barycentric", "/render/triangles"};
  const auto read = [&](const std::string& output) {
    std::set<std::string> found;
    for (const std::string& path : datasets(load_run(scene(", \"output\": {" + output + "}"))))
      if (path.starts_with("/render")) found.insert(path);
    return found;
  };
  EXPECT_EQ(read(R"("trajectory": "t.h5", "render": true)"), render);
  EXPECT_TRUE(read(R"("trajectory": "t.h5")").empty());
  EXPECT_TRUE(read(R"("render": true)").empty());
}

TEST_F(SceneRunTest, ABundleWithoutARenderMeshIsNamedWithWhatToDo) {
  EXPECT_THAT(failure_of([&] { load_run(scene(R"(, "output": {"trajectory": "t.h5", "render": true})")); }),
              ::testing::AllOf(HasSubstr("bar.h5: /render: expected this group"),
                               HasSubstr("name object.render_mesh in the asset")));
  EXPECT_NO_THROW(load_run(scene(R"(, "output": {"render": true})"))) << "nothing is written";
}

TEST_F(SceneRunTest, MomentaAreThoseOfTheMassMatrix) {
  const SceneConfig config = scene(", \"output\": {\"trajectory\": \"t.h5\", \"every\": 20}");
  test::run(config);
  const Hdf5File file = Hdf5File::open(folder_ / "t.h5");
  const std::int64_t r = bar_.modes();
  const auto last_frame = [&](const char* path) {
    const auto values = doubles(file, path);
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(values.data() + values.size() / 2, values.size() / 2));
  };
  ASSERT_EQ(last_frame("/reduced").size(), r);
  const Eigen::VectorXd velocity = bar_.basis() * last_frame("/reduced_velocity");
  const Eigen::VectorXd position =
      bar_.model.object->mesh.vertices.reshaped<Eigen::RowMajor>() + bar_.basis() * last_frame("/reduced");
  // Momentum along e: e . p = (sum_i e)^T M v; about the centre of mass, e . L = (e x (x - c))^T M v.
  Eigen::Vector3d linear, angular, centre;
  const auto field = [&](const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& at) {
    Eigen::VectorXd values(position.size());
    for (Eigen::Index i = 0; i < values.size(); i += 3) values.segment<3>(i) = at(position.segment<3>(i));
    return values;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d e = Eigen::Vector3d::Unit(axis);
    const Eigen::VectorXd ones = field([&](const Eigen::Vector3d&) { return e; });
    linear[axis] = ones.dot(bar_.mass * velocity);
    centre[axis] = ones.dot(bar_.mass * position) / ones.dot(bar_.mass * ones);
  }
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d e = Eigen::Vector3d::Unit(axis);
    angular[axis] =
        field([&](const Eigen::Vector3d& x) { return Eigen::Vector3d(e.cross(x - centre)); }).dot(bar_.mass * velocity);
  }
  EXPECT_LE((last_frame("/linear_momentum") - linear).norm(), 1e-12 * linear.norm());
  EXPECT_LE((last_frame("/angular_momentum") - angular).norm(), 1e-11 * angular.norm());
}

// Clamped vertices go where the motion of the scene takes them, and momenta are those of the world.
TEST_F(SceneRunTest, AMotionCarriesTheBody) {
  const std::string motion = R"(, "body": { "motion": [ { "time": 0, "position": [0, 0, 0] },
    { "time": 0.2, "position": [1, 2, 0], "orientation": [0.8, 0, 0.6, 0] } ] },
    "output": { "trajectory": "run.h5", "every": 5 })";
  EXPECT_THAT(failure_of([&] { load_run(scene(motion)); }), HasSubstr("bar.h5"));
  bar_ = test::make_bar({.carried = true, .examples = 3});
  write_bundle(bar_.model, folder_ / "bar.h5");
  const SceneConfig config = scene(motion);
  const LoadedScene loaded = load_run(config);
  test::run(config);

  const Hdf5File file = Hdf5File::open(folder_ / "run.h5");
  const auto x = doubles(file, "/vertices"), place = doubles(file, "/body/position"),
             p = doubles(file, "/linear_momentum");
  const ObjectData& object = *bar_.model.object;
  const Eigen::Index n = object.mesh.vertex_count(), frames = 5;
  for (Eigen::Index frame = 0; frame < frames; ++frame) {
    const MotionSample expected = loaded.scene.carrier->sample(0.05 * static_cast<double>(frame));
    EXPECT_LE((Eigen::Vector3d(&place[static_cast<std::size_t>(3 * frame)]) - expected.position).norm(), 1e-14);
    for (Eigen::Index i = 0; i < n; ++i) {
      if (object.fixed[i] == 0) continue;
      const Eigen::Vector3d found(&x[static_cast<std::size_t>(3 * (frame * n + i))]);
      // Positions are in single precision.
      EXPECT_LE((found - expected.to_world(object.mesh.vertices.row(i).transpose())).norm(), 1e-6) << frame;
    }
  }
  // p = sum of the mass matrix times the velocities in the world, here half-way.
  const auto q = doubles(file, "/reduced"), v = doubles(file, "/reduced_velocity");
  const Eigen::Index r = bar_.modes(), half = 2;
  const MotionSample frame = loaded.scene.carrier->sample(0.1);
  Eigen::VectorXd velocity = bar_.basis() * Eigen::Map<const Eigen::VectorXd>(&v[half * r], r);
  const Eigen::VectorXd u = bar_.basis() * Eigen::Map<const Eigen::VectorXd>(&q[half * r], r);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d rest = object.mesh.vertices.row(i).transpose();
    velocity.segment<3>(3 * i) = frame.velocity_at(frame.to_world(rest + u.segment<3>(3 * i))) +
                                 frame.rotation * Eigen::Vector3d(velocity.segment<3>(3 * i));
  }
  const Eigen::VectorXd momenta = bar_.mass * velocity;
  const Eigen::Vector3d expected = momenta.reshaped(3, n).rowwise().sum();
  EXPECT_LE((Eigen::Vector3d(&p[3 * half]) - expected).norm(), 1e-12 * expected.norm());
}

TEST_F(SceneRunTest, TwoRunsDifferInTheStepTimeAlone) {
  std::map<std::string, std::vector<double>> first;
  for (const char* name : {"a.h5", "b.h5"}) {
    SceneConfig config = scene(", \"examples\": {\"stiffness\": 100}");
    config.trajectory = folder_ / name;
    config.every = 2;
    test::run(config);
    const Hdf5File file = Hdf5File::open(folder_ / name);
    for (const DatasetSchema& dataset : trajectory_schema().datasets) {
      if (dataset.path == "/step_time" || dataset.path == "/bones" || dataset.group == "render" ||
          dataset.group == "attachments" || !is_single(dataset.path))
        continue;
      const std::vector<double> values = doubles(file, dataset.path);
      EXPECT_EQ(values, first.try_emplace(dataset.path, values).first->second) << dataset.path;
    }
  }
  // Elsewhere the files agree byte for byte: 11 doubles and their checksum may differ.
  const std::string a = slurp(folder_ / "a.h5"), b = slurp(folder_ / "b.h5");
  ASSERT_EQ(a.size(), b.size());
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different += a[i] != b[i];
  EXPECT_LE(different, 11 * sizeof(double) + sizeof(std::uint32_t));
}

TEST_F(SceneRunTest, XdmfNamesTheFramesOfTheTrajectory) {
  const SceneConfig config = scene(", \"output\": {\"trajectory\": \"t.h5\", \"every\": 10}");
  test::run(config);
  const std::string xdmf = slurp(folder_ / "t.xdmf");
  EXPECT_THAT(xdmf, HasSubstr("t.h5:/vertices"));
  EXPECT_THAT(xdmf, HasSubstr("t.h5:/tets"));
  EXPECT_THAT(xdmf, HasSubstr("<Time Value=\"0.2\"/>"));
  EXPECT_THAT(xdmf, HasSubstr("2 0 0 1 1 1 1 63 3"));
  EXPECT_THAT(xdmf, HasSubstr("Dimensions=\"3 63 3\""));
}

TEST_F(SceneRunTest, TheTrajectoryOfManyBodiesIsThatOfTheFirst) {
  const std::string members =
      ", \"examples\": {\"stiffness\": 100}, \"output\": {\"trajectory\": \"t.h5\", \"every\": 5}";
  std::map<int, RunSummary> summaries;
  std::map<int, std::vector<double>> reduced;
  for (const int instances : {1, 7}) {
    const SceneConfig config = scene(members + ", \"instances\": " + std::to_string(instances));
    summaries[instances] = test::run(config, {.profiled = true});
    reduced[instances] = doubles(Hdf5File::open(folder_ / "t.h5"), "/reduced");
  }
  const RunSummary& one = summaries[1];
  const RunSummary& many = summaries[7];
  ASSERT_EQ(reduced[7].size(), reduced[1].size());
  const double rounding =
      1e-13 * static_cast<double>(one.steps);  // seven step side by side, where sums have another order
  for (std::size_t i = 0; i < reduced[1].size(); ++i) EXPECT_NEAR(reduced[7][i], reduced[1][i], rounding) << i;
  EXPECT_EQ(many.bodies, 7);
  EXPECT_EQ(many.steps, one.steps) << "of each body";
  EXPECT_NEAR(many.end.elastic, 7 * one.end.elastic, 7 * rounding * one.end.elastic) << "of all bodies";
  EXPECT_EQ(many.newton_iterations.mean(), one.newton_iterations.mean());
  EXPECT_NE(many.state_hash, one.state_hash);
  EXPECT_GT(many.stage_seconds->of_bodies[static_cast<std::size_t>(Stage::kOutput)].mean(), 0);
}

TEST_F(SceneRunTest, TheHashIsThatOfTheStates) {
  SceneConfig config = scene("");
  const std::uint64_t hash = test::run(config).state_hash;
  EXPECT_EQ(test::run(config, {.profiled = true}).state_hash, hash);
  ++config.steps;
  EXPECT_NE(test::run(config).state_hash, hash);
}

TEST_F(SceneRunTest, ANonFiniteStepEndsTheRunAndLeavesNoTrajectory) {
  SceneConfig config = scene(
      ", \"forces\": [{\"vertices\": {\"ids\": [62]}, \"force\": [0, 1, 0], \"start\": 0.1}], "
      "\"output\": {\"trajectory\": \"t.h5\"}");
  config.forces.front().force[1] = 1e300;
  const LoadedScene loaded = load_run(config);
  try {
    test::run(config);
    FAIL() << "ran to its end";
  } catch (const WorkError& error) {
    EXPECT_THAT(error.what(),
                ::testing::AllOf(HasSubstr("step 11 (t = 0.11 s), body 1 of 1:"), HasSubstr("smaller time_step")));
  }
  EXPECT_EQ(files(), (std::set<std::string>{"bar.h5", "scene.json"}));
}

TEST_F(SceneRunTest, ATrajectoryThatCannotBeWrittenStopsBeforeTheFirstStep) {
  SceneConfig config = scene("");
  config.trajectory = folder_ / "no_such_folder" / "t.h5";
  EXPECT_THROW(test::run(config), WorkError);
}

}  // namespace
}  // namespace exmat::runtime
