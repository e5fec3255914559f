#include "precompute/inputs/assumed_asset.h"

#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <set>

#include "common/config/config.h"
#include "precompute/inputs/inputs.h"
#include "precompute/mesh_io/surface_file.h"
#include "tests/precompute/mesh_io/gltf_samples.h"
#include "tests/support/box_mesh.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

using exmat::test::TemporaryFolder;
using testing::ElementsAre;

TEST(ExampleNames, KeepSafeNames) {
  EXPECT_THAT(example_names({"smile", "Key 1", "tr\xc3\xa8s", "a.b"}),
              ElementsAre("smile", "Key 1", "tr\xc3\xa8s", "a.b"));
}

TEST(ExampleNames, AreSafeAndUnique) {
  const std::string long_name(70, 'x'), accents = [] {
    std::string text = "a";
    for (int k = 0; k < 40; ++k) text += "\xc3\xa9";
    return text;
  }();
  const std::vector<std::string> morphs{
      "mouth/open", "mouth_open",        ".", "..", "gram", "h0", "hq", "a\nb", long_name, long_name + "1",
      accents,      std::string(64, 'x')};
  const std::vector<std::string> names = example_names(morphs);
  ASSERT_EQ(names.size(), morphs.size());
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
  EXPECT_EQ(names[1], "mouth_open");  // it is safe, so it stays
  EXPECT_EQ(names[11], std::string(64, 'x'));
  Json examples = Json::array();
  for (std::size_t k = 0; k < names.size(); ++k) {
    EXPECT_LE(names[k].size(), 64) << names[k];
    examples.push_back({{"name", names[k]}, {"morph", morphs[k]}});
  }
  // As one would write it: the schema and what is checked beside it take the names, and none ends within a character.
  const Json asset = {{"name", "a"}, {"object", {{"surface", "a.glb"}}}, {"examples", examples}};
  const AssetConfig config = asset_of(Json::parse(asset.dump()), "asset.json");
  EXPECT_EQ(config.examples[0].morph, "mouth/open");
}

/// A box of 200 vertices apart, with as many targets, the k-th of which moves one vertex by k.
std::filesystem::path box_with_targets(const TemporaryFolder& folder, int targets) {
  test::GltfWriter writer;
  const std::vector<double> corners{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  Json list = Json::array();
  for (int k = 0; k < targets; ++k) {
    std::vector<double> moved(12, 0);
    moved[0] = k + 1;
    list.push_back({{"POSITION", writer.positions(moved)}});
  }
  const int positions = writer.positions(corners);
  const int triangles = writer.accessor(test::kUnsignedByte, "SCALAR", {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3});
  writer.mesh_in_node("box", {{"attributes", {{"POSITION", positions}}}, {"indices", triangles}, {"targets", list}});
  return folder.write("box.glb", writer.glb());
}

TEST(AssumedAsset, TakesTheFirst64Targets) {
  const TemporaryFolder folder;
  for (const auto& [targets, examples] : {std::pair{0, 0}, {3, 3}, {64, 64}, {70, 64}}) {
    const Json asset = assumed_asset(box_with_targets(folder, targets), folder.path());
    const AssetConfig config = asset_of(asset, folder / "asset.json");
    EXPECT_EQ(config.examples.size(), examples);
  }
}

// The clamp is a corner's edge: two of four vertices.
TEST(AssumedAsset, FollowsWhereATargetMovesTheClamp) {
  const TemporaryFolder folder;
  const auto follows = [&](const std::vector<double>& moves) {
    test::GltfWriter writer;
    const int target = writer.positions(moves);
    const int positions = writer.positions({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1});
    const int fixed = writer.accessor(test::kFloat, "SCALAR", {1, 1, 0, 0});
    const int triangles = writer.accessor(test::kUnsignedByte, "SCALAR", {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3});
    writer.mesh_in_node("box", {{"attributes", {{"POSITION", positions}, {"_FIXED", fixed}}},
                                {"indices", triangles},
                                {"targets", {{{"POSITION", target}}}}});
    const Json asset = assumed_asset(folder.write("box.glb", writer.glb()), folder.path());
    const AssetConfig config = asset_of(asset, folder / "asset.json");
    EXPECT_EQ(asset["object"]["fixed"].contains("follow"), config.clamp_follows);
    return config.clamp_follows;
  };
  EXPECT_FALSE(follows({0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0})) << "beside the clamp";
  EXPECT_FALSE(follows({1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0})) << "all of the clamp";
  // One end of the clamp: so far that its two halves about the mean are 2.1 and 1.9 % of the rest.
  EXPECT_TRUE(follows({0, 0, 0, 0.021 * std::sqrt(2), 0, 0, 0, 0, 0, 0, 0, 1}));
  EXPECT_FALSE(follows({0, 0, 0, 0.019 * std::sqrt(2), 0, 0, 0, 0, 0, 0, 0, 1}));
}

TEST(AssumedAsset, CutsItsNameBetweenCharacters) {
  const TemporaryFolder folder;
  const auto file = box_with_targets(folder, 0);
  std::string stem(63, 'x');
  const auto renamed = folder / (stem + "\xc3\xa9tude.glb");
  std::filesystem::rename(file, renamed);
  EXPECT_EQ(assumed_asset(renamed, folder.path())["name"], stem);
}

// In centimetres the same body: vertices, poses and render mesh.
TEST(LengthUnit, HoldsForAllMeshesOfAnAsset) {
  const TemporaryFolder folder;
  const auto write_mesh = [&](const char* name, double scale) {
    const TetMesh mesh = exmat::test::box_mesh({2, 1, 1}, {2 * scale, scale, scale});
    std::string text = "*VERTICES\n" + std::to_string(mesh.vertex_count()) + " 3\n";
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
      text += std::to_string(v + 1) + " " + std::to_string(mesh.vertices(v, 0)) + " " +
              std::to_string(mesh.vertices(v, 1)) + " " + std::to_string(mesh.vertices(v, 2)) + "\n";
    text += "*ELEMENTS\nTET\n" + std::to_string(mesh.tet_count()) + " 4\n";
    for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
      text += std::to_string(t + 1) + " " + std::to_string(mesh.tets(t, 0) + 1) + " " +
              std::to_string(mesh.tets(t, 1) + 1) + " " + std::to_string(mesh.tets(t, 2) + 1) + " " +
              std::to_string(mesh.tets(t, 3) + 1) + "\n";
    folder.write(name, text);
  };
  write_mesh("a.veg", 100);
  write_mesh("b.veg", 110);
  folder.write("draw.obj", "v 0 0 0\nv 100 0 0\nv 0 100 0\nf 1 2 3\n");
  const Json json = {{"name", "a"},
                     {"object",
                      {{"mesh", "a.veg"},
                       {"unit", "cm"},
                       {"render_mesh", "draw.obj"},
                       {"material", {{"youngs_modulus", 1e6}, {"poisson_ratio", 0.3}, {"density", 1000}}}}},
                     {"examples", {{{"name", "large"}, {"mesh", "b.veg"}}}}};
  const AssetConfig asset = asset_of(json, folder / "asset.json");
  InputFiles files;
  std::vector<std::string> warnings;
  const ObjectInput object = read_object(asset, files);
  EXPECT_NEAR(object.mesh.vertices.maxCoeff(), 2, 1e-12);
  EXPECT_NEAR(read_examples(asset, object, files).poses.at(0).mesh.vertices.maxCoeff(), 2.2, 1e-12);
  EXPECT_NEAR(read_render_mesh(asset, object, files, warnings).vertices.maxCoeff(), 1, 1e-12);
  EXPECT_TRUE(warnings.empty());
}

}  // namespace
}  // namespace exmat::precompute
