#include "precompute/study/sweep/settings.h"

#include <algorithm>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <set>

#include "common/config/config.h"
#include "common/core/error.h"

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;

class Settings : public testing::Test {
 protected:
  Settings() {
    asset_.eigenfunctions = 10;
    asset_.basis_size = 20;
    asset_.internal_force = ForceMethod::kCubature;
    scene_.examples.emplace();
    study_.file = "study.json";
  }
  std::vector<PointSettings> expanded() const { return expand(study_, asset_, scene_); }

  AssetConfig asset_;
  SceneConfig scene_;
  StudyConfig study_;
};

TEST_F(Settings, OfAnEmptySweepAreTheFilesOwn) {
  study_.sweeps = {{}};
  const auto points = expanded();
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0], own_settings(asset_, scene_));
  EXPECT_EQ(points[0].cubature_elements, 40) << "2 r";
  EXPECT_EQ(describe(points[0]),
            "m 10, r 20 of 15 linear modes, training auto, s 40, stvk, 1 ms, bdf2, cubature, target auto");
}

TEST_F(Settings, AreTheProductOfAllLists) {
  study_.sweeps = {{.eigenfunctions = {5, 6},
                    .basis_size = {7, 8, 9},
                    .linear_modes = {3, 4},
                    .training = {"none", "scene"},
                    .cubature_elements = {11, 12},
                    .material = {"stvk", "corotational"},
                    .time_step = {0.001, 0.002},
                    .integrator = {"bdf2", "newmark"},
                    .internal_force = {"cubature"},
                    .target = {"table", "solve"}}};
  const auto points = expanded();
  std::set<PointSettings> expected;
  for (const int m : {5, 6})
    for (const auto& [r, l] : {std::pair(7, 3), {7, 4}, {8, 3}, {8, 4}, {9, 3}, {9, 4}})
      for (const auto& [training, s] : {std::pair("none", 11), {"none", 12}, {"auto", 11}, {"auto", 12}})
        for (const char* material : {"stvk", "corotational"})
          for (const double step : {0.001, 0.002})
            for (const char* integrator : {"bdf2", "newmark"})
              for (const char* target : {"table", "solve"})
                expected.insert({m, r, l, training, s, material, step, integrator, "cubature", target, "double"});
  EXPECT_EQ(points.size(), 2U * 3 * 2 * 2 * 2 * 2 * 2 * 2 * 2);
  EXPECT_EQ(std::set<PointSettings>(points.begin(), points.end()), expected);
}

TEST_F(Settings, OfSeveralSweepsAreThereOnce) {
  study_.sweeps = {{.basis_size = {10, 20}}, {.basis_size = {20, 30}}, {.cubature_elements = {40}}};
  std::vector<int> sizes;
  for (const PointSettings& point : expanded()) {
    EXPECT_EQ(point.cubature_elements, 2 * point.basis_size);
    sizes.push_back(point.basis_size);
  }
  EXPECT_EQ(sizes, (std::vector<int>{10, 20, 30}));
}

TEST_F(Settings, WithoutEffectMakeNoPoints) {
  study_.sweeps = {{.cubature_elements = {10, 20, 30}, .internal_force = {"all_elements"}}};
  EXPECT_EQ(expanded().size(), 1U) << "all elements are all there are";
  study_.sweeps = {{.training = {"scene", "auto", "none"}}};
  const auto points = expanded();
  ASSERT_EQ(points.size(), 2U) << "a study always has a scene to learn from";
  EXPECT_EQ(points[0], own_settings(asset_, scene_));
  EXPECT_EQ(points[1].training, "none");
  scene_.examples.reset();
  study_.sweeps = {{.eigenfunctions = {5, 6}, .target = {"table", "solve"}}};
  ASSERT_EQ(expanded().size(), 1U) << "no examples";
  EXPECT_EQ(expanded()[0].target, kNoTarget);
}

TEST_F(Settings, CompareElasticForcesWithThoseOfTheScene) {
  study_.sweeps = {{}, {.elastic_stiffness = {0.5, 2}}};
  const auto points = expanded();
  ASSERT_EQ(points.size(), 3U);
  EXPECT_EQ(with_settings(scene_, points[0]).examples->law, ExampleForceLaw::kLinear);
  EXPECT_EQ(with_settings(scene_, points[0]).examples->stiffness, scene_.examples->stiffness);
  for (const std::size_t i : {1U, 2U}) {
    const SceneConfig scene = with_settings(scene_, points[i]);
    EXPECT_EQ(scene.examples->law, ExampleForceLaw::kElastic);
    EXPECT_EQ(scene.examples->stiffness, points[i].elastic_stiffness);
    EXPECT_EQ(scene.examples->damping, scene_.examples->damping);
    EXPECT_EQ(settings_from_json(to_json(points[i])), points[i]);
  }
  EXPECT_THAT(describe(points[2]), HasSubstr("target auto, elastic force of 2"));
  scene_.examples.reset();
  EXPECT_EQ(expanded().size(), 1U) << "no examples";
}

TEST_F(Settings, AreAppliedToAssetAndScene) {
  asset_.cubature_tolerance = 0.01;
  scene_.regions.push_back({"left", {}});
  const PointSettings point{5,     7,         9,          "none",  11,      "corotational",
                            0.002, "newmark", "cubature", "solve", "mixed", "full"};
  const AssetConfig asset = with_settings(asset_, point);
  EXPECT_EQ(asset.eigenfunctions, 5);
  EXPECT_EQ(asset.basis_size, 7);
  EXPECT_EQ(asset.linear_modes, 9);
  EXPECT_EQ(asset.training.from, Training::kNone);
  EXPECT_EQ(asset.cubature_elements, 11);
  EXPECT_FALSE(asset.cubature_tolerance) << "one of them alone";
  EXPECT_EQ(asset.material.model, MaterialModel::kCorotational);
  const SceneConfig scene = with_settings(scene_, point);
  EXPECT_EQ(scene.precision, Precision::kMixed);
  EXPECT_EQ(scene.space.space, Space::kFull);
  EXPECT_EQ(scene.time_step, 0.002);
  EXPECT_EQ(scene.integrator, Integrator::kNewmark);
  EXPECT_EQ(scene.examples->target, TargetSource::kSolve);
  EXPECT_EQ(scene.regions[0].force.target, TargetSource::kSolve);

  PointSettings all = point;
  all.internal_force = kAllElements;
  all.cubature_elements.reset();
  EXPECT_EQ(with_settings(asset_, all).cubature_method, CubatureMethod::kAllElements);
  EXPECT_FALSE(with_settings(asset_, all).cubature_elements || with_settings(asset_, all).cubature_tolerance);
  EXPECT_EQ(with_settings(scene_, all).internal_force, ForceMethod::kCubature);
  EXPECT_EQ(with_settings(with_settings(asset_, all), point).cubature_method, CubatureMethod::kGreedySwap);
}

TEST_F(Settings, OfAToleranceStayWithoutANumberOfElements) {
  asset_.cubature_tolerance = 0.01;
  study_.sweeps = {{.basis_size = {10, 20}}};
  for (const PointSettings& point : expanded()) {
    EXPECT_FALSE(point.cubature_elements);
    EXPECT_EQ(with_settings(asset_, point).cubature_tolerance, 0.01);
  }
}

TEST_F(Settings, SurviveJson) {
  study_.sweeps = {{.linear_modes = {7},
                    .time_step = {1.0 / 3},
                    .internal_force = {"cubature", "all_elements"},
                    .precision = {"double", "mixed"},
                    .space = {"reduced", "full"}}};
  for (const PointSettings& point : expanded())
    EXPECT_EQ(settings_from_json(nlohmann::ordered_json::parse(to_json(point).dump())), point);
}

TEST_F(Settings, RefusesAPolynomialThatAMaterialHasNot) {
  study_.sweeps = {{}, {.material = {"stvk", "corotational"}, .internal_force = {"polynomial"}}};
  try {
    expanded();
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("study.json: /sweeps/1/internal_force"));
    EXPECT_THAT(error.what(), HasSubstr("corotational"));
  }
}

TEST_F(Settings, RefusesLoadsThatTheAssetDoesNotDeclare) {
  study_.sweeps = {{.training = {"none", "loads"}}};
  try {
    expanded();
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("study.json: /sweeps/0/training: expected"));
    EXPECT_THAT(error.what(), HasSubstr("basis.loads"));
  }
  asset_.training.loads.emplace();
  EXPECT_EQ(expanded().size(), 2U);
}

TEST_F(Settings, RefusesTooManyPoints) {
  study_.sweeps = {{.eigenfunctions = std::vector<int>(60), .basis_size = std::vector<int>(60)}};
  for (int i = 0; i < 60; ++i)
    study_.sweeps[0].eigenfunctions[static_cast<std::size_t>(i)] =
        study_.sweeps[0].basis_size[static_cast<std::size_t>(i)] = i + 1;
  EXPECT_THROW(expanded(), InputError);
}

// The studies of the examples, with the files' own settings among their points.
TEST(ExampleStudies, AreSound) {
  const std::filesystem::path examples = EXMAT_SOURCE_DIR "/examples";
  for (const char* file : {"03_car_wall/study.json", "04_bar_cuboid/study.json", "05_bar_cylinder/study.json",
                           "06_cross/study.json", "07_teddy_global/study.json", "08_teddy_local/study.json",
                           "reduction/bar_study.json", "reduction/cross_study.json"}) {
    const StudyConfig study = load_study(examples / file);
    const AssetConfig asset = load_asset(study.asset);
    const SceneConfig scene = load_scene(study.scene);
    const auto points = expand(study, asset, scene);
    EXPECT_GE(points.size(), 6U) << file;
    EXPECT_TRUE(std::ranges::any_of(points, [](const PointSettings& p) { return p.internal_force == kAllElements; }));
    PointSettings own = own_settings(asset, scene);
    if (own.target == "auto") own.target = "table";
    EXPECT_NE(std::ranges::find(points, own), points.end()) << file;
  }
}

}  // namespace
}  // namespace exmat::precompute
