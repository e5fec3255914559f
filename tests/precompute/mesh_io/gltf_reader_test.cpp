#include "precompute/mesh_io/gltf_reader.h"

#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <set>

#include "tests/precompute/mesh_io/gltf_samples.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using namespace test;

const std::vector<double> kSquare{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0.5};
const std::vector<double> kTwoTriangles{0, 1, 2, 0, 2, 3};

VertexArray rows(const std::vector<double>& numbers) {
  return Eigen::Map<const VertexArray>(numbers.data(), static_cast<Eigen::Index>(numbers.size() / 3), 3);
}

TriangleArray corners(const std::vector<std::int32_t>& numbers) {
  return Eigen::Map<const TriangleArray>(numbers.data(), static_cast<Eigen::Index>(numbers.size() / 3), 3);
}

FlagVector flags(const std::vector<std::uint8_t>& numbers) {
  return Eigen::Map<const FlagVector>(numbers.data(), static_cast<Eigen::Index>(numbers.size()));
}

// A square of two triangles.
GltfWriter square() {
  GltfWriter writer;
  const int positions = writer.positions(kSquare), indices = writer.accessor(kUnsignedShort, "SCALAR", kTwoTriangles);
  writer.mesh_in_node("body", {{"attributes", {{"POSITION", positions}}}, {"indices", indices}});
  return writer;
}

json& primitive(GltfWriter& writer) { return writer.json["meshes"][0]["primitives"][0]; }

class ReadGltf : public testing::Test {
 protected:
  SurfaceFile read(const GltfWriter& writer) const { return read_gltf(folder_.write("body.glb", writer.glb())); }
  Complaint complaint(const GltfWriter& writer) const {
    return complaint_of([&] { read(writer); });
  }

  TemporaryFolder folder_;
};

TEST_F(ReadGltf, GivesVerticesTrianglesAndFile) {
  const SurfaceFile surface = read(square());
  EXPECT_EQ(surface.mesh.vertices, rows(kSquare));
  EXPECT_EQ(surface.mesh.triangles, corners({0, 1, 2, 0, 2, 3}));
  EXPECT_THAT(surface.morphs, IsEmpty());
  EXPECT_EQ(surface.colours.rows(), 0);
  EXPECT_THAT(surface.files, ElementsAre(folder_ / "body.glb"));
  EXPECT_THAT(surface.remarks, IsEmpty());
  EXPECT_THAT(surface.parts, ElementsAre(testing::Pair("body", flags({1, 1, 1, 1}))));
}

TEST_F(ReadGltf, TakesBuffersOfTheTextAndOfFilesBelowItsFolder) {
  const GltfWriter writer = square();
  EXPECT_EQ(read_gltf(folder_.write("a.gltf", writer.gltf())).mesh.vertices, rows(kSquare));
  folder_.write("below/the data.bin", writer.buffer());
  const SurfaceFile surface = read_gltf(folder_.write("b.gltf", writer.gltf("below/the%20data.bin")));
  EXPECT_EQ(surface.mesh.vertices, rows(kSquare));
  EXPECT_THAT(surface.files, ElementsAre(folder_ / "b.gltf", folder_ / "below/the data.bin"));
}

TEST_F(ReadGltf, TakesNoBuffersOfOtherFolders) {
  const GltfWriter writer = square();
  folder_.write("other.bin", writer.buffer());
  for (const char* uri :
       {"../other.bin", "%2e%2e/other.bin", "none.bin", "/etc/passwd", "/dev/zero", "file:///etc/passwd"}) {
    const auto file = folder_.write("inner/a.gltf", writer.gltf(uri));
    const Complaint complaint = complaint_of([&] { read_gltf(file); });
    EXPECT_THAT(complaint.expected, HasSubstr("in its folder")) << uri;
    const bool is_outside = *uri == '.' || *uri == '%' || *uri == '/';
    EXPECT_EQ(complaint.place, is_outside ? "/buffers/0/uri" : "") << uri;
    EXPECT_EQ(complaint.advice.starts_with("files outside the folder of the model are not read"), is_outside) << uri;
  }
}

TEST_F(ReadGltf, TakesMorphTargetsByName) {
  GltfWriter writer = square();
  const std::vector<double> up{0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0, 4};
  primitive(writer)["targets"] = {{{"POSITION", writer.positions(up)}}, json::object()};
  writer.json["meshes"][0]["extras"]["targetNames"] = {"raise"};
  const SurfaceFile surface = read(writer);
  ASSERT_EQ(surface.morphs.size(), 1);
  EXPECT_EQ(surface.morphs[0].name, "raise");
  EXPECT_EQ(surface.morphs[0].positions, rows(kSquare) + rows(up));
  EXPECT_THAT(surface.remarks, ElementsAre("the morph target \"target 1\" moves no vertex and is left out"));
}

// The rest shape as a target: of zeros, of the noise of its numbers, of an accessor without a view.
TEST_F(ReadGltf, LeavesOutTargetsThatMoveNothing) {
  GltfWriter writer = square();
  const int zeros = writer.positions(std::vector<double>(12, 0)),
            noise = writer.positions(std::vector<double>(12, 3e-7)),
            little = writer.positions(std::vector<double>(12, 3e-6));
  writer.json["accessors"].push_back({{"componentType", 5126}, {"count", 4}, {"type", "VEC3"}});
  primitive(writer)["targets"] = {{{"POSITION", zeros}},
                                  {{"POSITION", noise}},
                                  {{"POSITION", writer.json["accessors"].size() - 1}},
                                  {{"POSITION", little}}};
  const SurfaceFile surface = read(writer);
  ASSERT_EQ(surface.morphs.size(), 1);
  EXPECT_EQ(surface.morphs[0].name, "target 3");
  EXPECT_EQ(surface.remarks.size(), 3);
}

TEST_F(ReadGltf, TakesAccessorsWithoutAViewAsZeros) {
  GltfWriter writer = square();
  writer.json["accessors"].push_back({{"componentType", 5126}, {"count", 4}, {"type", "SCALAR"}});
  primitive(writer)["attributes"]["_NONE"] = writer.json["accessors"].size() - 1;
  const SurfaceFile surface = read(writer);
  EXPECT_EQ(surface.mesh.vertices, rows(kSquare));
  EXPECT_FALSE(surface.parts.contains("_NONE"));
}

TEST_F(ReadGltf, KeepsTargetsOfOneNameInOneMeshApart) {
  GltfWriter writer = square();
  json& targets = primitive(writer)["targets"];
  for (int k = 1; k <= 4; ++k) {
    std::vector<double> up(12, 0);
    up[2] = k;
    targets.push_back({{"POSITION", writer.positions(up)}});
  }
  writer.json["meshes"][0]["extras"]["targetNames"] = {"a", "a", "a 2", "a"};
  const SurfaceFile surface = read(writer);
  ASSERT_EQ(surface.morphs.size(), 4);
  std::set<std::string> names;
  for (std::size_t k = 0; k < 4; ++k) {
    names.insert(surface.morphs[k].name);
    EXPECT_EQ(surface.morphs[k].positions(0, 2), static_cast<double>(k + 1));
  }
  EXPECT_EQ(names.size(), 4);
}

TEST_F(ReadGltf, TakesNamesThatWereCutInsideACharacter) {
  GltfWriter writer = square();
  json& targets = primitive(writer)["targets"];
  for (int k = 0; k < 2; ++k) targets.push_back({{"POSITION", writer.positions(std::vector<double>(12, 1))}});
  writer.json["meshes"][0]["extras"]["targetNames"] = {"AB", "CD"};
  std::string bytes = writer.glb();
  bytes.replace(bytes.find("AB"), 2, "a\xc3");
  bytes.replace(bytes.find("CD"), 2, "a\xe2");
  const SurfaceFile surface = read_gltf(folder_.write("cut.glb", bytes));
  ASSERT_EQ(surface.morphs.size(), 2);
  EXPECT_EQ(surface.morphs[0].name, "a\xef\xbf\xbd");
  EXPECT_EQ(surface.morphs[1].name, "a\xef\xbf\xbd 2");
}

TEST_F(ReadGltf, TakesTargetsOfOneNameInSeveralMeshesAsOne) {
  GltfWriter writer;
  const int positions = writer.positions(kSquare), up = writer.positions({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  for (const char* name : {"left", "right"}) {
    writer.mesh_in_node(name,
                        {{"attributes", {{"POSITION", positions}}}, {"mode", 5}, {"targets", {{{"POSITION", up}}}}});
    writer.json["meshes"].back()["extras"]["targetNames"] = {"raise"};
  }
  writer.json["nodes"][1]["translation"] = {0, 0, 7};
  const SurfaceFile surface = read(writer);
  ASSERT_EQ(surface.morphs.size(), 1);
  EXPECT_EQ((surface.morphs[0].positions - surface.mesh.vertices).eval(), Eigen::RowVector3d(0, 0, 1).replicate(8, 1));
  EXPECT_THAT(surface.remarks, ElementsAre("2 meshes in 2 nodes are taken as one object"));
  EXPECT_EQ(surface.parts.at("left"), flags({1, 1, 1, 1, 0, 0, 0, 0}));
}

TEST_F(ReadGltf, AppliesTransformsOfNodesAndTurnsMirroredTriangles) {
  GltfWriter writer = square();
  writer.json["nodes"][0]["scale"] = {2, 3, -4};
  // A quarter turn about z: x to y, y to -x. The middle node moves before it turns.
  writer.json["nodes"].push_back(
      {{"name", "middle"}, {"children", {0}}, {"translation", {10, 20, 30}}, {"rotation", {0, 0, 0.5, 0.5}}});
  writer.json["nodes"].push_back(
      {{"name", "top"}, {"children", {1}}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0, 100, 0, 0, 1}}});
  writer.json["scenes"][0]["nodes"] = {2};
  const SurfaceFile surface = read(writer);
  for (Eigen::Index v = 0; v < 4; ++v) {
    const double x = kSquare[static_cast<std::size_t>(3 * v)], y = kSquare[static_cast<std::size_t>(3 * v + 1)],
                 z = kSquare[static_cast<std::size_t>(3 * v + 2)];
    // The quaternion is normalised with the square root of a half, which is rounded.
    EXPECT_LT((surface.mesh.vertices.row(v) - Eigen::RowVector3d(110 - 3 * y, 20 + 2 * x, 2 * (30 - 4 * z))).norm(),
              1e-13);
  }
  EXPECT_EQ(surface.mesh.triangles, corners({0, 2, 1, 0, 3, 2}));
  EXPECT_TRUE(surface.parts.contains("top") && surface.parts.contains("middle"));
}

TEST_F(ReadGltf, TakesAllRootsWithoutScenesAndTheDefaultSceneOfSeveral) {
  GltfWriter writer = square();
  writer.json["nodes"].push_back({{"children", {0}}, {"translation", {1, 0, 0}}});
  writer.json.erase("scenes");
  writer.json.erase("scene");
  EXPECT_EQ(read(writer).mesh.vertices(0, 0), 1);
  writer.json["scenes"] = {{{"nodes", {1}}}, {{"nodes", {0}}}};
  EXPECT_EQ(read(writer).mesh.vertices(0, 0), 1);
  writer.json["scene"] = 1;
  EXPECT_EQ(read(writer).mesh.vertices(0, 0), 0);
}

TEST_F(ReadGltf, TakesAMeshInSeveralNodesSeveralTimes) {
  GltfWriter writer = square();
  writer.json["scenes"][0]["nodes"] = {0, 1};
  writer.json["nodes"].push_back({{"mesh", 0}, {"translation", {0, 0, 5}}});
  const SurfaceFile surface = read(writer);
  EXPECT_EQ(surface.mesh.vertices.bottomRows(4), rows(kSquare).rowwise() + Eigen::RowVector3d(0, 0, 5));
  EXPECT_EQ(surface.mesh.triangles.bottomRows(2), corners({4, 5, 6, 4, 6, 7}));
  EXPECT_THAT(surface.remarks, ElementsAre("1 mesh in 2 nodes are taken as one object"));
}

TEST_F(ReadGltf, SharesVerticesOfPrimitivesWithTheSameAttributesAndNamesMaterials) {
  GltfWriter writer = square();
  writer.json["materials"] = {{{"name", "skin"}}, {{"name", "cloth"}}};
  json other = primitive(writer);
  primitive(writer)["indices"] = writer.accessor(kUnsignedByte, "SCALAR", {0, 1, 2});
  primitive(writer)["material"] = 0;
  other["indices"] = writer.accessor(kUnsignedInt, "SCALAR", {0, 2, 3});
  other["material"] = 1;
  writer.json["meshes"][0]["primitives"].push_back(other);
  const SurfaceFile surface = read(writer);
  EXPECT_EQ(surface.mesh.vertices, rows(kSquare));
  EXPECT_EQ(surface.mesh.triangles, corners({0, 1, 2, 0, 2, 3}));
  EXPECT_EQ(surface.parts.at("skin"), flags({1, 1, 1, 0}));
  EXPECT_EQ(surface.parts.at("cloth"), flags({1, 0, 1, 1}));
}

TEST_F(ReadGltf, TakesStripsAndFansAndLeavesOutPointsAndLines) {
  GltfWriter writer = square();
  json& primitives = writer.json["meshes"][0]["primitives"];
  const json whole = {{"attributes", primitives[0]["attributes"]}};
  primitives = json::array();
  for (const int mode : {5, 6, 0, 1, 2, 3}) {
    primitives.push_back(whole);
    primitives.back()["mode"] = mode;
  }
  const SurfaceFile surface = read(writer);
  EXPECT_EQ(surface.mesh.triangles, corners({0, 1, 2, 1, 3, 2, 1, 2, 0, 2, 3, 0}));
  EXPECT_THAT(surface.remarks, ElementsAre("primitives of points or lines are left out: 4"));
}

TEST_F(ReadGltf, TakesColoursAndCustomAttributes) {
  GltfWriter writer = square();
  json& attributes = primitive(writer)["attributes"];
  attributes["COLOR_0"] =
      writer.accessor(kUnsignedByte, "VEC4", {255, 0, 0, 255, 0, 51, 0, 255, 0, 0, 102, 0, 9, 9, 9, 9}, true);
  attributes["_FIXED"] = writer.accessor(kFloat, "SCALAR", {1, 0.5, 0.75, 0});
  attributes["_PIN"] = writer.accessor(kUnsignedShort, "SCALAR", {0, 1, 0, 7});
  attributes["_AXES"] = writer.positions(kSquare);
  const SurfaceFile surface = read(writer);
  EXPECT_EQ(surface.colours, rows({1, 0, 0, 0, 51 / 255.0, 0, 0, 0, 102 / 255.0, 9 / 255.0, 9 / 255.0, 9 / 255.0}));
  EXPECT_EQ(surface.parts.at("_FIXED"), flags({1, 0, 1, 0}));
  EXPECT_EQ(surface.parts.at("_PIN"), flags({0, 1, 0, 1}));
  EXPECT_THAT(surface.remarks, ElementsAre(HasSubstr("_AXES")));
  attributes["COLOR_0"] = writer.accessor(kUnsignedShort, "VEC3", {65535, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 13107}, true);
  EXPECT_EQ(read(writer).colours.row(3), Eigen::RowVector3d(0, 0, 0.2));
}

TEST_F(ReadGltf, TakesQuantisedPositions) {
  GltfWriter writer = square();
  writer.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  json& position = primitive(writer)["attributes"]["POSITION"];
  position = writer.accessor(kByte, "VEC3", {0, 0, 0, 127, 0, 0, 127, -127, 0, -128, 1, 0}, true);
  EXPECT_EQ(read(writer).mesh.vertices, rows({0, 0, 0, 1, 0, 0, 1, -1, 0, -1, 1 / 127.0, 0}));
  position = writer.accessor(kShort, "VEC3", {0, 0, 0, 32767, 0, 0, 32767, -32768, 0, -1, 1, 0});
  EXPECT_EQ(read(writer).mesh.vertices, rows({0, 0, 0, 32767, 0, 0, 32767, -32768, 0, -1, 1, 0}));
}

TEST_F(ReadGltf, TakesRowsOfAStride) {
  GltfWriter writer = square();
  writer.json["bufferViews"].push_back({{"buffer", 0}, {"byteLength", 44}, {"byteStride", 16}});
  const int view = writer.view(gltf_bytes(kFloat, {9, 1, 2, 3, 9, 4, 5, 6, 9, 7, 8, 9}), 16);
  json& accessor = writer.json["accessors"][0];
  accessor["bufferView"] = view;
  accessor["byteOffset"] = 4;
  accessor["count"] = 3;
  primitive(writer)["indices"] = writer.accessor(kUnsignedByte, "SCALAR", {0, 1, 2});
  EXPECT_EQ(read(writer).mesh.vertices, rows({1, 2, 3, 4, 5, 6, 7, 8, 9}));
}

TEST_F(ReadGltf, TakesSparseAccessors) {
  GltfWriter writer = square();
  const json sparse = {
      {"count", 2},
      {"indices", {{"bufferView", writer.view(gltf_bytes(kUnsignedByte, {1, 3}))}, {"componentType", 5121}}},
      {"values", {{"bufferView", writer.view(gltf_bytes(kFloat, {1, 2, 3, 4, 5, 6}))}}}};
  writer.json["accessors"].push_back({{"componentType", 5126}, {"count", 4}, {"type", "VEC3"}, {"sparse", sparse}});
  primitive(writer)["targets"] = {{{"POSITION", writer.json["accessors"].size() - 1}}};
  const std::vector<double> moved{0, 0, 0, 1, 2, 3, 0, 0, 0, 4, 5, 6};
  EXPECT_EQ(read(writer).morphs.at(0).positions, rows(kSquare) + rows(moved));
  writer.json["accessors"][0]["sparse"] = sparse;
  EXPECT_EQ(read(writer).mesh.vertices, rows({0, 0, 0, 1, 2, 3, 1, 1, 0, 4, 5, 6}));
}

struct Malformed {
  const char* name;
  std::function<void(GltfWriter&)> change;
  const char *place, *expected, *found, *advice = "";
};

void PrintTo(const Malformed& malformed, std::ostream* stream) { *stream << malformed.name; }

class RefusesGltf : public testing::TestWithParam<Malformed> {};

TEST_P(RefusesGltf, WithPlaceExpectedFoundAndAdvice) {
  const TemporaryFolder folder;
  GltfWriter writer = square();
  GetParam().change(writer);
  const auto file = folder.write("body.glb", writer.glb());
  const Complaint complaint = complaint_of([&] { read_gltf(file); });
  EXPECT_EQ(complaint.file, file.string());
  EXPECT_EQ(complaint.place, GetParam().place);
  EXPECT_THAT(complaint.expected, HasSubstr(GetParam().expected));
  EXPECT_THAT(complaint.found, HasSubstr(GetParam().found));
  EXPECT_THAT(complaint.advice, HasSubstr(GetParam().advice));
}

using W = GltfWriter;
const std::vector<Malformed> kMalformed{
    {"Draco", [](W& w) { w.json["extensionsRequired"] = {"KHR_draco_mesh_compression"}; }, "/extensionsRequired/0",
     "without compression", "KHR_draco", "export without compression"},
    {"DracoWithoutSayingSo",
     [](W& w) {
       primitive(w)["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
       w.json["accessors"][0].erase("bufferView");
     },
     "/meshes/0/primitives/0/extensions", "without compression", "KHR_draco", "export without compression"},
    {"Meshopt", [](W& w) { w.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = json::object(); },
     "/bufferViews/0/extensions", "without compression", "EXT_meshopt", "export without compression"},
    {"UnknownExtension",
     [](W& w) {
       w.json["extensionsRequired"] = {"KHR_materials_unlit", "EXT_mesh_gpu_instancing"};
     },
     "/extensionsRequired/1", "no extension but", "EXT_mesh_gpu_instancing", "without this extension"},
    {"Skin", [](W& w) { w.json["nodes"][0]["skin"] = 0; }, "/nodes/0/skin", "a skin below 0", "0", ""},
    {"OldVersion", [](W& w) { w.json["asset"]["version"] = "1.0"; }, "/asset/version", "version 2.0", "1.0"},
    {"NoAsset", [](W& w) { w.json.erase("asset"); }, "/asset", "the version", "none"},
    {"NegativeOffset", [](W& w) { w.json["accessors"][0]["byteOffset"] = -4; }, "/accessors/0/byteOffset",
     "an integer from 0", "-4"},
    {"FractionalCount", [](W& w) { w.json["accessors"][0]["count"] = 2.5; }, "/accessors/0/count", "an integer from 0",
     "2.5"},
    {"CountBeyondTheView", [](W& w) { w.json["accessors"][0]["count"] = 5; }, "/accessors/0", "within the 48 bytes",
     "5 rows"},
    {"HugeCount", [](W& w) { w.json["accessors"][0]["count"] = 2147483647; }, "/meshes/0/primitives/0", "at most",
     "more"},
    {"NoView", [](W& w) { w.json["accessors"][0].erase("bufferView"); }, "/accessors/0", "a view", "none"},
    {"ViewAbove", [](W& w) { w.json["accessors"][0]["bufferView"] = 2; }, "/accessors/0/bufferView", "a view below 2",
     "2"},
    {"BufferAbove", [](W& w) { w.json["bufferViews"][0]["buffer"] = 1; }, "/bufferViews/0/buffer", "a buffer below 1",
     "1"},
    {"ViewBeyondTheBuffer", [](W& w) { w.json["bufferViews"][0]["byteLength"] = 1000; }, "/bufferViews/0",
     "bytes of a buffer of 60", "1000 from 0"},
    {"StrideTooSmall", [](W& w) { w.json["bufferViews"][0]["byteStride"] = 8; }, "/bufferViews/0/byteStride",
     "at least 12", "8"},
    {"UnknownComponents", [](W& w) { w.json["accessors"][0]["componentType"] = 5124; }, "/accessors/0/componentType",
     "a type", "5124"},
    {"PositionsOf32Bits", [](W& w) { w.json["accessors"][0]["componentType"] = 5125; }, "/accessors/0/componentType",
     "16 bits", "32"},
    {"PositionsOfTwo", [](W& w) { w.json["accessors"][0]["type"] = "VEC2"; }, "/accessors/0/type", "VEC3", "another"},
    {"NanPosition",
     [](W& w) {
       primitive(w)["attributes"]["POSITION"] = w.accessor(kFloat, "VEC3", {0, 0, 0, 1, 0, NAN, 0, 1, 0, 1, 1, 1});
     },
     "/accessors/2", "finite numbers", "others"},
    {"RealCorners", [](W& w) { w.json["accessors"][1]["componentType"] = 5126; }, "/accessors/1", "unsigned integers",
     "another"},
    {"CornerAbove",
     [](W& w) {
       primitive(w)["indices"] = w.accessor(kUnsignedByte, "SCALAR", {0, 1, 4});
     },
     "/accessors/2", "vertices below 4", "4"},
    {"CornersOfNoTriangle", [](W& w) { w.json["accessors"][1]["count"] = 5; }, "/meshes/0/primitives/0",
     "three corners", "5 corners"},
    {"AccessorAbove", [](W& w) { primitive(w)["attributes"]["POSITION"] = 9; }, "/accessors", "an accessor below 2",
     "9"},
    {"NoPosition", [](W& w) { primitive(w)["attributes"] = json::object(); }, "/meshes/0/primitives/0/attributes",
     "POSITION", "none"},
    {"UnknownMode", [](W& w) { primitive(w)["mode"] = 7; }, "/meshes/0/primitives/0/mode", "0 to 6", "7"},
    {"MaterialAbove", [](W& w) { primitive(w)["material"] = 0; }, "/meshes/0/primitives/0/material",
     "a material below 0", "0"},
    {"TargetOfAnotherCount",
     [](W& w) {
       primitive(w)["targets"] = {{{"POSITION", w.positions({0, 0, 1})}}};
     },
     "/accessors/2/count", "4, as the positions have", "1"},
    {"TargetsOfOnePrimitive",
     [](W& w) {
       w.json["meshes"][0]["primitives"].push_back(primitive(w));
       primitive(w)["targets"] = {{{"POSITION", 0}}};
     },
     "/meshes/0/primitives/1/targets", "1 targets", "0"},
    {"MeshAbove", [](W& w) { w.json["nodes"][0]["mesh"] = 1; }, "/nodes/0/mesh", "a mesh below 1", "1"},
    {"NodeAbove", [](W& w) { w.json["nodes"][0]["children"] = {1}; }, "/nodes/0/children", "a node below 1", "1"},
    {"Cycle", [](W& w) { w.json["nodes"][0]["children"] = {0}; }, "/nodes/0/children", "trees", "node 0 twice"},
    {"SceneAbove", [](W& w) { w.json["scene"] = 1; }, "/scene", "a scene below 1", "1"},
    {"EmptyScene", [](W& w) { w.json["scenes"][0]["nodes"] = json::array(); }, "", "triangles in the nodes", "none"},
    {"Projection", [](W& w) { w.json["nodes"][0]["matrix"] = {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; },
     "/nodes/0/matrix", "0 0 0 1", "another"},
    {"ShortMatrix",
     [](W& w) {
       w.json["nodes"][0]["matrix"] = {1, 0, 0};
     },
     "/nodes/0/matrix", "16 numbers", "another"},
    {"NoRotation",
     [](W& w) {
       w.json["nodes"][0]["rotation"] = {0, 0, 0, 0};
     },
     "/nodes/0/rotation", "a unit quaternion", "0"},
    {"HugeScale",
     [](W& w) {
       w.json["nodes"][0]["scale"] = {1e308, 1e308, 1e308};
       w.json["nodes"][0]["translation"] = {1.7e308, 0, 0};
     },
     "/meshes/0", "finite positions", "others"},
    {"SparseRowAbove",
     [](W& w) {
       w.json["accessors"][0]["sparse"] = {
           {"count", 1},
           {"indices", {{"bufferView", w.view(std::string(1, '\4'))}, {"componentType", 5121}}},
           {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/indices", "rows below 4", "4"},
    {"SparseCountAbove",
     [](W& w) {
       w.json["accessors"][0]["sparse"] = {
           {"count", 5}, {"indices", {{"bufferView", 0}, {"componentType", 5121}}}, {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/count", "at most 4", "5"},
    {"SecondBufferWithoutUri",
     [](W& w) {
       w.json["buffers"].push_back({{"byteLength", 4}});
     },
     "/buffers/1/uri", "but the first", "none"},
    {"NameOfAnotherKind", [](W& w) { w.json["nodes"][0]["name"] = 7; }, "/nodes/0/name", "a string", "number"},
    {"ManyInstances",
     [](W& w) {
       // 2000 instances of 1000 targets of 4 positions.
       json one = primitive(w);
       for (int k = 0; k < 1000; ++k) one["targets"].push_back({{"POSITION", 0}});
       w.json["meshes"][0]["primitives"] = {one};
       for (int k = 1; k < 2000; ++k) {
         w.json["nodes"].push_back({{"mesh", 0}});
         w.json["scenes"][0]["nodes"].push_back(k);
       }
     },
     "/meshes/0/primitives/0", "for the file's size", "more", "join the instances"},
};

INSTANTIATE_TEST_SUITE_P(Malformed, RefusesGltf, testing::ValuesIn(kMalformed),
                         [](const auto& param) { return std::string(param.param.name); });

TEST_F(ReadGltf, RefusesDeepJsonAndWhatIsNone) {
  const auto deep = folder_.write("deep.gltf", std::string(100000, '['));
  EXPECT_THAT(complaint_of([&] { read_gltf(deep); }).expected, HasSubstr("256 levels"));
  const auto other = folder_.write("other.gltf", "solid");
  EXPECT_EQ(complaint_of([&] { read_gltf(other); }).expected, "JSON");
}

// The text ends at a zero byte: padding may follow, nothing else.
TEST_F(ReadGltf, RefusesWhatFollowsJson) {
  const std::string whole = square().glb();
  const std::size_t text = 20, end = whole.find("BIN") - 4;
  const auto with = [&](const std::string& tail) {
    std::string bytes = whole;
    const std::size_t last = bytes.find_last_of('}', end) + 1;
    std::string chunk = bytes.substr(text, last - text) + tail;
    chunk.append((4 - chunk.size() % 4) % 4, ' ');
    std::string glb = bytes.substr(0, text) + chunk + bytes.substr(end);
    for (std::size_t k = 0; k < 4; ++k) {
      glb[8 + k] = static_cast<char>(glb.size() >> (8 * k));
      glb[12 + k] = static_cast<char>(chunk.size() >> (8 * k));
    }
    return folder_.write("tail.glb", glb);
  };
  const auto padded = with(std::string(4, '\0'));
  EXPECT_NO_THROW(read_gltf(padded));
  const auto hidden = with(std::string("\0{}", 3));
  EXPECT_THAT(complaint_of([&] { read_gltf(hidden); }).found, HasSubstr("character U+0000"));
  const auto more = with(" {}");
  EXPECT_EQ(complaint_of([&] { read_gltf(more); }).expected, "JSON");
}

TEST_F(ReadGltf, RefusesDamagedContainers) {
  const std::string whole = square().glb();
  const auto refused = [&](std::size_t byte, char value) {
    std::string bytes = whole;
    bytes[byte] = value;
    const auto file = folder_.write("bad.glb", bytes);
    return complaint_of([&] { read_gltf(file); });
  };
  EXPECT_EQ(refused(4, 1).expected, "version 2");
  EXPECT_THAT(refused(11, 1).expected, HasSubstr("bytes"));
  const auto longer = folder_.write("longer.glb", whole + "tail");
  const Complaint tail = complaint_of([&] { read_gltf(longer); });
  EXPECT_EQ(tail.expected, "a file of " + std::to_string(whole.size()) + " bytes");
  EXPECT_EQ(tail.found, std::to_string(whole.size() + 4));
  EXPECT_THAT(refused(15, 1).expected, HasSubstr("a chunk of"));
  std::string padded = whole + "tail";
  padded[8] = static_cast<char>(padded[8] + 4);
  const auto stray = folder_.write("stray.glb", padded);
  EXPECT_EQ(complaint_of([&] { read_gltf(stray); }).found, "4 bytes that are none");
  EXPECT_EQ(refused(16, 'X').expected, "a chunk of JSON first");
  EXPECT_THAT(refused(0, 'X').expected, "JSON");
}

}  // namespace
}  // namespace exmat::precompute
