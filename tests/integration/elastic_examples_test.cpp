#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "tests/integration/support.h"

// Elastic example forces from the asset to the motion: precompute, the run time, the full space.

namespace exmat::test {
namespace {

using namespace nlohmann::literals;
using ::testing::AllOf;
using ::testing::HasSubstr;

const Json kElastic = R"({ "time_step": 0.01, "steps": 60, "damping": { "mass": 3 },
  "examples": { "force": "elastic", "stiffness": 2, "damping": 4, "bias": 0.3 }, "output": { "every": 4 } })"_json;

class ElasticExamples : public testing::Test {
 protected:
  Outcome bundle(const Json& scene, const Json& asset, bool with_scene = true) {
    const std::filesystem::path file = write_scene(folder_, scene);
    std::vector<std::string> arguments{"bundle", write_small_bar(folder_, asset), "-o", folder_.path("bundle.h5")};
    if (with_scene) arguments.insert(arguments.end(), {"--scene", file});
    return exmat_precompute(arguments);
  }

  MotionError error(const Json& scene) { return error_against_full_space(write_scene(folder_, scene), 15, 4); }

  TemporaryFolder folder_;
};

// The basis has 40 of 144 degrees of freedom, which have learned from the scene: with all tets, then with the elements
// chosen. The twist of so coarse a mesh is 0.5 % short of volume, which these forces are stiff against: 30 hold it
// badly.
TEST_F(ElasticExamples, ReducedMotionIsNearTheFullSpace) {
  const Json basis = {{"basis", {{"size", 40}, {"linear_modes", 20}, {"training", "scene"}}}};
  Json all = basis;
  all["cubature"] = {{"method", "all_elements"}, {"elements", nullptr}};
  Json chosen = basis;
  chosen["cubature"] = {{"elements", 44}};
  for (const char* target : {"table", "solve"}) {
    Json scene = kElastic;
    scene["examples"]["target"] = target;
    ASSERT_EQ(bundle(scene, all).status, 0);
    const MotionError exact = error(scene);
    fmt::print("{}: error {:.4f} with all tets\n", target, exact.error);
    EXPECT_LE(exact.error, 0.05) << target;
    EXPECT_GT(exact.size, 0.05) << "it does not move";
    ASSERT_EQ(bundle(scene, chosen).status, 0);
    const double found = error(scene).error;
    fmt::print("{}: error {:.4f} with 44 elements\n", target, found);
    EXPECT_LE(found, exact.error + 0.03) << target;
  }
}

TEST_F(ElasticExamples, OfARegionAreNearTheFullSpace) {
  const Json asset = {{"basis", {{"size", 24}, {"linear_modes", 14}, {"training", "scene"}}},
                      {"cubature", {{"elements", 48}}},
                      {"regions",
                       {{{"name", "end"},
                         {"vertices", {{"box", {{"min", {1.9, -1, -1}}, {"max", {5, 2, 2}}}}}},
                         {"examples", {"twist"}}}}}};
  Json scene = kElastic;
  scene.erase("examples");
  scene["regions"] = R"([ { "name": "end", "force": "elastic", "stiffness": 3, "damping": 2, "bias": 0 } ])"_json;
  const Outcome made = bundle(scene, asset);
  ASSERT_EQ(made.status, 0) << made.errors;
  const MotionError found = error(scene);
  fmt::print("error {:.4f}\n", found.error);
  EXPECT_LE(found.error, 0.04);
  EXPECT_GT(found.size, 0.01) << "it does not move";
}

// A bundle leaves out what a scene does not ask for, and a scene that asks for it says what to do.
TEST_F(ElasticExamples, ABundleHoldsThemWhereTheyAreAskedFor) {
  Json linear = kElastic;
  linear["examples"]["force"] = "linear";
  ASSERT_EQ(bundle(linear, Json::object()).status, 0);
  EXPECT_FALSE(read_bundle(folder_ / "bundle.h5").target_elasticity);
  write_scene(folder_, kElastic);
  const Outcome refused = exmat_runtime({"run", folder_.path("scene.json")});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.errors, AllOf(HasSubstr("bundle.h5: /target_elasticity"), HasSubstr("--scene SCENE.json"),
                                    HasSubstr("\"target_elasticity\" among the needs")));

  ASSERT_EQ(bundle(kElastic, {{"needs", {"examples", "targets", "target_elasticity"}}}, /*with_scene=*/false).status,
            0);
  EXPECT_TRUE(read_bundle(folder_ / "bundle.h5").target_elasticity);
  EXPECT_EQ(exmat_runtime({"run", folder_.path("scene.json")}).status, 0);
  write_scene(folder_, linear);
  const Outcome described = exmat_runtime({"run", folder_.path("scene.json")});
  EXPECT_EQ(described.status, 0) << described.errors;
}

// A run that is cut in two and goes on from a file is the run in one.
TEST_F(ElasticExamples, AStateGoesOn) {
  for (const char* target : {"table", "solve"}) {
    Json scene = kElastic;
    scene["examples"]["target"] = target;
    ASSERT_EQ(bundle(scene, Json::object()).status, 0);
    const auto run = [&](const std::vector<std::string>& more) {
      std::vector<std::string> arguments{"run", folder_.path("scene.json")};
      arguments.insert(arguments.end(), more.begin(), more.end());
      const Outcome outcome = exmat_runtime(arguments);
      EXPECT_EQ(outcome.status, 0) << outcome.errors;
    };
    run({"--steps", "20", "--dump-state", folder_.path("whole")});
    run({"--steps", "9", "--dump-state", folder_.path("half")});
    run({"--steps", "11", "--from-state", folder_.path("half"), "--dump-state", folder_.path("both")});
    EXPECT_EQ(read_file(folder_.path("both")), read_file(folder_.path("whole"))) << target;
  }
}

}  // namespace
}  // namespace exmat::test
