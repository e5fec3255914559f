#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <string>

#include "common/config/config.h"
#include "common/core/error.h"
#include "tests/common/bundle/small_model.h"

namespace exmat {
namespace {

using test::TemporaryFolder;
using test::write_file;
using ::testing::HasSubstr;

struct BadConfig {
  const char* name;
  std::string text;
  std::string message;  // from the name of the file on
};
void PrintTo(const BadConfig& bad, std::ostream* stream) { *stream << bad.name; }

template <typename Load>
void expect_refused(const BadConfig& bad, Load load) {
  const TemporaryFolder folder;
  write_file(folder / "a.json", bad.text);
  write_file(folder / "empty.bou", "# none\n");
  write_file(folder / "bad.bou", "1, 2\n3 x\n");
  write_file(folder / "zero.bou", "0\n");
  write_file(folder / "twice.bou", "4\n\n4\n");
  try {
    load(folder / "a.json");
    FAIL() << "it was read";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(folder.path().string() + "/" + bad.message));
  }
}

// An asset with one more root member, or with one more member in its object.
std::string asset(const std::string& member) { return R"({"name": "a", "object": {"mesh": "m.veg"}, )" + member + "}"; }
std::string object(const std::string& member) {
  return R"({"name": "a", "object": {"mesh": "m.veg", )" + member + "}}";
}
std::string examples(const std::string& second) {
  return asset(R"("examples": [{"name": "rest", "mesh": "r.veg", "rest": true}, )" + second + "]");
}

std::string repeated(const std::string& text, int times) { return times == 0 ? "" : text + repeated(text, times - 1); }

class BadAsset : public ::testing::TestWithParam<BadConfig> {};
TEST_P(BadAsset, IsRefused) { expect_refused(GetParam(), load_asset); }

const BadConfig kBadAssets[] = {
    {"Empty", "", "a.json: expected a JSON file, found an empty file"},
    {"NotClosed", "{\n  \"name\": \"a\",\n",
     "a.json: line 3, column 1: found while parsing object key - unexpected end"},
    {"TrailingComma", "{\n  \"name\": \"a\",}", "a.json: line 2, column 15: found while parsing object key"},
    {"Comment", "{ // x\n}", "a.json: line 1, column 3: found while parsing object key - invalid literal"},
    {"AfterTheEnd", "{} x", "a.json: line 1, column 4: found while parsing value"},
    {"NulAfterTheEnd", asset(R"("seed": 1)") + '\n' + '\0' + "garbage",
     "a.json: line 2, column 1: expected text, found character U+0000"},
    {"NulWithin", std::string("{\"name\"\0:", 9), "a.json: line 1, column 8: expected text, found character U+0000"},
    {"ABundle", "\x89HDF\r\n\x1a\n", "a.json: expected a JSON file, found an HDF5 file (a bundle or a trajectory?)"},
    {"AGltfFile", std::string("glTF\2\0\0\0", 8), "a.json: expected a JSON file, found a glTF file"},
    {"AMesh", "$MeshFormat\n", "a.json: expected a JSON file, found a Gmsh mesh"},
    {"Utf16", std::string("\xff\xfe{\0}\0", 6), "a.json: expected a JSON file, found text in UTF-16"},
    {"UnitOfNone", object(R"("unit": "km")"),
     "a.json: /object/unit: expected \"m\", \"dm\", \"cm\", \"mm\", \"in\" or \"ft\", found \"km\""},
    {"NoScale", object(R"("scale": 0)"), "a.json: /object/scale: expected a number > 0, found 0"},
    {"NotANumber", asset(R"("seed": NaN)"), "a.json: line 1, column 52: found while parsing value - invalid literal"},
    {"HugeExponent", asset(R"("seed": 1e999)"), "a.json: line 1, column 56: found number overflow parsing '1e999'"},
    {"NotUtf8", "{\"name\": \"\xff\"}",
     "a.json: line 1, column 11: found while parsing value - invalid string: ill-formed UTF-8"},
    {"RepeatedMember", R"({"name": "a", "object": {"mesh": "a", "mesh": "b"}})",
     "a.json: /object/mesh: expected each member once, found it is repeated"},
    {"RepeatedMemberInAList", R"({"name": "a", "examples": [{}, {"name": "a", "name": "b"}]})",
     "a.json: /examples/1/name: expected each member once"},
    {"TooDeep", std::string(1000, '['),
     "a.json: " + repeated("/0", 64) + ": expected at most 64 nested levels, found more"},
    {"ControlCharacter", R"({"name": "a\u0000b"})",
     "a.json: /name: expected no control characters, found character U+0000"},
    {"NotAnObject", "[1]", "a.json: expected an object, found [1]"},
    {"NoName", R"({"object": {"mesh": "m"}})",
     "a.json: /name: expected a string of at least 1 and at most 64 characters (Name of the asset), found no such "
     "member"},
    {"NoMesh", R"({"name": "a", "object": {}})",
     "a.json: /object: expected mesh (tets) or surface (triangles), found neither"},
    {"MeshAndSurface", object(R"("surface": "s.glb")"),
     "a.json: /object: expected mesh (tets) or surface (triangles), found both"},
    {"CellsOfTets", object(R"("cells": 500)"),
     "a.json: /object/cells: expected none beside object.mesh, which has its tets, found one"},
    {"SkeletonOfASurface", R"({"name": "a", "object": {"surface": "s.glb", "skeleton": "bones.json"}})",
     "a.json: /object/skeleton: expected none beside object.surface, whose glTF file has its bones, found one"},
    {"CellsAndCellSize", R"({"name": "a", "object": {"surface": "s.glb", "cells": 500, "cell_size": 0.1}})",
     "a.json: /object: expected cells or cell_size, found both"},
    {"NoShapeOfExample", examples(R"({"name": "b"})"),
     "a.json: /examples/1: expected mesh (tets), or surface or morph (triangles), found none of them"},
    {"MeshAndMorph", examples(R"({"name": "b", "mesh": "m", "morph": "k"})"),
     "a.json: /examples/1: expected mesh (tets), or surface or morph (triangles), found both"},
    {"MorphOfTets", examples(R"({"name": "b", "morph": "k"})"),
     "a.json: /examples/1: expected object.surface, whose vertices a morph target or a point cache moves, found "
     "object.mesh"},
    {"FrameOfSurface", examples(R"({"name": "b", "surface": "b.obj", "frame": 1})"),
     "a.json: /examples/1: expected object.surface"},
    {"CacheWithoutFrame",
     R"({"name": "a", "object": {"surface": "s.glb"}, "examples": [{"name": "b", "surface": "b.pc2"}]})",
     "a.json: /examples/0: expected the frame of the point cache, found none"},
    {"FrameAndMorph",
     R"({"name": "a", "object": {"surface": "s.glb"}, "examples": [{"name": "b", "surface": "b.pc2", "frame": 1, "morph": "k"}]})",
     "a.json: /examples/0: expected a frame or a morph target, found both"},
    {"MorphAtRest",
     R"({"name": "a", "object": {"surface": "s.glb"}, "examples": [{"name": "b", "morph": "k", "rest": true}]})",
     "a.json: /examples/0: expected a rest example with a mesh or surface of its own, found a pose of the object's "
     "surface"},
    {"EmptyName", R"({"name": "", "object": {"mesh": "m"}})", "a.json: /name: expected a string of at least 1 and"},
    {"UnknownMember", asset(R"("cubature": {"elments": 23})"),
     "a.json: /cubature/elments; unknown member \"elments\"; did you mean \"elements\"?"},
    {"UnknownRootMember", asset(R"("shapespace": {})"),
     "a.json: /shapespace; unknown member \"shapespace\"; did you mean \"shape_space\"?"},
    {"UnlikeAnyMember", asset(R"("basis": {"zzzzzzzz": 1})"),
     "a.json: /basis/zzzzzzzz; unknown member \"zzzzzzzz\"; members here are \"example_fields\", "
     "\"linear_modes\", \"loads\", \"size\", \"tolerance\", \"training\", \"training_seconds\", \"training_seed\", "
     "\"training_segments\" and \"training_space\""},
    {"SizeAndToleranceOfTheBasis", asset(R"("basis": {"size": 20, "tolerance": 0.02})"),
     "a.json: /basis: expected size or tolerance, found both"},
    {"LoadsThatAreNotThere", asset(R"("basis": {"training": "loads"})"),
     "a.json: /basis/loads: expected the loads that \"training\": \"loads\" asks for, found none"},
    {"WrongType", asset(R"("basis": {"size": "20"})"),
     "a.json: /basis/size: expected an integer >= 1 and <= 10000, found \"20\""},
    {"Fraction", asset(R"("basis": {"size": 2.5})"),
     "a.json: /basis/size: expected an integer >= 1 and <= 10000, found 2.5"},
    {"TooSmall", asset(R"("basis": {"linear_modes": 0})"), "a.json: /basis/linear_modes: expected an integer >= 1"},
    {"TooLarge", asset(R"("basis": {"size": 99999999999999999999})"), "a.json: /basis/size: expected an integer >= 1"},
    {"NegativeSeed", asset(R"("seed": -1)"), "a.json: /seed: expected an integer >= 0"},
    {"NotInTheList", asset(R"("shape_space": {"weighting": "area"})"),
     "a.json: /shape_space/weighting: expected \"eigenvalue\" or \"none\", found \"area\""},
    {"Null", object(R"("fixed": null)"),
     "a.json: /object/fixed: expected exactly one of \"box\", \"color\", \"file\", \"ids\", \"part\", \"point\" and "
     "\"sphere\", "
     "found null"},
    {"Incompressible", object(R"("material": {"poisson_ratio": 0.5})"),
     "a.json: /object/material/poisson_ratio: expected a number >= -0.999 and <= 0.49999, found 0.5"},
    {"ADensityBeyondAllScales", object(R"("material": {"density": 1e31})"),
     "a.json: /object/material/density: expected a number of at most 1e+30 in magnitude, found 1e+31; mend the number"},
    {"NearlyIncompressible", object(R"("material": {"poisson_ratio": 0.49999999999})"),
     "a.json: /object/material/poisson_ratio: expected a number >= -0.999 and <= 0.49999, found 0.49999999999"},
    {"NearlyWithoutShear", object(R"("material": {"poisson_ratio": -0.9999999999999999})"),
     "a.json: /object/material/poisson_ratio: expected a number >= -0.999 and <= 0.49999, found -0.9999999999999999"},
    {"ZeroDensity", object(R"("material": {"density": 0})"),
     "a.json: /object/material/density: expected a number > 0, found 0"},
    {"NoSelection", object(R"("fixed": {})"), "a.json: /object/fixed: expected exactly one of \"box\""},
    {"TwoSelections", object(R"("fixed": {"ids": [1], "file": "a"})"),
     "a.json: /object/fixed: expected exactly one of \"box\""},
    {"ShortVector", object(R"("fixed": {"box": {"min": [0, 0], "max": [1, 1, 1]}})"),
     "a.json: /object/fixed/box/min: expected an array of 3 elements, found [0,0]"},
    {"EmptyBox", object(R"("fixed": {"box": {"min": [0, 2, 0], "max": [1, 1, 1]}})"),
     "a.json: /object/fixed/box/max/1: expected a number >= 2 (min), found 1"},
    {"RadiusZero", object(R"("fixed": {"sphere": {"center": [0, 0, 0], "radius": 0}})"),
     "a.json: /object/fixed/sphere/radius: expected a number > 0, found 0"},
    {"NegativeId", object(R"("fixed": {"ids": [0, -1]})"), "a.json: /object/fixed/ids/1: expected an integer >= 0"},
    {"IdTwice", object(R"("fixed": {"ids": [7, 3, 7]})"),
     "a.json: /object/fixed/ids/2: expected each vertex once, found 7 again"},
    {"UnknownDrop", object(R"("drop": ["everything"])"),
     "a.json: /object/drop/0: expected \"degenerate_tets\", \"unref"},
    {"DropTwice", object(R"("drop": ["degenerate_tets", "degenerate_tets"])"),
     "a.json: /object/drop/1: expected each element once"},
    {"BothCubatures", asset(R"("cubature": {"elements": 5, "tolerance": 0.1})"),
     "a.json: /cubature: expected elements or tolerance, found both"},
    {"ToleranceOne", asset(R"("cubature": {"tolerance": 1})"),
     "a.json: /cubature/tolerance: expected a number > 0 and < 1, found 1"},
    {"TargetTolerance", asset(R"("targets": {"tolerance": 0})"),
     "a.json: /targets/tolerance: expected a number > 0 and < 1, found 0"},
    {"SlashInName", examples(R"({"name": "a/b", "mesh": "m"})"),
     "a.json: /examples/1/name: expected a name without '/'"},
    {"DotName", examples(R"({"name": ".", "mesh": "m"})"), "a.json: /examples/1/name: expected a name without '/'"},
    {"ReservedName", examples(R"({"name": "gram", "mesh": "m"})"),
     "a.json: /examples/1/name: expected a name without '/'"},
    {"LongName", examples(R"({"name": ")" + std::string(65, 'x') + R"(", "mesh": "m"})"),
     "a.json: /examples/1/name: expected a string of"},
    {"NameTwice", examples(R"({"name": "rest", "mesh": "m"})"),
     "a.json: /examples/1/name: expected another name for each example, found \"rest\", that of /examples/0 too"},
    {"TwoRestExamples", examples(R"({"name": "b", "mesh": "m", "rest": true})"),
     "a.json: /examples/1/rest: expected at most one rest example"},
    {"UnknownNeed", asset(R"("needs": ["sound"])"),
     "a.json: /needs/0: expected \"examples\", \"targets\", \"rigid\", \"contact\", \"regions\", \"render\", "
     "\"full_space\" or \"target_elasticity\", found \"sound\""},
    {"UnknownInternalForce", asset(R"("internal_force": "exact")"),
     "a.json: /internal_force: expected \"auto\", \"cubature\" or \"polynomial\", found \"exact\""},
    {"NoContactVertices", asset(R"("contact": {"count": 0})"), "a.json: /contact/count: expected an integer >= 1"},
    {"TwoContactSelections", asset(R"("contact": {"vertices": {"ids": [1], "file": "a"}})"),
     "a.json: /contact/vertices: expected exactly one of \"box\""},
    {"RegionTwice", asset(R"("examples": [{"name": "e", "mesh": "m"}], "regions": [
       {"name": "a", "vertices": {"ids": [1]}, "examples": ["e"]},
       {"name": "a", "vertices": {"ids": [2]}, "examples": ["e"]}])"),
     "a.json: /regions/1/name: expected another name for each region, found \"a\", that of /regions/0 too"},
    {"RegionWithoutExamples", asset(R"("regions": [{"name": "a", "vertices": {"ids": [1]}, "examples": []}])"),
     "a.json: /regions/0/examples: expected an array of at least 1 and at most 63 elements, found []"},
    {"EmptyRenderMesh", object(R"("render_mesh": "")"), "a.json: /object/render_mesh: expected a string of"},
    {"UnknownMaterial", object(R"("material": {"model": "rubber"})"),
     "a.json: /object/material/model: expected \"stvk\", \"stable_neo_hookean\" or \"corotational\", found \"rubber\""},
    {"PartWithoutTets", object(R"("materials": [{"density": 1}])"), "a.json: /object/materials/0"},
    {"PartWithoutNumbers", object(R"("materials": [{"tets": {"ids": [1]}}])"), "a.json: /object/materials/0"},
    {"PartOfTwoSelections", object(R"("materials": [{"tets": {"ids": [1], "file": "a"}, "density": 1}])"),
     "a.json: /object/materials/0/tets: expected exactly one of \"box\""},
    {"IncompressiblePart", object(R"("materials": [{"tets": {"ids": [1]}, "poisson_ratio": 0.5}])"),
     "a.json: /object/materials/0/poisson_ratio: expected a number >= -0.999 and <= 0.49999, found 0.5"},
    {"MapIsAnArray", asset(R"("alignment": {"map": "a.txt"})"), "a.json: /alignment/map: expected an array"},
    {"MapOfNoExample", asset(R"("alignment": {"map": [{"example": "bent", "file": "a.txt"}]})"),
     "a.json: /alignment/map/0/example: expected the name of an example, found \"bent\""},
    {"LandmarksMissing", asset(R"("alignment": {"method": "landmarks"})"),
     "a.json: /alignment/method: expected alignment.landmarks beside the method \"landmarks\", found none"},
    {"MapMissing", asset(R"("alignment": {"method": "map"})"),
     "a.json: /alignment/method: expected alignment.map beside the method \"map\", found none"},
    {"CouplingOfNothing", asset(R"("alignment": {"method": "coupled"})"),
     "a.json: /alignment/method: expected alignment.landmarks or alignment.regions beside the method"},
    {"LaterMaterial", object(R"("material": {"model": "neo_hookean"})"),
     "a.json: /object/material/model: found \"neo_hookean\"; this version"},
};
INSTANTIATE_TEST_SUITE_P(Each, BadAsset, ::testing::ValuesIn(kBadAssets),
                         [](const auto& test) { return std::string(test.param.name); });

std::string scene(const std::string& member) { return R"({"bundle": "b.h5", )" + member + "}"; }
std::string force(const std::string& vertices, const std::string& more = "") {
  return scene(R"("forces": [{"vertices": )" + vertices + R"(, "force": [0, 0, 1])" + more + "}]");
}

std::string obstacle(const std::string& members) { return scene(R"("obstacles": [{)" + members + "}]"); }

class BadScene : public ::testing::TestWithParam<BadConfig> {};
TEST_P(BadScene, IsRefused) { expect_refused(GetParam(), load_scene); }

const BadConfig kBadScenes[] = {
    {"NoBundle", "{}", "a.json: /: expected bundle or bodies, found neither"},
    {"ZeroTimeStep", scene(R"("time_step": 0)"), "a.json: /time_step: expected a number > 0, found 0"},
    {"NoSteps", scene(R"("steps": 0)"), "a.json: /steps: expected an integer >= 1"},
    {"UnknownIntegrator", scene(R"("integrator": "rk4")"),
     "a.json: /integrator: expected \"bdf2\", \"backward_euler\" or \"newmark\", found \"rk4\""},
    {"NegativeDamping", scene(R"("damping": {"mass": -1})"), "a.json: /damping/mass: expected a number >= 0, found -1"},
    {"NoIterations", scene(R"("newton": {"max_iterations": 0})"),
     "a.json: /newton/max_iterations: expected an integer >= 1"},
    {"NewtonTolerance", scene(R"("newton": {"tolerance": 1})"),
     "a.json: /newton/tolerance: expected a number > 0 and < 1"},
    {"UnknownPrecision", scene(R"("precision": "half")"),
     "a.json: /precision: expected \"double\" or \"mixed\", found \"half\""},
    {"SleepWithoutEnergy", scene(R"("sleep": {"time": 1})"), "a.json: /sleep/energy: expected a number > 0"},
    {"SleepAtOnce", scene(R"("sleep": {"energy": 1, "time": 0})"),
     "a.json: /sleep/time: expected a number > 0, found 0"},
    {"NoStiffness", scene(R"("examples": {})"),
     "a.json: /examples/stiffness: expected a number >= 0, or an object (kappa [1/s^2]; of an elastic force "},
    {"NoKeys", scene(R"("gravity": {"keys": []})"), "a.json: /gravity/keys: expected an array of at least 1"},
    {"KeysWithoutKeys", scene(R"("gravity": {"interpolation": "step"})"), "a.json: /gravity/keys: expected an array"},
    {"GravityOfAnotherKind", scene(R"("gravity": 9.81)"),
     "a.json: /gravity: expected an array of 3 elements, or an object, found 9.81"},
    {"KeysInAnotherOrder", scene(R"("gravity": {"keys": [{"time": 1, "value": [0, 0, 0]},
                                                          {"time": 1, "value": [0, 0, 1]}]})"),
     "a.json: /gravity/keys/1/time: expected a number > 1 (the key before), found 1"},
    {"NegativeKey", scene(R"("examples": {"stiffness": {"keys": [{"time": 0, "value": -1}]}})"),
     "a.json: /examples/stiffness/keys/0/value: expected a number >= 0, found -1"},
    {"BiasOfAKeyTooLarge", scene(R"("examples": {"stiffness": 1, "bias": {"keys": [{"time": 0, "value": 2}]}})"),
     "a.json: /examples/bias/keys/0/value: expected a number >= 0 and <= 1"},
    {"UnknownInterpolation",
     scene(R"("gravity": {"keys": [{"time": 1, "value": [0, 0, 0]}], "interpolation": "cubic"})"),
     "a.json: /gravity/interpolation: expected \"linear\" or \"step\", found \"cubic\""},
    {"WeightsThatDoNotAddUp", scene(R"("examples": {"stiffness": 1, "weights": [0.5, 0.6]})"),
     "a.json: /examples/weights: expected weights whose sum is 1, found a sum of 1.1"},
    {"WeightsOfAnotherCount", scene(R"("examples": {"stiffness": 1, "weights": {"keys": [
         {"time": 0, "value": [1, 0]}, {"time": 1, "value": [1]}]}})"),
     "a.json: /examples/weights/keys/1/value: expected 2 numbers, as in the first key, found 1"},
    {"WeightsAndBias", scene(R"("examples": {"stiffness": 1, "weights": [0.5, 0.5], "bias": 0.5})"),
     "a.json: /examples: expected weights or bias, found both"},
    {"DriversAndBias", scene(R"("examples": {"stiffness": 1, "bias": 0.5, "drivers": []})"),
     "a.json: /examples: expected bias or drivers, found both"},
    {"DriverOfBothKinds", scene(R"("examples": {"stiffness": 1, "drivers": [
        {"example": "a", "joint": "b", "axis": [1, 0, 0], "radius": 1}]})"),
     "a.json: /examples/drivers/0: expected axis and angles, or rotation and radius, found other members"},
    {"DriverOfOneAngle", scene(R"("examples": {"stiffness": 1, "drivers": [
        {"example": "a", "joint": "b", "axis": [1, 0, 0], "angles": [1, 1]}]})"),
     "a.json: /examples/drivers/0/angles: expected two angles that differ, found [1,1]"},
    {"JointTwice", scene(R"("body": {"bones": [{"joint": "a", "motion": []}, {"joint": "a", "motion": []}]})"),
     "a.json: /body/bones/1/joint: expected each joint once, found \"a\" again"},
    {"BiasTooLarge", scene(R"("examples": {"stiffness": 1, "bias": 1.5})"),
     "a.json: /examples/bias: expected a number >= 0 and <= 1"},
    {"EndBeforeStart", force(R"({"ids": [1]})", R"(, "start": 2, "end": 1)"),
     "a.json: /forces/0/end: expected a number > 2 (start), found 1"},
    {"ForceWithoutVertices", scene(R"("forces": [{"force": [0, 0, 1]}])"),
     "a.json: /forces/0/vertices: expected exactly one of \"box\", \"color\", \"file\", \"ids\""},
    {"ForceOnNoIds", force(R"({"ids": []})"),
     "a.json: /forces/0/vertices/ids: expected an array of at least 1 elements, found []"},
    {"ForceIdTwice", force(R"({"ids": [1, 1]})"),
     "a.json: /forces/0/vertices/ids/1: expected each vertex once, found 1 again"},
    {"NoIdFile", force(R"({"file": "none.bou"})"),
     "a.json: /forces/0/vertices/file: expected a text file of vertex ids, found no such file: "},
    {"EmptyIdFile", force(R"({"file": "empty.bou"})"), "empty.bou: expected vertex ids >= 1, found none"},
    {"BadIdFile", force(R"({"file": "bad.bou"})"), "bad.bou: line 2: expected vertex ids >= 1, found \"x\""},
    {"ZeroInIdFile", force(R"({"file": "zero.bou"})"), "zero.bou: line 1: expected vertex ids >= 1, found \"0\""},
    {"TwiceInIdFile", force(R"({"file": "twice.bou"})"), "twice.bou: line 3: expected each vertex once, found 4 again"},
    {"EveryZero", scene(R"("output": {"every": 0})"), "a.json: /output/every: expected an integer >= 1"},
    {"UnknownMember", scene(R"("gravitiy": [0, 0, 0])"),
     "a.json: /gravitiy; unknown member \"gravitiy\"; did you mean \"gravity\"?"},
    {"NoShape", obstacle(R"("friction": 1)"),
     "a.json: /obstacles/0: expected exactly one of \"plane\", \"sphere\", \"box\", \"capsule\", \"mesh\" and "
     "\"height_field\", "
     "found none"},
    {"TwoShapes", obstacle(R"("plane": {"normal": [0, 1, 0]}, "box": {"half_extents": [1, 1, 1]})"),
     "a.json: /obstacles/0: expected exactly one of \"plane\", \"sphere\", \"box\", \"capsule\", \"mesh\" and "
     "\"height_field\", "
     "found \"plane\" and \"box\""},
    {"MeshWithoutFile", obstacle(R"("mesh": {"scale": 2})"), "a.json: /obstacles/0/mesh/file: expected a string"},
    {"MeshOfNoSize", obstacle(R"("mesh": {"file": "a.obj", "scale": 0})"),
     "a.json: /obstacles/0/mesh/scale: expected a number > 0, found 0"},
    {"NegativeThickness", obstacle(R"("mesh": {"file": "a.obj", "thickness": -1})"),
     "a.json: /obstacles/0/mesh/thickness: expected a number >= 0, found -1"},
    {"HeightsTwice", obstacle(R"("height_field": {"file": "a.csv", "heights": [[0, 0], [0, 0]], "spacing": [1, 1]})"),
     "a.json: /obstacles/0/height_field: expected file or heights, found both"},
    {"NoHeights", obstacle(R"("height_field": {"spacing": [1, 1]})"),
     "a.json: /obstacles/0/height_field: expected file or heights, found neither"},
    {"UnequalRows", obstacle(R"("height_field": {"heights": [[0, 0], [0, 0, 0]], "spacing": [1, 1]})"),
     "a.json: /obstacles/0/height_field/heights/1: expected 2 heights, as in the first row, found 3"},
    {"NoSpacing", obstacle(R"("height_field": {"heights": [[0, 0], [0, 0]], "spacing": [1, 0]})"),
     "a.json: /obstacles/0/height_field/spacing/1: expected a number > 0, found 0"},
    {"UnknownShape", obstacle(R"("spere": {"radius": 1})"),
     "a.json: /obstacles/0/spere; unknown member \"spere\"; did you mean \"sphere\"?"},
    {"NoNormal", obstacle(R"("plane": {"normal": [0, 0, 0]})"),
     "a.json: /obstacles/0/plane/normal: expected a vector other than 0, found [0,0,0]"},
    {"FlatBox", obstacle(R"("box": {"half_extents": [1, 0, 1]})"),
     "a.json: /obstacles/0/box/half_extents/1: expected a number > 0, found 0"},
    {"NegativeFriction", obstacle(R"("sphere": {"radius": 1}, "friction": -1)"),
     "a.json: /obstacles/0/friction: expected a number >= 0, found -1"},
    {"AForceBeyondAllScales", scene(R"("forces": [{"vertices": {"ids": [1]}, "force": [0, -1e200, 0]}])"),
     "a.json: /forces/0/force/1: expected a number of at most 1e+30 in magnitude, found -1e+200; mend the number"},
    {"ASpeedBeyondAllScales", scene(R"("body": {"linear_velocity": [0, 1e31, 0]})"),
     "a.json: /body/linear_velocity/1: expected a number of at most 1e+30 in magnitude, found 1e+31"},
    {"AKeyBeyondAllScales",
     obstacle(R"("sphere": {"radius": 1}, "motion": [{"time": 0}, {"time": 1, "position": [1e306, 0, 0]}])"),
     "a.json: /obstacles/0/motion/1/position/0: expected a number of at most 1e+30 in magnitude, found 1e+306"},
    {"ARadiusBeyondAllScales", obstacle(R"("sphere": {"radius": 1e308})"),
     "a.json: /obstacles/0/sphere/radius: expected a number of at most 1e+30 in magnitude, found 1e+308"},
    {"ANumberWithoutDigits", scene(R"("damping": {"mass": 1e-310})"),
     "a.json: /damping/mass: expected 0, or a number of at least 2.3e-308 in magnitude, found 1e-310"},
    {"SoftObstacle", obstacle(R"("sphere": {"radius": 1}, "stiffness": 0)"),
     "a.json: /obstacles/0/stiffness: expected a number > 0 and <= 1e+15, found 0; steel"},
    {"ObstacleStifferThanSteel", obstacle(R"("sphere": {"radius": 1}, "stiffness": 1e16)"),
     "a.json: /obstacles/0/stiffness: expected a number > 0 and <= 1e+15, found 1e+16; steel that is 1 mm thick has "
     "2e14"},
    {"ContactStifferThanSteel", scene(R"("contact": {"stiffness": 1e16})"),
     "a.json: /contact/stiffness: expected a number > 0 and <= 1e+15, found 1e+16; steel that is 1 mm thick has 2e14"},
    {"NotAUnitQuaternion", obstacle(R"("box": {"half_extents": [1, 1, 1], "orientation": [1, 1, 0, 0]})"),
     "a.json: /obstacles/0/box/orientation: expected a quaternion of length 1, w first, found length 1.41421"},
    {"KeyWithoutTime", obstacle(R"("sphere": {"radius": 1}, "motion": [{"position": [0, 0, 0]}])"),
     "a.json: /obstacles/0/motion/0/time: expected a number"},
    {"KeysOutOfOrder", obstacle(R"("sphere": {"radius": 1}, "motion": [{"time": 1}, {"time": 1}])"),
     "a.json: /obstacles/0/motion/1/time: expected a number > 1 (the key before), found 1"},
    {"HalfATurn", scene(R"("body": {"motion": [{"time": 0}, {"time": 1, "orientation": [0, 0, 1, 0]}]})"),
     "a.json: /body/motion/1/orientation: expected less than half a turn from the key before, found [0, 0, 1, 0]; put "
     "a "
     "key between the two"},
    {"ReducedAndPose", scene(R"("body": {"reduced": [1], "pose": {"example": "a"}})"),
     "a.json: /body: expected reduced or pose, found both"},
    {"LongOrientation", scene(R"("body": {"orientation": [1, 0, 0]})"),
     "a.json: /body/orientation: expected an array of 4 elements, found [1,0,0]"},
    {"NoInstances", scene(R"("instances": 0)"), "a.json: /instances: expected an integer >= 1 and <= 1000000, found 0"},
    {"TooManyInstances", scene(R"("instances": 1000001)"),
     "a.json: /instances: expected an integer >= 1 and <= 1000000"},
    {"UnknownInternalForce", scene(R"("internal_force": "exact")"),
     "a.json: /internal_force: expected \"auto\", \"cubature\" or \"polynomial\", found \"exact\""},
    {"UnknownTarget", scene(R"("examples": {"stiffness": 1, "target": "guess"})"),
     "a.json: /examples/target: expected \"auto\", \"table\" or \"solve\", found \"guess\""},
    {"CompensatedElasticForce", scene(R"("examples": {"stiffness": 1, "force": "elastic", "compensate": true})"),
     "a.json: /examples/compensate: expected a linear force with a table of targets, found an elastic force"},
    {"CompensatedSolvedTargets", scene(R"("examples": {"stiffness": 1, "target": "solve", "compensate": true})"),
     "a.json: /examples/compensate: expected a linear force with a table of targets, found targets that are solved "
     "for"},
    {"NoTargetIterations", scene(R"("examples": {"stiffness": 1, "target_iterations": 0})"),
     "a.json: /examples/target_iterations: expected an integer >= 1 and <= 1000, found 0"},
    {"UnknownForce", scene(R"("examples": {"stiffness": 1, "force": "plastic"})"),
     "a.json: /examples/force: expected \"linear\" or \"elastic\", found \"plastic\""},
    {"BoxInsideOut", force(R"({"box": {"min": [0, 2, 0], "max": [1, 1, 1]}})"),
     "a.json: /forces/0/vertices/box/max/1: expected a number >= 2 (min), found 1"},
    {"FlatPoint", force(R"({"point": [1, 2]})"),
     "a.json: /forces/0/vertices/point: expected an array of 3 elements, found [1,2]"},
};
INSTANTIATE_TEST_SUITE_P(Each, BadScene, ::testing::ValuesIn(kBadScenes),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(LoadScene, NamesAFileThatIsMissing) {
  const TemporaryFolder folder;
  EXPECT_THROW(load_scene(folder / "none.json"), InputError);
  EXPECT_THROW(load_scene(folder.path()), InputError);
}

}  // namespace
}  // namespace exmat
