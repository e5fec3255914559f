#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <utility>
#include <vector>

#include "common/bundle/bundle.h"
#include "runtime/sim/space/full/full_body.h"
#include "tests/integration/support.h"
#include "tests/support/box_mesh.h"
#include "tests/support/scene_run.h"

// Clamps that follow examples, beside a body that stands where the pose has its clamp, the same body that its bone
// carries there, and the pose itself.

namespace exmat::test {
namespace following_clamp_test {

using namespace nlohmann::literals;
using ::testing::HasSubstr;

constexpr double kTimeStep = 0.004;           // [s]
const Eigen::RowVector3d kStep(0.4, 0, 0.2);  // of a pose with its clamp [m], a tenth of the bar
constexpr double kRounding = 1e-9;            // of the bar's length: what Newton's method leaves in all steps

class FollowingClamp : public testing::Test {
 protected:
  // The bundle NAME.h5 of a bar with a pose that bends it, turns its clamp by `turn` about x, and moves all of it.
  Outcome bundle(const std::string& name, const Eigen::RowVector3d& step, bool follow, double turn = 0,
                 const Json& changes = Json::object(), const std::vector<std::string>& more = {}) {
    TetMesh posed = mesh_;
    posed.vertices.col(2).array() += 0.05 * mesh_.vertices.col(0).array().square();
    const Eigen::Matrix3d rotation(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitX()));
    for (Eigen::Index v = 0; v < posed.vertex_count(); ++v)
      if (is_fixed(v)) posed.vertices.row(v) *= rotation.transpose();
    posed.vertices.rowwise() += step;
    given_ = posed.vertices;
    write_msh(folder_.path("pose.msh"), posed);
    Json asset = {{"examples", {{{"name", "step"}, {"mesh", "pose.msh"}}}},
                  {"object", {{"fixed", {{"follow", follow}}}}}};
    for (const auto& [key, member] : changes.items()) asset[key] = member;
    std::vector<std::string> words{"bundle", write_small_bar(folder_, asset), "-o", folder_.path(name + ".h5")};
    words.insert(words.end(), more.begin(), more.end());
    return exmat_precompute(words);
  }

  bool is_fixed(Eigen::Index vertex) const { return mesh_.vertices(vertex, 0) < 1e-9; }

  LoadedRun load(const std::string& name, const Json& members) const {
    Json scene = {{"bundle", name + ".h5"},
                  {"space", "full"},
                  {"time_step", kTimeStep},
                  {"steps", 100},
                  {"newton", {{"tolerance", 1e-12}}}};
    scene.merge_patch(members);
    return LoadedRun(load_scene(folder_.write("scene.json", scene.dump())));
  }

  // n x 3, world.
  VertexArray places(const LoadedRun& run, const runtime::Bodies& bodies) const {
    VertexArray all = mesh_.vertices;
    const auto& full = bodies.world().state(0).full;  // from the first step on
    for (Eigen::Index v = 0; full && v < all.rows(); ++v)
      all.row(v) += runtime::full_displacement(*run.kind().full, {}, *full, v).transpose();
    return all;
  }

  static double farthest(const VertexArray& a, const VertexArray& b) { return (a - b).rowwise().norm().maxCoeff(); }

  TemporaryFolder folder_;
  TetMesh mesh_ = box_mesh({8, 2, 1}, BarFiles{}.lengths);
  double length_ = BarFiles{}.lengths[0];
  VertexArray given_;  // of the last pose
};

// Of a pose that moves all of the body elasticity shifts all of it, and what is left of the pose is that of the body
// which stays. Damping by stiffness is left out: it is that of the first iterate, by which the two may differ.
TEST_F(FollowingClamp, ShiftsABodyAsItsPoseIsShifted) {
  ASSERT_EQ(bundle("stays", Eigen::RowVector3d::Zero(), false).status, 0);
  ASSERT_EQ(bundle("follows", kStep, true).status, 0);
  const Json scene = R"({ "gravity": [0, 0, -2], "damping": { "mass": 0.5 },
                          "examples": { "stiffness": 300, "damping": 5, "weights": [0, 1] } })"_json;
  const LoadedRun a = load("stays", scene), b = load("follows", scene);
  runtime::Bodies stays = a.bodies(), follows = b.bodies();
  for (int step = 0; step <= 100; ++step) {
    ASSERT_LE(farthest(places(a, stays).rowwise() + kStep, places(b, follows)), kRounding * length_) << step;
    stays.step();
    follows.step();
  }
  EXPECT_GE(farthest(places(a, stays), mesh_.vertices), 0.1) << "it moves";
}

// Weights that go as far from step to step as a bone does: by them, or by the bone, the body is driven alike.
TEST_F(FollowingClamp, MovesABodyAsABoneDoes) {
  ASSERT_EQ(bundle("follows", kStep, true).status, 0);
  Json scene = R"({ "damping": { "mass": 0.5, "stiffness": 0.002 },
                    "examples": { "stiffness": 0, "weights": [1, 0] },
                    "body": { "bones": [ { "joint": "clamp", "motion": [ { "time": 0 }, { "time": 0.3 } ] } ] } })"_json;
  scene["body"]["bones"][0]["motion"][1]["position"] = {kStep[0], kStep[1], kStep[2]};
  const LoadedRun a = load("follows", scene);
  const runtime::RigidMotion way({{0, Eigen::Vector3d::Zero()}, {0.3, kStep.transpose()}});
  Json keys = Json::array();
  for (int step = 0; step <= 100; ++step) {
    const double share = way.sample(step * kTimeStep).position.dot(kStep.transpose()) / kStep.squaredNorm();
    keys.push_back({{"time", step * kTimeStep}, {"value", {1 - share, share}}});
  }
  scene.erase("body");
  scene["examples"]["weights"] = {{"keys", keys}};
  const LoadedRun b = load("follows", scene);
  runtime::Bodies carried = a.bodies(), follows = b.bodies();
  double lag = 0;
  for (int step = 0; step < 100; ++step) {
    carried.step();
    follows.step();
    const VertexArray expected = places(a, carried);
    ASSERT_LE(farthest(expected, places(b, follows)), kRounding * length_) << step;
    lag = std::max(
        lag, (expected - mesh_.vertices).colwise().maxCoeff()[0] - (expected - mesh_.vertices).colwise().minCoeff()[0]);
  }
  EXPECT_GE(lag, 0.05) << "its flesh lags";
}

TEST_F(FollowingClamp, IsWhereThePoseHasIt) {
  Json scene = R"({ "gravity": [0, 0, -1], "damping": { "mass": 6 },
                    "examples": { "stiffness": 1e3, "damping": 30,
                                  "weights": { "keys": [ { "time": 0, "value": [1, 0] },
                                                         { "time": 0.5, "value": [0, 1] } ] } } })"_json;
  scene["bundle"] = "follows.h5";
  const std::string file = folder_.write("bundle_scene.json", scene.dump());
  const Outcome made = bundle("follows", kStep, true, 0.3, Json::object(), {"--scene", file});
  ASSERT_EQ(made.status, 0) << made.errors;
  const LoadedRun run = load("follows", scene);
  runtime::Bodies bodies = run.bodies();
  EXPECT_EQ(farthest(places(run, bodies), mesh_.vertices), 0) << "begins at rest";
  for (int step = 0; step < 4000; ++step) bodies.step();
  const VertexArray settled = places(run, bodies);
  for (Eigen::Index v = 0; v < settled.rows(); ++v)
    if (is_fixed(v)) {
      EXPECT_LE((settled.row(v) - given_.row(v)).norm(), 1e-12 * length_) << v;
    }

  // As the bundle says of the pose.
  const ExampleData example = read_bundle(folder_.path("follows.h5")).examples->examples.back();
  const auto norm = [&](const VertexArray& field) {
    const Eigen::VectorXd numbers = field.reshaped<Eigen::RowMajor>();
    return std::sqrt(mass_product(mesh_, Eigen::VectorXd::Constant(mesh_.tet_count(), 1000), numbers, numbers));
  };
  EXPECT_NEAR(example.settled_error, norm(settled - given_) / norm(given_ - mesh_.vertices), 1e-6);
  EXPECT_NEAR(example.settled_distance, farthest(settled, given_), 1e-6 * length_);
  EXPECT_THAT(made.errors, HasSubstr(fmt::format("example step: settled {:.1f} % of its displacement from the pose",
                                                 100 * example.settled_error)));
}

// It settles under gravity, by a weak force, nearer to the pose than without, and where the bundle says.
TEST_F(FollowingClamp, SettlesInItsPoseByCompensatedTargets) {
  Json scene = R"({ "gravity": [0, 0, -1], "damping": { "mass": 6 },
                    "examples": { "stiffness": 50, "damping": 30, "weights": [0, 1] } })"_json;
  scene["bundle"] = "follows.h5";
  std::vector<ExampleData> found;
  for (const bool compensate : {false, true}) {
    scene["examples"]["compensate"] = compensate;
    const std::string file = folder_.write("bundle_scene.json", scene.dump());
    const Outcome made = bundle("follows", kStep, true, 0.3, Json::object(), {"--scene", file});
    ASSERT_EQ(made.status, 0) << made.errors;
    found.push_back(read_bundle(folder_.path("follows.h5")).examples->examples.back());
  }
  fmt::print("settled {:.4f}, compensated {:.4f}, best {:.4f}\n", found[0].settled_error, found[1].settled_error,
             found[1].best_error);
  EXPECT_LE(found[1].settled_error, found[0].settled_error - 0.05);
  EXPECT_NEAR(found[1].settled_error, found[1].best_error, 0.02);
  const LoadedRun run = load("follows", scene);
  runtime::Bodies bodies = run.bodies();
  for (int step = 0; step < 4000; ++step) bodies.step();
  EXPECT_NEAR(farthest(places(run, bodies), given_), found[1].settled_distance, 1e-6 * length_);
}

// Weights that the shape makes move the clamp, which does not change the shape that they are of: they go to the
// example, which the bias asks for, without shaking.
TEST_F(FollowingClamp, FollowsTheWeightsOfItsShape) {
  ASSERT_EQ(bundle("follows", 3 * kStep, true).status, 0);
  const Json scene = R"({ "damping": { "mass": 6 },
                          "examples": { "stiffness": 400, "damping": 15, "bias": 0.2 },
                          "forces": [ { "vertices": { "point": [4, 0, 0] }, "force": [0, 0, 400], "end": 0.2 } ] })"_json;
  const LoadedRun run = load("follows", scene);
  runtime::Bodies bodies = run.bodies();
  const RowMatrix& shifts = run.kind().data.skeleton->shifts;
  const Eigen::Index vertices = mesh_.vertex_count();
  double before = 0, way = 0;
  int turns = 0, shakes = 0;  // in a row
  for (int step = 0; step < 1500; ++step) {
    bodies.step();
    const Eigen::VectorXd& weights = bodies.world().state(0).examples.front().weights;
    const VertexArray now = places(run, bodies);
    for (Eigen::Index v = 0; v < vertices; ++v)
      if (is_fixed(v)) {
        ASSERT_LE((now.row(v) - mesh_.vertices.row(v) - weights[1] * shifts.row(vertices + v)).norm(), 1e-12 * length_);
      }
    const double last = std::exchange(way, weights[1] - std::exchange(before, weights[1]));
    turns = way * last < 0 ? turns + 1 : 0;
    shakes = std::max(shakes, turns);
  }
  EXPECT_GE(before, 0.9);
  EXPECT_LE(shakes, 1) << "it swings, and does not turn back in step after step";
}

TEST_F(FollowingClamp, StepsFromAPackAsFromItsBundle) {
  ASSERT_EQ(bundle("follows", kStep, true).status, 0);
  const Json scene = R"({ "gravity": [0, 0, -2], "examples": { "stiffness": 300, "weights": [0.3, 0.7] } })"_json;
  const LoadedRun from_bundle = load("follows", scene);
  for (const bool for_scene : {false, true}) {
    std::vector<std::string> words{"pack", folder_.path("follows.h5"), "-o", folder_.path("follows.exmat")};
    if (for_scene) words.insert(words.end(), {"--scene", folder_.path("scene.json")});
    const Outcome packed = exmat_runtime(words);
    ASSERT_EQ(packed.status, 0) << packed.errors;
    Json members = scene;
    members["bundle"] = "follows.exmat";
    const LoadedRun from_pack = load("follows", members);
    runtime::Bodies a = from_bundle.bodies(), b = from_pack.bodies();
    for (int step = 0; step < 5; ++step) {
      a.step();
      b.step();
    }
    EXPECT_EQ(a.hash(), b.hash()) << for_scene;
    load("follows", scene);
  }
}

TEST_F(FollowingClamp, RefusesWhatItCannotFollow) {
  const auto refusal = [&](const Json& changes) {
    const Outcome outcome = bundle("refused", kStep, true, 0, changes);
    EXPECT_EQ(outcome.status, 2);
    EXPECT_FALSE(std::filesystem::exists(folder_.path("refused.h5")));
    return outcome.errors;
  };
  EXPECT_THAT(refusal({{"examples", nullptr}}),
              HasSubstr("asset.json: /object/fixed/follow: expected examples to follow, found none"));
  EXPECT_THAT(refusal({{"examples",
                        {{{"name", "rest"}, {"mesh", "rest.msh"}, {"rest", true}},
                         {{"name", "twist"}, {"mesh", "pose.msh"}}}}}),
              HasSubstr("/object/fixed/follow: expected poses of the rest example's own mesh, which stand where it "
                        "does, found example twist, a mesh of its own"));
  EXPECT_THAT(refusal({{"object", {{"fixed", {{"follow", true}, {"box", nullptr}}}}}}),
              HasSubstr("/object/fixed: expected exactly one of \"box\", \"color\""));
  EXPECT_THAT(refusal({{"needs", {"full_space"}}}),
              HasSubstr("/needs: expected \"examples\" among them, which the clamp follows"));
  EXPECT_THAT(refusal({{"needs", {"examples", "target_elasticity"}}}),
              HasSubstr("/needs: expected no \"target_elasticity\" beside object.fixed.follow"));
  ASSERT_EQ(bundle("follows", kStep, true).status, 0);
  EXPECT_THAT(exmat_runtime({"info", folder_.path("follows.h5")}).output,
              HasSubstr("clamp          follows the examples"));
  const auto refused_scene = [&](const char* program, const Json& members) {
    Json scene = {{"bundle", "follows.h5"}};
    scene.merge_patch(members);
    const std::string file = folder_.write("scene.json", scene.dump());
    const Outcome outcome = program[0] == 'r' ? exmat_runtime({"run", file, "-o", folder_.path("run.h5")})
                                              : exmat_precompute({"full-space", file, "-o", folder_.path("run.h5")});
    EXPECT_EQ(outcome.status, 2) << outcome.output;
    return outcome.errors;
  };
  EXPECT_THAT(refused_scene("full-space", Json::object()), HasSubstr("/bundle: expected the bundle of a body without"));
  EXPECT_THAT(refused_scene("run", {{"examples", {{"stiffness", 1}, {"force", "elastic"}}}}), HasSubstr("elastic"));
  EXPECT_THAT(refused_scene("run", {{"integrator", "newmark"}}),
              AllOf(HasSubstr("which steps in all its vertices, found"), Not(HasSubstr("reduced"))));
  EXPECT_THAT(refused_scene("run", {{"examples", {{"stiffness", 1}, {"compensate", true}}}}),
              HasSubstr("/examples/compensate: expected a bundle that was made for this scene"));
  EXPECT_THAT(refused_scene("run", {{"body", {{"motion", {{{"time", 0}}}}}}}), HasSubstr("motion"));
}

}  // namespace following_clamp_test
}  // namespace exmat::test
