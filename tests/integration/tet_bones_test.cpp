#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>

#include "common/bundle/bundle.h"
#include "runtime/sim/space/full/full_body.h"
#include "tests/integration/support.h"
#include "tests/support/box_mesh.h"
#include "tests/support/scene_run.h"

// Tets on the bones of a JSON file, from the asset to steps in a bent pose.
namespace exmat::test {
namespace tet_bones_test {

using ::testing::HasSubstr;

constexpr double kAngle = std::numbers::pi / 3;  // of the bend [rad]

class TetBonesRun : public testing::Test {
 protected:
  TetBonesRun() {
    Json lower = Json::array(), upper = Json::array();
    for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v) (mesh_.vertices(v, 0) < 2 ? lower : upper).push_back(v);
    const Json bones = {
        {"joints",
         {{{"name", "lower"}, {"position", {0, 0.5, 0.4}}},
          {{"name", "upper"}, {"parent", "lower"}, {"position", {2, 0.5, 0.4}}}}},
        {"weights", {{{"joint", "lower"}, {"vertices", lower}}, {{"joint", "upper"}, {"vertices", upper}}}}};
    folder_.write("bones.json", bones.dump());
    asset_ =
        write_small_bar(folder_, {{"examples", nullptr}, {"object", {{"fixed", nullptr}, {"skeleton", "bones.json"}}}});
  }

  TemporaryFolder folder_;
  TetMesh mesh_ = box_mesh({8, 2, 1}, BarFiles{}.lengths);
  std::filesystem::path asset_;
};

TEST_F(TetBonesRun, HoldsVerticesExactlyAtBentBones) {
  const Outcome checked = exmat_precompute({"check", asset_});
  ASSERT_EQ(checked.status, 0) << checked.errors;
  EXPECT_THAT(checked.errors, HasSubstr("skeleton: 2 bones hold "));
  const Outcome made =
      exmat_precompute({"bundle", asset_, "-o", folder_.path("bar.h5"), "--depfile", folder_.path("d")});
  ASSERT_EQ(made.status, 0) << made.errors;
  EXPECT_THAT(made.errors, HasSubstr("skeleton: 2 bones hold "));
  EXPECT_THAT(read_file(folder_.path("d")), HasSubstr("bones.json"));

  const Json turn = {std::cos(kAngle / 2), 0, 0, std::sin(kAngle / 2)};
  const Json scene = {
      {"bundle", "bar.h5"},
      {"time_step", 0.004},
      {"gravity", {0, 0, -2}},
      {"body", {{"bones", {{{"joint", "upper"}, {"motion", {{{"time", 0}, {"orientation", turn}}}}}}}}}};
  const LoadedRun run(load_scene(folder_.write("scene.json", scene.dump())));
  runtime::Bodies bodies = run.bodies();
  for (int step = 0; step < 20; ++step) bodies.step();
  const Eigen::Vector3d joint(2, 0.5, 0.4);
  const Eigen::AngleAxisd bend(kAngle, Eigen::Vector3d::UnitZ());
  const FlagVector& held = run.kind().data.object->fixed;
  EXPECT_GE(held.cast<int>().sum(), 8);
  double flesh = 0;
  for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v) {
    const Eigen::Vector3d rest = mesh_.vertices.row(v);
    const Eigen::Vector3d by_bone = rest[0] < 2 ? rest : joint + bend * (rest - joint);
    const Eigen::Vector3d now =
        rest + runtime::full_displacement(*run.kind().full, {}, *bodies.world().state(0).full, v);
    if (held[v] != 0)
      ASSERT_LE((now - by_bone).norm(), 1e-12 * 4) << v;
    else
      flesh = std::max(flesh, (now - by_bone).norm());
  }
  EXPECT_GE(flesh, 1e-3) << "the flesh gives way";
}

TEST_F(TetBonesRun, IsMadeAgainWhereItsBonesChange) {
  const auto made = [&] {
    const Outcome outcome = exmat_precompute({"bundle", asset_, "-o", folder_.path("bar.h5"), "--if-changed"});
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    return summarise_bundle(folder_.path("bar.h5")).input_sha256;
  };
  const std::string first = made();
  EXPECT_EQ(made(), first);
  Json bones = Json::parse(read_file(folder_.path("bones.json")));
  bones["joints"][1]["position"] = {2, 0.5, 0.5};
  folder_.write("bones.json", bones.dump());
  EXPECT_NE(made(), first);
  const Outcome refused = exmat_precompute({"bundle", asset_, "-o", folder_.path("bones.json")});
  EXPECT_EQ(refused.status, 2);
  EXPECT_EQ(Json::parse(read_file(folder_.path("bones.json"))), bones);
}

}  // namespace tet_bones_test
}  // namespace exmat::test
