#include "precompute/mesh_io/gltf_skeleton.h"

#include <Eigen/Geometry>
#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "precompute/mesh_io/gltf_reader.h"
#include "tests/precompute/mesh_io/gltf_samples.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using namespace test;

const std::vector<double> kPoints{0, 0, 0, 0, 1, 0, 0, 2, 0, 1, 0, 0};

std::vector<double> translations(const std::vector<Eigen::Vector3d>& shifts) {
  std::vector<double> numbers;
  for (const Eigen::Vector3d& shift : shifts) {
    const Eigen::Matrix4d matrix = Eigen::Affine3d(Eigen::Translation3d(shift)).matrix();
    numbers.insert(numbers.end(), matrix.data(), matrix.data() + 16);
  }
  return numbers;
}

// Four vertices on two joints one above the other, in an armature of a hundredth.
GltfWriter skinned() {
  GltfWriter writer;
  const int positions = writer.positions(kPoints);
  const int indices = writer.accessor(kUnsignedShort, "SCALAR", {0, 1, 3, 1, 2, 3});
  const int joints = writer.accessor(kUnsignedByte, "VEC4", {0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0});
  const int weights =
      writer.accessor(kUnsignedByte, "VEC4", {255, 0, 0, 0, 51, 204, 0, 0, 255, 0, 0, 0, 0, 0, 0, 0}, true);
  const int inverses = writer.accessor(kFloat, "MAT4", translations({{0, 0, 0}, {0, -1, 0}}));
  writer.mesh_in_node("body", {{"attributes", {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}},
                               {"indices", indices}});
  writer.json["nodes"][0]["skin"] = 0;
  writer.json["nodes"][0]["translation"] = {7, 8, 9};  // counts for nothing
  writer.json["nodes"].push_back({{"name", "armature"}, {"scale", {0.01, 0.01, 0.01}}, {"children", {2}}});
  writer.json["nodes"].push_back({{"name", "hip"}, {"translation", {100, 0, 0}}, {"children", {3}}});
  writer.json["nodes"].push_back({{"name", "head"}, {"translation", {0, 1, 0}}});
  writer.json["scenes"] = {{{"nodes", {0, 1}}}};
  writer.json["skins"] = {{{"joints", {2, 3}}, {"inverseBindMatrices", inverses}}};
  return writer;
}

class GltfBones : public testing::Test {
 protected:
  SurfaceFile read(const GltfWriter& writer) const { return read_gltf(folder_.write("body.glb", writer.glb())); }
  Complaint complaint(const GltfWriter& writer) const {
    return complaint_of([&] { read(writer); });
  }
  TemporaryFolder folder_;
};

TEST_F(GltfBones, StandWhereTheirRootDoesInItsUnit) {
  const SurfaceFile surface = read(skinned());
  ASSERT_TRUE(surface.skeleton);
  const SkeletonData& skeleton = *surface.skeleton;
  EXPECT_THAT(skeleton.bones, ElementsAre("hip", "head"));
  EXPECT_EQ(skeleton.parents, (IndexVector(2) << -1, 0).finished());
  const RowMatrix at = (RowMatrix(4, 3) << 1, 0, 0, 1, 0.01, 0, 1, 0.02, 0, 1.01, 0, 0).finished();
  EXPECT_LE((surface.mesh.vertices - at).norm(), 1e-12);
  EXPECT_LE((skeleton.bind.row(0) - Eigen::RowVector4d(0.01, 0, 0, 1)).norm(), 1e-12);
  EXPECT_LE((skeleton.bind.col(3).tail(3) - Eigen::Vector3d(1, 0.01, 0)).norm(), 1e-12);
}

// Bytes and shorts as parts of the largest, several sets, weights that do not add up to 1, vertices without any.
TEST_F(GltfBones, TakeWeightsAsTheyAre) {
  GltfWriter writer = skinned();
  json& attributes = writer.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["JOINTS_1"] = writer.accessor(kUnsignedShort, "VEC4", {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  attributes["WEIGHTS_1"] = writer.accessor(kFloat, "VEC4", {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  const SurfaceFile surface = read(writer);
  const RowMatrix expected = (RowMatrix(4, 2) << 0.5, 0.5, 0.2, 0.8, 0, 1, 1, 0).finished();
  EXPECT_LE((surface.skeleton->weights - expected).norm(), 1e-12);
  EXPECT_TRUE(surface.parts.contains("body"));
}

TEST_F(GltfBones, WithoutMatricesAreBoundAtTheirJoints) {
  GltfWriter writer = skinned();
  writer.json["skins"][0].erase("inverseBindMatrices");
  const SurfaceFile surface = read(writer);
  EXPECT_LE((surface.skeleton->bind.topRows(3) - surface.skeleton->bind.bottomRows(3)).norm(), 1e-12);
}

TEST_F(GltfBones, CarryMeshesThatHangOnThem) {
  GltfWriter writer = skinned();
  writer.json["nodes"].push_back({{"name", "hat"}, {"mesh", 1}});
  writer.json["nodes"][3]["children"] = {4};
  const int positions = writer.positions({0, 0, 0, 1, 0, 0, 0, 0, 1});
  writer.json["meshes"].push_back({{"primitives", {{{"attributes", {{"POSITION", positions}}}}}}});
  const SurfaceFile surface = read(writer);
  EXPECT_EQ(surface.skeleton->weights.bottomRows(3), (RowMatrix(3, 2) << 0, 1, 0, 1, 0, 1).finished());
  EXPECT_LE((surface.mesh.vertices.row(5) - Eigen::RowVector3d(1.01, 0.01, 0)).norm(), 1e-12);
}

// The three ways of glTF 2.0, by their definitions: the head's turn about z, at times between keys.
TEST_F(GltfBones, FollowAnimations) {
  const auto turn = [](double angle) { return std::vector<double>{0, 0, std::sin(angle / 2), std::cos(angle / 2)}; };
  const auto animated = [&](const std::string& way, const std::vector<double>& values) {
    GltfWriter writer = skinned();
    const int times = writer.accessor(kFloat, "SCALAR", {0, 0.5});
    const int turns = writer.accessor(kFloat, "VEC4", values);
    writer.json["animations"] = {{{"name", "nod"},
                                  {"channels", {{{"sampler", 0}, {"target", {{"node", 3}, {"path", "rotation"}}}}}},
                                  {"samplers", {{{"input", times}, {"output", turns}, {"interpolation", way}}}}}};
    return *read(writer).skeleton;
  };
  const auto angle_at = [](const SkeletonData& skeleton, double time) {
    for (Eigen::Index frame = 0; frame < skeleton.times.size(); ++frame)
      if (std::abs(skeleton.times[frame] - time) < 1e-6) {
        const Eigen::VectorXd row = skeleton.poses.row(2 * frame + 1);
        EXPECT_LE((row.head<3>() - Eigen::Vector3d(1, 0.01, 0)).norm(), 1e-9);
        return 2 * std::atan2(row[6], row[3]);
      }
    ADD_FAILURE() << "no frame at " << time;
    return 0.0;
  };
  std::vector<double> linear = turn(0), end = turn(1.2);
  linear.insert(linear.end(), end.begin(), end.end());
  const SkeletonData straight = animated("LINEAR", linear);
  EXPECT_THAT(straight.animations, ElementsAre("nod"));
  EXPECT_EQ(straight.first_frames, (IndexVector(2) << 0, straight.times.size()).finished());
  EXPECT_NEAR(angle_at(straight, 0.25), 0.6, 1e-6);
  EXPECT_NEAR(angle_at(straight, 0.5), 1.2, 1e-6);
  const SkeletonData jump = animated("STEP", linear);
  EXPECT_NEAR(angle_at(jump, 0.25), 0, 1e-6);
  EXPECT_NEAR(angle_at(jump, 0.5), 1.2, 1e-6);
  // Tangents of 0 at both ends: half of the way in the middle, by Hermite's cubic of the components.
  std::vector<double> cubic(4, 0.0);
  cubic.insert(cubic.end(), linear.begin(), linear.begin() + 4);
  cubic.insert(cubic.end(), 8, 0.0);
  cubic.insert(cubic.end(), end.begin(), end.end());
  cubic.insert(cubic.end(), 4, 0.0);
  const double s = 0.2, blend = 3 * s * s - 2 * s * s * s;
  EXPECT_NEAR(angle_at(animated("CUBICSPLINE", cubic), 0.1), 2 * std::atan2(blend * end[2], 1 - blend + blend * end[3]),
              1e-6);
}

TEST_F(GltfBones, LeaveOutWhatStretchesThemAndSaySo) {
  GltfWriter writer = skinned();
  const int times = writer.accessor(kFloat, "SCALAR", {0, 1});
  const int scales = writer.accessor(kFloat, "VEC3", {1, 1, 1, 1, 1.5, 1});
  writer.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 3}, {"path", "scale"}}}}}},
                                {"samplers", {{{"input", times}, {"output", scales}}}}}};
  const SurfaceFile surface = read(writer);
  EXPECT_THAT(surface.remarks, testing::Contains(HasSubstr("stretch bones by up to 50 %")));
  for (Eigen::Index row = 0; row < surface.skeleton->poses.rows(); ++row)
    EXPECT_NEAR(surface.skeleton->poses(row, 3), 1, 1e-9);
}

TEST_F(GltfBones, AreRefusedInWords) {
  using W = GltfWriter;
  struct Case {
    std::string what;
    std::function<void(W&)> change;
    std::string place, expected;
  };
  for (const Case& one : std::vector<Case>{
           {"no such skin", [](W& w) { w.json["nodes"][0]["skin"] = 3; }, "/nodes/0/skin", "a skin below 1"},
           {"a joint out of the scene", [](W& w) { w.json["skins"][0]["joints"][1] = 9; }, "/skins/0/joints/1",
            "a node of the scene"},
           {"no joints", [](W& w) { w.json["skins"][0]["joints"] = json::array(); }, "/skins/0/joints",
            "at least one joint"},
           {"a joint beyond the last", [](W& w) { w.json["skins"][0]["joints"] = {2}; },
            "/meshes/0/primitives/0/attributes/JOINTS_0", "joints below 1"},
           {"joints without weights",
            [](W& w) { w.json["meshes"][0]["primitives"][0]["attributes"].erase("WEIGHTS_0"); },
            "/meshes/0/primitives/0/attributes/WEIGHTS_0", "as there is JOINTS_0"},
           {"weights below 0",
            [](W& w) {
              std::vector<double> weights(16, 0.5);
              weights[5] = -1;
              w.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = w.accessor(kFloat, "VEC4", weights);
            },
            "/meshes/0/primitives/0/attributes/WEIGHTS_0", "weights of at least 0"},
           {"no weight at all",
            [](W& w) {
              w.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] =
                  w.accessor(kFloat, "VEC4", std::vector<double>(16, 0.0));
            },
            "/meshes/0/primitives/0/attributes/WEIGHTS_0", "weights above 0"},
           {"flat matrices",
            [](W& w) {
              w.json["skins"][0]["inverseBindMatrices"] = w.accessor(kFloat, "MAT4", std::vector<double>(32, 0.0));
            },
            "/skins/0/inverseBindMatrices", "matrices that can be inverted"},
           {"too few matrices",
            [](W& w) {
              w.json["skins"][0]["inverseBindMatrices"] = w.accessor(kFloat, "MAT4", translations({{0, 0, 0}}));
            },
            "/skins/0/inverseBindMatrices", "2 matrices"}}) {
    GltfWriter writer = skinned();
    one.change(writer);
    const Complaint found = complaint(writer);
    EXPECT_EQ(found.place, one.place) << one.what;
    EXPECT_THAT(found.expected, HasSubstr(one.expected)) << one.what;
  }
}

}  // namespace
}  // namespace exmat::precompute
