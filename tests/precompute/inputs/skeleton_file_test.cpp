#include "precompute/inputs/skeleton_file.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "common/config/config.h"
#include "precompute/inputs/inputs.h"
#include "precompute/mesh_io/msh_writer.h"
#include "tests/precompute/mesh_io/mesh_samples.h"
#include "tests/support/box_mesh.h"
#include "tests/support/temporary_folder.h"

// Bones of a JSON file on a bar of tets along x, 4 m x 1 m x 1 m, whose vertices lie on nine planes half a metre apart.
namespace exmat::precompute {
namespace skeleton_file_test {

using exmat::test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

class TetBones : public testing::Test {
 protected:
  explicit TetBones(int across = 6) : mesh_(exmat::test::box_mesh({8, across, across}, {4, 1, 1})) {
    write_msh(mesh_, folder_.path("bar.msh"));
    bones_["weights"] = {list("lower", 0, 4, 3), list("upper", 4, 8, 1)};
  }

  int plane(Eigen::Index vertex) const { return static_cast<int>(std::lround(2 * mesh_.vertices(vertex, 0))); }

  // The vertices of the planes `from` to `to`, with a weight that counts on the shared plane alone.
  Json list(const char* joint, int from, int to, double weight) const {
    Json entry = {{"joint", joint}, {"vertices", Json::array()}, {"weights", Json::array()}};
    for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v)
      if (plane(v) >= from && plane(v) <= to) {
        entry["vertices"].push_back(v);
        entry["weights"].push_back(weight);
      }
    return entry;
  }

  AssetConfig asset(const Json& members = Json::object()) {
    folder_.write("bones.json", bones_.dump());
    Json object = {{"mesh", "bar.msh"},
                   {"skeleton", "bones.json"},
                   {"material", {{"youngs_modulus", 1e6}, {"poisson_ratio", 0.3}, {"density", 1000}}}};
    object.merge_patch(members);
    return asset_of({{"name", "bar"}, {"object", object}}, folder_.path("asset.json"));
  }
  ObjectInput read(const Json& members = Json::object()) { return read_object(asset(members), files_); }

  // Weights of the two bones [v x 2] on an .obj surface.
  RowMatrix weights_of_render_mesh(const std::string& surface) {
    folder_.write("skin.obj", surface);
    const AssetConfig config = asset({{"render_mesh", "skin.obj"}});
    std::vector<std::string> warnings;
    const RenderData render = read_render_mesh(config, read_object(config, files_), files_, warnings);
    RowMatrix weights = RowMatrix::Zero(render.vertices.rows(), 2);
    for (Eigen::Index v = 0; v < weights.rows(); ++v)
      for (Eigen::Index k = 0; k < render.bones.cols(); ++k)
        weights(v, render.bones(v, k)) += render.bone_weights(v, k);
    return weights;
  }

  // Distance from the line through the middle of the bar [m].
  double off_middle(Eigen::Index v) const { return (mesh_.vertices.row(v).tail(2).array() - 0.5).matrix().norm(); }

  TemporaryFolder folder_;
  TetMesh mesh_;
  InputFiles files_;
  Json bones_ = {{"joints",
                  {{{"name", "upper"},
                    {"parent", "lower"},
                    {"position", {2, 0.5, 0.5}},
                    {"orientation", {std::sqrt(0.5), 0, std::sqrt(0.5), 0}}},
                   {{"name", "lower"}, {"position", {0, 0.5, 0.5}}}}}};
};

TEST_F(TetBones, AreBoundAndWeightedAsTheFileSays) {
  const SkeletonData skeleton = *read().skeleton;
  EXPECT_THAT(skeleton.bones, ElementsAre("lower", "upper"));
  EXPECT_EQ(skeleton.parents, (IndexVector(2) << -1, 0).finished());
  RowMatrix bind(6, 4);  // a quarter turn about y takes x to -z and z to x
  bind << 1, 0, 0, 0, 0, 1, 0, 0.5, 0, 0, 1, 0.5, 0, 0, 1, 2, 0, 1, 0, 0.5, -1, 0, 0, 0.5;
  EXPECT_LE((skeleton.bind - bind).norm(), 1e-12);
  for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v) {
    const double lower = plane(v) < 4 ? 1 : plane(v) == 4 ? 0.75 : 0;
    ASSERT_LE((skeleton.weights.row(v) - Eigen::RowVector2d(lower, 1 - lower)).norm(), 1e-12) << v;
  }
  EXPECT_EQ(skeleton.first_frames, IndexVector::Zero(1));
}

TEST_F(TetBones, MayHaveSeveralRoots) {
  bones_["joints"][0].erase("parent");
  const SkeletonData skeleton = *read().skeleton;
  EXPECT_THAT(skeleton.bones, ElementsAre("upper", "lower"));
  EXPECT_EQ(skeleton.parents, IndexVector::Constant(2, -1));
}

// Cells are a sixth of a metre across: a vertex beside the middle is 1/6 m from the axis and 1/3 m from the surface.
// The plane at one end has the joint in its middle, that at the other end is beyond the axis.
TEST_F(TetBones, HoldTheVerticesAboutTheirAxes) {
  const ObjectInput object = read();
  EXPECT_THAT(object.warnings, ElementsAre());
  for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v) {
    const bool inside = plane(v) > 0 && plane(v) < 8 && plane(v) != 4;
    const double reach = inside ? 0.17 : plane(v) == 0 ? 0.01 : 0;
    ASSERT_EQ(object.fixed[v], off_middle(v) < reach ? 1 : 0) << v;
  }
  EXPECT_EQ(object.fixed.cast<int>().sum(), 31);
}

TEST_F(TetBones, HoldWhatTheAssetFixesInTheirPlace) {
  const ObjectInput object = read({{"fixed", {{"ids", {5, 7}}}}});
  EXPECT_EQ(object.fixed.cast<int>().sum(), 2);
  EXPECT_TRUE(object.skeleton);
}

// All vertices within a bar of two cells across lie in its middle.
class ThinTetBones : public TetBones {
 protected:
  ThinTetBones() : TetBones(2) {}
};

TEST_F(ThinTetBones, HoldOneBesideTheirAxisWhereTheyWouldTurn) {
  const ObjectInput object = read();
  for (const bool upper : {false, true}) {
    std::vector<double> off;
    for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v)
      if (object.fixed[v] != 0 && (plane(v) > 4) == upper) off.push_back(off_middle(v));
    std::ranges::sort(off);
    EXPECT_THAT(off, ElementsAre(0, 0, 0, 0, 0.5));
  }
}

// Between planes of 0 and of 1 the harmonic field of a bar is a straight line.
TEST_F(TetBones, FillTheWeightsBetweenThoseThatAreGiven) {
  bones_["weights"] = {list("lower", 0, 2, 1), list("upper", 6, 8, 1)};
  const SkeletonData skeleton = *read({{"fixed", {{"ids", {0}}}}}).skeleton;
  for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v) {
    const double upper = std::clamp((plane(v) - 2) / 4.0, 0.0, 1.0);
    const bool given = upper == 0 || upper == 1;
    ASSERT_NEAR(skeleton.weights(v, 1), upper, given ? 0 : 1e-3) << v;
    ASSERT_NEAR(skeleton.weights.row(v).sum(), 1, 1e-12) << v;
  }
}

// The weights are below the one that is left out, and the same everywhere.
TEST_F(TetBones, MayBeVeryManyAtEachVertex) {
  constexpr int kBones = 200;
  bones_ = {{"joints", Json::array()}, {"weights", Json::array()}};
  for (int i = 0; i < kBones; ++i) {
    const std::string name = fmt::format("bone {}", i);
    bones_["joints"].push_back({{"name", name}, {"position", {0.01 * i, 0.5, 0.5}}});
    bones_["weights"].push_back({{"joint", name}, {"vertices", {7}}});
  }
  const RowMatrix weights = read({{"fixed", {{"ids", {7}}}}}).skeleton->weights;
  EXPECT_LE((weights.array() - 1.0 / kBones).abs().maxCoeff(), 1e-9);
}

TEST_F(TetBones, CountVerticesAsTheMeshFileDoes) {
  const TetMesh whole = mesh_;
  mesh_.vertices.resize(whole.vertex_count() + 2, 3);
  mesh_.vertices << Eigen::RowVector3d(9, 9, 9), whole.vertices, Eigen::RowVector3d(4, 9, 9);
  mesh_.tets = whole.tets.array() + 1;
  write_msh(mesh_, folder_.path("bar.msh"));
  bones_["weights"] = {list("lower", 0, 4, 3), list("upper", 4, 8, 1)};
  const ObjectInput object = read({{"drop", {"unreferenced_vertices"}}});
  ASSERT_EQ(object.mesh.vertex_count(), whole.vertex_count());
  for (Eigen::Index v = 0; v < whole.vertex_count(); ++v)
    ASSERT_EQ(object.skeleton->weights(v, 0) > 0, object.mesh.vertices(v, 0) < 2.1) << v;
}

// The lower joint has moved by 0.1 m along z at 0.5 s, with what hangs on it, and the upper one has turned by 60
// degrees about its own z, which is the world's x.
TEST_F(TetBones, MoveAsTheirAnimationsSay) {
  const double half = std::numbers::pi / 6;
  bones_["animations"] = Json::parse(R"([ { "name": "twist", "bones": [
      { "joint": "lower", "motion": [ { "time": 0 }, { "time": 0.5, "position": [0, 0, 0.1] } ] },
      { "joint": "upper", "motion": [ { "time": 0 }, { "time": 0.5 } ] } ] } ])");
  bones_["animations"][0]["bones"][1]["motion"][1]["orientation"] = {std::cos(half), 0, 0, std::sin(half)};
  const SkeletonData skeleton = *read().skeleton;
  EXPECT_THAT(skeleton.animations, ElementsAre("twist"));
  const Eigen::Index frames = skeleton.times.size();
  EXPECT_EQ(skeleton.first_frames, (IndexVector(2) << 0, static_cast<std::int32_t>(frames)).finished());
  EXPECT_EQ(frames, 31);
  EXPECT_EQ(skeleton.times[0], 0);
  EXPECT_EQ(skeleton.times[frames - 1], 0.5);
  Eigen::Matrix<double, 4, 7> expected;
  expected << 0, 0.5, 0.5, 1, 0, 0, 0,  // at the start
      2, 0.5, 0.5, 1, 0, 0, 0,          //
      0, 0.5, 0.6, 1, 0, 0, 0,          // at the end
      2, 0.5, 0.6, std::cos(half), std::sin(half), 0, 0;
  EXPECT_LE((skeleton.poses.topRows(2) - expected.topRows(2)).norm(), 1e-12);
  EXPECT_LE((skeleton.poses.bottomRows(2) - expected.bottomRows(2)).norm(), 1e-12);
}

TEST_F(TetBones, HoldARenderMeshByTheWeightsOfItsTets) {
  const RowMatrix weights = weights_of_render_mesh("v 1 0.5 0.5\nv 2 0.5 0.5\nv 2.25 0 0\nf 1 2 3\n");
  EXPECT_LE((weights - (RowMatrix(3, 2) << 1, 0, 0.75, 0.25, 0.375, 0.625).finished()).norm(), 1e-12);
}

// The last tets, from 3.5 m to 4 m, go from one bone to the other: their affine weights are -0.5 and 1.5 at 4.25 m.
TEST_F(TetBones, HoldARenderMeshOutsideOfItsTetsByWeightsFrom0To1) {
  bones_["weights"] = {list("lower", 0, 7, 1), list("upper", 8, 8, 1)};
  const RowMatrix weights = weights_of_render_mesh("v 4.25 0.5 0.5\nv 3.75 0.5 0.5\nv 3.75 0 0\nf 1 2 3\n");
  EXPECT_LE((weights - (RowMatrix(3, 2) << 0, 1, 0.5, 0.5, 0.5, 0.5).finished()).norm(), 1e-12);
}

TEST_F(TetBones, AreAnInputOfTheBundle) {
  const AssetConfig config = asset();
  read_object(config, files_);
  EXPECT_EQ(std::ranges::count(files_, folder_.path("bones.json")), 1);
  const auto named = named_files(config);
  const auto found = std::ranges::find(named, folder_.path("bones.json"), &NamedFile::file);
  ASSERT_NE(found, named.end());
  EXPECT_EQ(found->place, "/object/skeleton");
}

// One bone holds two vertices, the other hangs with it on all others.
TEST_F(TetBones, AreRefusedWhereTheyHoldTooFewVertices) {
  bones_["weights"] = {list("lower", 0, 8, 1), list("upper", 0, 8, 1)};
  for (const std::size_t alone : {7, 9}) bones_["weights"][1]["weights"][alone] = 0;
  const Complaint complaint = test::complaint_of([this] { read(); });
  EXPECT_EQ(complaint.file, folder_.path("bones.json"));
  EXPECT_EQ(complaint.place, "/weights");
  EXPECT_THAT(complaint.expected, HasSubstr("joints that hold at least three vertices"));
  EXPECT_EQ(complaint.found, "2 by the joint \"lower\"");
  EXPECT_THAT(complaint.advice, HasSubstr("/object/fixed of the asset"));
  EXPECT_EQ(read({{"fixed", {{"ids", {0, 8, 72}}}}}).fixed.cast<int>().sum(), 3);
}

TEST_F(TetBones, AreRefusedWhereTheyHoldAllVertices) {
  mesh_.vertices = (VertexArray(4, 3) << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1).finished();
  mesh_.tets = (TetArray(1, 4) << 0, 1, 2, 3).finished();
  write_msh(mesh_, folder_.path("bar.msh"));
  bones_["weights"] = {list("lower", 0, 2, 1)};
  const Complaint complaint = test::complaint_of([this] { read(); });
  EXPECT_EQ(complaint.file, folder_.path("bones.json"));
  EXPECT_EQ(complaint.found, "all of them held");
}

TEST_F(TetBones, AreRefusedWithThePlaceOfTheFault) {
  struct Fault {
    const char* patch;  // as in RFC 6902
    const char* place;
    const char* expected;
    const char* found;
  };
  const Json sound = bones_;
  for (const Fault& fault : {
           Fault{R"({"op": "remove", "path": "/joints"})", "/joints", "an array", "no such member"},
           {R"({"op": "replace", "path": "/joints/0/name", "value": "lower"})", "/joints/1/name", "each name once",
            "\"lower\" again"},
           {R"({"op": "replace", "path": "/joints/0/parent", "value": "lowr"})", "/joints/0/parent",
            "the name of a joint", "\"lowr\""},
           {R"({"op": "add", "path": "/joints/1/parent", "value": "upper"})", "/joints/0/parent",
            "parents that end at a root", "\"upper\", which hangs on itself"},
           {R"({"op": "replace", "path": "/joints/0/orientation", "value": [1, 1, 0, 0]})", "/joints/0/orientation",
            "a quaternion of length 1", "length 1.41421"},
           {R"({"op": "replace", "path": "/weights/1/joint", "value": "hand"})", "/weights/1/joint",
            "the name of a joint", "\"hand\""},
           {R"({"op": "replace", "path": "/weights/1/joint", "value": "lower"})", "/weights/1/joint", "each joint once",
            "\"lower\" again"},
           {R"({"op": "replace", "path": "/weights/0/vertices/3", "value": 441})", "/weights/0/vertices/3",
            "vertices of the mesh, 0 to 440", "441"},
           {R"({"op": "replace", "path": "/weights/0/vertices/1", "value": 0})", "/weights/0/vertices/1",
            "each vertex once", "0 again"},
           {R"({"op": "replace", "path": "/weights/0/weights/2", "value": -1})", "/weights/0/weights/2",
            "a number >= 0", "-1"},
           {R"({"op": "replace", "path": "/weights/0/weights/2", "value": 0})", "/weights", "a weight above 0",
            "none for vertex 2"},
           {R"({"op": "remove", "path": "/weights/0/weights/2"})", "/weights/0/weights", "one for each vertex", "244"},
           {R"({"op": "add", "path": "/animations", "value":
                [{"name": "a", "bones": [{"joint": "hand", "motion": [{"time": 0}]}]}]})",
            "/animations/0/bones/0/joint", "the name of a joint", "\"hand\""},
           {R"({"op": "add", "path": "/animations", "value":
                [{"name": "a", "bones": [{"joint": "lower", "motion": [{"time": 1}, {"time": 1}]}]}]})",
            "/animations/0/bones/0/motion/1/time", "a number > 1", "1"},
       }) {
    bones_ = sound.patch(Json::array({Json::parse(fault.patch)}));
    const Complaint complaint = test::complaint_of([this] { read(); });
    EXPECT_EQ(complaint.file, folder_.path("bones.json")) << fault.patch;
    EXPECT_EQ(complaint.place, fault.place) << fault.patch;
    EXPECT_THAT(complaint.expected, HasSubstr(fault.expected)) << fault.patch;
    EXPECT_THAT(complaint.found, HasSubstr(fault.found)) << fault.patch;
  }
  bones_ = sound;
  bones_["joints"][0]["parent"] = "lowr";
  EXPECT_EQ(test::complaint_of([this] { read(); }).advice, "did you mean \"lower\"?");
}

}  // namespace skeleton_file_test
}  // namespace exmat::precompute
