// The render mesh from its file through the bundle into trajectories and point caches.
#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/hdf5/hdf5_file.h"
#include "common/mesh/geometry.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace render_test {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kDone = 0, kBadInput = 2;

// Inside the small bar (4 x 1 x 0.8 m), on it, and 0.1 m above it; a quadrangle and a triangle.
constexpr auto kObj = "v 0 0.5 0.4\nv 4 0 0\nv 3.9 0.7 0.3\nv 2 0.5 0.9\nv 1 0.2 0.1\nf 1 2 3 4\nf 4 5 1";

class RenderMesh : public testing::Test {
 protected:
  std::filesystem::path asset(const std::string& obj = kObj, const Json& changes = Json::object()) {
    folder_.write("bar.obj", obj);
    Json all = Json::parse(R"({ "object": { "render_mesh": "bar.obj" }, "examples": [] })");
    all.merge_patch(changes);
    return write_small_bar(folder_, all);
  }
  Outcome bundle(const std::filesystem::path& asset_file, std::vector<std::string> options = {}) {
    options.insert(options.begin(), {"bundle", asset_file, "-o", bundle_});
    return exmat_precompute(options);
  }
  std::filesystem::path scene(const char* output) {
    Json members = Json::parse(R"({ "steps": 20, "gravity": [0, 0, -9.81] })");
    members["output"] = Json::parse(output);
    return write_scene(folder_, members);
  }
  static std::vector<float> floats(const Hdf5File& file, const std::string& path) {
    const Hdf5Dataset dataset = file.open_dataset(path);
    std::vector<float> values(dataset.element_count());
    dataset.read(values.data(), ElementType::kFloat32);
    return values;
  }
  // Read by Python, and compared with a dataset of the trajectory.
  void expect_cache(const std::filesystem::path& cache, const std::string& dataset, double rate) {
    const Outcome outcome = execute("/usr/bin/python3", {EXMAT_SOURCE_DIR "/tests/integration/pc2.py", cache});
    ASSERT_EQ(outcome.status, kDone) << outcome.errors;
    const Json found = Json::parse(outcome.output);
    const Hdf5File file = Hdf5File::open(folder_ / "t.h5");
    const std::vector<float> expected = floats(file, dataset);
    const auto sizes = file.open_dataset(dataset).sizes();
    EXPECT_EQ(found["magic"], std::string("POINTCACHE2\0", 12));
    EXPECT_EQ(found["version"], 1);
    EXPECT_EQ(found["points"], sizes[1]);
    EXPECT_EQ(found["samples"], sizes[0]);
    EXPECT_EQ(found["start"], 0);
    EXPECT_NEAR(found["rate"].get<double>(), rate, 1e-6 * rate);
    EXPECT_EQ(found["bytes"], 32 + 4 * expected.size());
    EXPECT_EQ(found["values"].get<std::vector<float>>(), expected);
  }

  TemporaryFolder folder_;
  std::filesystem::path bundle_ = folder_.path("bundle.h5");
};

TEST_F(RenderMesh, GoesFromItsFileIntoTheTrajectoryAndThePointCache) {
  const auto asset_file = asset();
  const Outcome made = bundle(asset_file, {"--scene", scene(R"({ "render": true })")});
  ASSERT_EQ(made.status, kDone) << made.errors;
  // 0.1 m of the diagonal, sqrt(4^2 + 1 + 0.8^2) m.
  const char* const report = "1 vertices outside the object, by up to 0.1 m (2.38 % of the diagonal";
  EXPECT_THAT(made.output, HasSubstr(report));
  EXPECT_THAT(made.errors, HasSubstr("1 of 5 points are outside the body, by up to 0.1 m (2.38 %"));
  const RenderData render = read_bundle(bundle_).render.value();
  EXPECT_EQ(render.outside, 1);
  EXPECT_NEAR(render.farthest, 0.1, 1e-12);
  EXPECT_EQ(render.vertices.row(2), Eigen::RowVector3d(3.9, 0.7, 0.3));
  TriangleArray triangles(3, 3);
  triangles << 0, 1, 2, 0, 2, 3, 3, 4, 0;
  EXPECT_EQ(render.triangles, triangles);
  const TetMesh mesh = read_bundle(bundle_).object->mesh;
  for (Eigen::Index k = 0; k < 5; ++k)
    EXPECT_LE((render.barycentric.row(k) * tet_positions(mesh, render.tets[k]) - render.vertices.row(k)).norm(), 1e-12);
  EXPECT_EQ(exmat_runtime({"validate", bundle_}).status, kDone);
  EXPECT_THAT(exmat_runtime({"info", bundle_}).output, HasSubstr("render mesh    5 vertices, 3 triangles; 1 outside"));

  const auto output = R"({ "trajectory": "t.h5", "every": 4, "render": true })";
  const Outcome run = exmat_runtime({"run", scene(output), "--log-level", "error"});
  ASSERT_EQ(run.status, kDone) << run.errors;
  const auto cache = folder_ / "bar.pc2";
  const auto exported = exmat_runtime({"export", folder_ / "t.h5", "-o", cache});
  ASSERT_EQ(exported.status, kDone) << exported.errors;
  EXPECT_THAT(exported.output, HasSubstr("5 of /render/vertices"));
  expect_cache(cache, "/render/vertices", 1);
  // Steps of 1 ms, a frame each 4: 0.1 frames at 25 a second.
  ASSERT_EQ(exmat_runtime({"export", folder_ / "t.h5", "-o", cache, "--mesh", "--frame-rate", "25"}).status, kDone);
  expect_cache(cache, "/vertices", 0.1);
}

TEST_F(RenderMesh, IsNotReadWhereItIsNotAskedFor) {
  const auto asset_file = asset("v 0 0\n");
  const Built plain = build(asset_file, Needs{.render = false});
  EXPECT_FALSE(plain.model.render);
  EXPECT_THAT(plain.report.inputs, ::testing::Not(::testing::Contains(folder_ / "bar.obj")));
  const Built named = build(asset(kObj, Json::parse(R"({ "needs": ["render"] })")));
  EXPECT_TRUE(named.model.render);
  EXPECT_THAT(named.report.inputs, ::testing::Contains(folder_ / "bar.obj"));
  EXPECT_NE(named.model.input_sha256, plain.model.input_sha256);
  EXPECT_FALSE(build(asset(kObj, Json::parse(R"({ "needs": [] })"))).model.render);
}

TEST_F(RenderMesh, FaultsAreNamed) {
  const auto refused = [&](const Outcome& outcome, const std::vector<std::string>& texts) {
    EXPECT_EQ(outcome.status, kBadInput);
    EXPECT_FALSE(std::filesystem::exists(bundle_));
    for (const std::string& text : texts) EXPECT_THAT(outcome.errors, HasSubstr(text));
  };
  refused(bundle(asset("v 0 0 0\nv 1 0\nf 1 2 1\n")), {"bar.obj: line 2: expected"});
  for (const char* command : {"bundle", "check"}) {
    std::vector<std::string> arguments{command, asset("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"), "--log-level", "error"};
    if (std::string(command) == "bundle") arguments.insert(arguments.end(), {"-o", bundle_});
    refused(exmat_precompute(arguments), {"bar.obj: line 4: expected"});
  }
  std::filesystem::remove(folder_ / "bar.obj");
  refused(bundle(folder_ / "asset.json"), {"bar.obj", "no such file"});
  const auto without = asset(kObj, Json::parse(R"({ "object": { "render_mesh": null } })"));
  refused(bundle(without, {"--scene", scene(R"({ "render": true })")}),
          {"asset.json: /object/render_mesh: expected a surface, for output.render of the scene, found none"});
}

TEST_F(RenderMesh, AMeshInOtherUnitsIsWarnedOf) {
  const auto asset_file = asset("v 0 0 0\nv 4000 0 0\nv 0 1000 0\nf 1 2 3\n");
  EXPECT_THAT(exmat_precompute({"check", asset_file}).errors,
              AllOf(HasSubstr("[warning]"), HasSubstr("does the render mesh stand where the object does, in metres?")));
}

TEST_F(RenderMesh, WhatIsNoTrajectoryIsNotExported) {
  const auto refused = [&](const std::filesystem::path& input, const std::string& output, const std::string& text) {
    const Outcome outcome = exmat_runtime({"export", input, "-o", folder_ / output});
    EXPECT_EQ(outcome.status, kBadInput);
    EXPECT_THAT(outcome.errors, HasSubstr(text));
    EXPECT_FALSE(std::filesystem::exists(folder_ / output));
  };
  ASSERT_EQ(bundle(asset(kObj, Json::parse(R"({ "needs": [] })"))).status, kDone);
  ASSERT_EQ(exmat_runtime({"run", scene(R"({ "trajectory": "t.h5", "every": 4 })")}).status, kDone);
  refused(bundle_, "a.pc2", "bundle.h5: /@format: expected \"exmat-trajectory\", found \"exmat-bundle\"");
  refused(folder_ / "t.h5", "a.obj", "a.obj: expected an output with the extension .glb, .usda or .pc2");
  // The last number of the last frame.
  const Hdf5File file = Hdf5File::open(folder_ / "t.h5");
  const std::vector<float> values = floats(file, "/vertices");
  std::string bytes = read_file(folder_ / "t.h5");
  const std::string last(reinterpret_cast<const char*>(values.data() + values.size() - 12), 12 * sizeof(float));
  const std::size_t place = bytes.find(last);
  ASSERT_NE(place, std::string::npos);
  bytes[place + last.size() - 4] = static_cast<char>(bytes[place + last.size() - 4] ^ 1);
  folder_.write("damaged.h5", bytes);
  refused(folder_ / "damaged.h5", "a.pc2", "damaged.h5: /vertices: expected checksum");
  EXPECT_EQ(exmat_runtime({"export", folder_ / "t.h5", "-o", folder_ / "a.pc2"}).status, kDone);
  expect_cache(folder_ / "a.pc2", "/vertices", 1);
}

}  // namespace render_test
}  // namespace exmat::test
