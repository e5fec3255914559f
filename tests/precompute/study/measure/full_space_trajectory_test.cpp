#include "precompute/study/measure/full_space_trajectory.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <set>

#include "common/bundle/bundle.h"
#include "common/bundle/file_schemas.h"
#include "common/core/error.h"
#include "common/hdf5/value_checks.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

class FullSpaceFile : public testing::Test {
 protected:
  void make(const test::BarOptions& options) {
    bar_ = complete_bar(options);
    write_bundle(bar_.model, folder_ / "bar.h5");
  }
  SceneConfig scene() const {
    SceneConfig config;
    config.file = folder_ / "scene.json";
    config.bundle = folder_ / "bar.h5";
    config.time_step = 0.01;
    config.steps = 20;
    config.every = 4;
    config.gravity = {0, -12, 4};
    return config;
  }
  FullSpaceSummary write(const SceneConfig& config) const { return write_full_space(config, folder_ / "t.h5"); }

  Hdf5File file() const { return Hdf5File::open(folder_ / "t.h5"); }
  std::vector<double> values(const std::string& path) const {
    const Hdf5File opened = file();
    const Hdf5Dataset dataset = opened.open_dataset(path);
    std::vector<double> found(dataset.element_count());
    dataset.read(found.data(), ElementType::kFloat64);
    return found;
  }
  VertexArray frame(std::size_t k) const {
    const Eigen::Index n = bar_.model.object->mesh.vertex_count();
    const std::vector<double> all = values("/vertices");
    return Eigen::Map<const VertexArray>(all.data() + static_cast<std::size_t>(3 * n) * k, n, 3);
  }
  Eigen::Vector3d row(const std::string& path, std::size_t k) const { return Eigen::Vector3d(&values(path)[3 * k]); }

  /// Momentum of the velocities [n x 3] by the bar's own mass matrix, 3n numbers.
  Eigen::VectorXd momentum(const VertexArray& velocities) const {
    return bar_.mass * velocities.reshaped<Eigen::RowMajor>();
  }

  test::TemporaryFolder folder_;
  test::Bar bar_;
};

// Every entry of the schema, as the schema says, with its checksum; but for what a body in full space has not.
TEST_F(FullSpaceFile, IsAsTheSchemaSays) {
  make({.cells = {2, 1, 1}, .examples = 3});
  SceneConfig config = scene();
  config.examples.emplace();
  config.examples->stiffness = 400;
  config.examples->bias = 0.5;
  write(config);
  const Hdf5File opened = file();
  for (const AttributeSchema& schema : trajectory_schema().attributes) {
    EXPECT_FALSE(check_value(schema, opened.read_attribute("/", schema.name), {})) << schema.name;
  }
  EXPECT_EQ(std::get<double>(opened.read_attribute("/", "time_step")), 0.01);
  EXPECT_EQ(std::get<std::string>(opened.read_attribute("/", "integrator")), "bdf2");
  SymbolSizes sizes;
  sizes.set("n", bar_.model.object->mesh.vertex_count(), "the bar");
  sizes.set("n_t", bar_.model.object->mesh.tet_count(), "the bar");
  sizes.set("K", 3, "the bar");
  sizes.set("F", 6, "the scene");
  EXPECT_FALSE(opened.has_group("/bodies")) << "it has one body, at the root";
  const std::set<std::string> none{"/reduced",
                                   "/reduced_velocity",
                                   "/regions/{region}/weights",
                                   "/attachments/force",
                                   "/attachments/torque",
                                   "/render/triangles",
                                   "/render/vertices",
                                   "/bones"};
  for (const DatasetSchema& schema : trajectory_schema().datasets) {
    ASSERT_EQ(opened.has_dataset(schema.path), !none.contains(schema.path)) << schema.path;
    if (none.contains(schema.path)) continue;
    const Hdf5Dataset dataset = opened.open_dataset(schema.path);
    EXPECT_EQ(dataset.type(), schema.type) << schema.path;
    EXPECT_FALSE(sizes.bind(schema.dims, dataset.sizes(), schema.path)) << schema.path;
    std::vector<std::byte> data(dataset.element_count() * size_of(schema.type));
    dataset.read(data.data(), schema.type);
    const auto fault = check_values(schema, dataset.sizes(), data.data(), sizes);
    EXPECT_FALSE(fault) << schema.path << ": " << (fault ? fault->found : "");
    EXPECT_EQ(std::get<std::int64_t>(opened.read_attribute(schema.path, "crc32")), crc32_of(data)) << schema.path;
    EXPECT_EQ(std::get<std::string>(opened.read_attribute(schema.path, "description")), schema.description);
  }
}

// Frames of a motion that run_full_space() makes by itself; positions to single precision, the rest to the last bit.
TEST_F(FullSpaceFile, HoldsTheFramesOfTheRun) {
  make({.cells = {2, 1, 1}, .examples = 3});
  SceneConfig config = scene();
  config.mass_damping = 0.5;
  config.examples.emplace();
  config.examples->stiffness = 400;
  config.examples->bias = 0.5;
  const FullSpaceSummary summary = write(config);
  EXPECT_EQ(summary.steps, 20);
  EXPECT_EQ(summary.frames, 6);
  EXPECT_EQ(summary.unconverged, 0);
  EXPECT_FALSE(summary.inverted.any());
  const BodyFrames expected = run_full_space(config, bar_.model, {0.04, 0.08, 0.12, 0.16, 0.2});
  EXPECT_EQ(frame(0), bar_.model.object->mesh.vertices.cast<float>().cast<double>());
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_NEAR(values("/time")[k + 1], expected.times[k], 1e-15);
    EXPECT_EQ(frame(k + 1), expected.positions[k].cast<float>().cast<double>());
    EXPECT_EQ(values("/energy/kinetic")[k + 1], expected.kinetic[k]);
    EXPECT_EQ(values("/energy/elastic")[k + 1], expected.elastic[k]);
    EXPECT_EQ(values("/energy/potential")[k + 1], expected.potential[k]);
    const Eigen::Vector3d p = momentum(expected.velocities[k]).reshaped(3, bar_.mass.cols() / 3).rowwise().sum();
    EXPECT_LE((row("/linear_momentum", k + 1) - p).norm(), 1e-12 * p.norm());
  }
  EXPECT_GT((frame(5) - frame(0)).norm(), 0.01) << "it does not move";
  EXPECT_GT(values("/examples/weights")[3 * 5 + 1], 0) << "weights of the last frame";
}

// A free body that is thrown and turns: gravity alone changes its momentum. Newmark integrates a constant acceleration
// without an error, but for the first step, one of backward Euler, which goes half of g dt^2 too far.
TEST_F(FullSpaceFile, OfAFreeBodyFollowsTheLawsOfMotion) {
  make({.cells = {2, 1, 1}, .free = true});
  SceneConfig config = scene();
  config.integrator = Integrator::kNewmark;
  config.time_step = 0.002;
  config.body.linear_velocity = Eigen::Vector3d(1, 2, 0);
  config.body.angular_velocity = Eigen::Vector3d(0, 0, 5);
  const FullSpaceSummary summary = write(config);
  const double total = bar_.mass.sum() / 3;
  const Eigen::VectorXd weights = bar_.mass.rowwise().sum();
  const auto centre = [&](const VertexArray& positions) -> Eigen::Vector3d {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (Eigen::Index i = 0; i < positions.rows(); ++i) sum += weights[3 * i] * positions.row(i).transpose();
    return sum / total;
  };
  const VertexArray& rest = bar_.model.object->mesh.vertices;
  for (std::size_t k = 0; k < 6; ++k) {
    const double time = 0.008 * static_cast<double>(k);
    const Eigen::Vector3d velocity = *config.body.linear_velocity + time * config.gravity;
    EXPECT_LE((row("/linear_momentum", k) - total * velocity).norm(), 1e-7 * total);
    const double first = k > 0 ? config.time_step : 0;
    const Eigen::Vector3d moved =
        time * *config.body.linear_velocity + 0.5 * (time * time + first * first) * config.gravity;
    EXPECT_LE((row("/body/position", k) - moved).norm(), 1e-7);
    EXPECT_LE((centre(frame(k)) - centre(rest) - moved).norm(), 1e-6) << "single precision";
    // The body is stiff and its spin low: it turns by omega t, but for the strain of its spin.
    const std::vector<double> all = values("/body/orientation");
    const Eigen::Quaterniond turn(all[4 * k], all[4 * k + 1], all[4 * k + 2], all[4 * k + 3]);
    EXPECT_NEAR(turn.norm(), 1, 1e-12);
    EXPECT_LE(turn.angularDistance(Eigen::Quaterniond(Eigen::AngleAxisd(5 * time, Eigen::Vector3d::UnitZ()))), 0.01);
  }
  // About the centre, at the start: sum r x M (omega x r).
  VertexArray velocities(rest.rows(), 3);
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    velocities.row(i) = Eigen::Vector3d(0, 0, 5).cross(rest.row(i).transpose() - centre(rest)).transpose();
  const Eigen::VectorXd momenta = momentum(velocities);
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < rest.rows(); ++i)
    angular += (rest.row(i).transpose() - centre(rest)).cross(Eigen::Vector3d(momenta.segment<3>(3 * i)));
  EXPECT_LE((row("/angular_momentum", 0) - angular).norm(), 1e-12 * angular.norm());
  EXPECT_LE((row("/angular_momentum", 5) - angular).norm(), 1e-3 * angular.norm()) << "but for the integrator";
  EXPECT_FALSE(summary.inverted.any());
}

// A start so far along the first mode that tets are inside out there: counted in the first frame of the file.
TEST_F(FullSpaceFile, CountsInvertedTets) {
  make({.cells = {2, 1, 1}});
  SceneConfig config = scene();
  config.steps = 4;
  Eigen::VectorXd start = Eigen::VectorXd::Zero(bar_.modes());
  start[bar_.modes() - 1] = 3;
  config.body.reduced = start;
  const FullSpaceSummary summary = write(config);
  const Eigen::Index first = inverted_tet_count(bar_.model.object->mesh, frame(0));
  ASSERT_GT(first, 0) << "no inverted tet to count";
  EXPECT_EQ(summary.inverted.most, std::max(first, inverted_tet_count(bar_.model.object->mesh, frame(1))));
  EXPECT_EQ(summary.inverted.last, inverted_tet_count(bar_.model.object->mesh, frame(1)));
}

TEST_F(FullSpaceFile, IsWholeOrNotThere) {
  make({.cells = {2, 1, 1}});
  SceneConfig config = scene();
  config.gravity = {0, 1e300, 0};
  EXPECT_THROW(write(config), WorkError);
  EXPECT_EQ(folder_.names(), std::set<std::string>{"bar.h5"});
  config = scene();
  EXPECT_THROW(write_full_space(config, folder_ / "none/t.h5"), WorkError);
  write(config);
  EXPECT_EQ(folder_.names(), (std::set<std::string>{"bar.h5", "t.h5", "t.xdmf"}));
  const std::string xdmf = test::read_file(folder_ / "t.xdmf");
  EXPECT_NE(xdmf.find("t.h5:/vertices"), std::string::npos);
  EXPECT_NE(xdmf.find("Value=\"0.2\""), std::string::npos) << "the last frame";
}

}  // namespace
}  // namespace exmat::precompute
