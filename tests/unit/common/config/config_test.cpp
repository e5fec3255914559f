#include "common/config/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/config/vertex_ids.h"
#include "tests/unit/common/bundle/small_model.h"

namespace exmat {
namespace {

using test::TemporaryFolder;
using test::write_file;
using ::testing::ElementsAre;

template <typename Load>
auto load(const TemporaryFolder& folder, Load loader, const std::string& text) {
  write_file(folder / "config.json", text);
  return loader(folder / "config.json");
}

TEST(LoadAsset, FillsInDefaults) {
  const TemporaryFolder folder;
  const AssetConfig asset = load(folder, load_asset, R"({"name": "bar", "object": {"mesh": "bar.veg"}})");
  EXPECT_EQ(asset.file, folder / "config.json");
  EXPECT_EQ(asset.name, "bar");
  EXPECT_EQ(asset.object_mesh, folder / "bar.veg");
  EXPECT_EQ(asset.material.model, "stvk");
  EXPECT_FALSE(asset.material.density || asset.fixed || asset.cubature_elements || asset.cubature_tolerance ||
               asset.needs);
  EXPECT_TRUE(asset.examples.empty());
  EXPECT_EQ(asset.eigenfunctions, 20);
  EXPECT_EQ(asset.basis_size, 30);
  EXPECT_EQ(asset.cubature_method, "greedy_swap");
  EXPECT_EQ(asset.target_tolerance, std::nullopt);
  EXPECT_EQ(asset.seed, 1u);
}

TEST(LoadAsset, ReadsEveryMember) {
  const TemporaryFolder folder;
  const AssetConfig asset = load(folder, load_asset, R"({
    "name": "car",
    "object": {"mesh": "/data/car.veg", "drop": ["degenerate_tets", "smaller_components"],
               "material": {"model": "stvk", "youngs_modulus": 6.0e6, "poisson_ratio": 0.4, "density": 1000},
               "fixed": {"box": {"min": [0, -1, 0], "max": [1, 1, 0.01]}}},
    "shape_space": {"eigenfunctions": 6, "weighting": "none"},
    "examples": [{"name": "rest", "mesh": "../ex0.veg", "rest": true},
                 {"name": "bend", "mesh": "sub/./ex1.veg", "drop": ["unreferenced_vertices"]}],
    "alignment": {"method": "auto", "frame": "free"},
    "basis": {"size": 20, "linear_modes": 12, "example_fields": false},
    "cubature": {"elements": 23, "method": "nn_htp", "training_poses": 50},
    "targets": {"tolerance": 1e-3},
    "needs": ["rigid"],
    "seed": 9007199254740991})");
  EXPECT_EQ(asset.object_mesh, "/data/car.veg");
  EXPECT_TRUE(asset.object_drop.degenerate_tets && asset.object_drop.smaller_components);
  EXPECT_FALSE(asset.object_drop.unreferenced_vertices);
  EXPECT_EQ(asset.material.youngs_modulus, 6e6);
  EXPECT_EQ(asset.material.poisson_ratio, 0.4);
  EXPECT_EQ(asset.material.density, 1000);
  const auto& box = std::get<BoxSelection>(*asset.fixed);
  EXPECT_THAT(box.min, ElementsAre(0, -1, 0));
  EXPECT_THAT(box.max, ElementsAre(1, 1, 0.01));
  EXPECT_EQ(asset.eigenfunctions, 6);
  EXPECT_EQ(asset.weighting, "none");
  ASSERT_EQ(asset.examples.size(), 2u);
  EXPECT_TRUE(asset.examples[0].rest);
  EXPECT_EQ(asset.examples[0].mesh, folder.path().parent_path() / "ex0.veg");
  EXPECT_EQ(asset.examples[1].name, "bend");
  EXPECT_EQ(asset.examples[1].mesh, folder / "sub/ex1.veg");
  EXPECT_TRUE(asset.examples[1].drop.unreferenced_vertices);
  EXPECT_EQ(asset.frame, "free");
  EXPECT_EQ(asset.basis_size, 20);
  EXPECT_EQ(asset.linear_modes, 12);
  EXPECT_FALSE(asset.example_fields);
  EXPECT_EQ(asset.cubature_elements, 23);
  EXPECT_EQ(asset.cubature_method, "nn_htp");
  EXPECT_EQ(asset.training_poses, 50);
  EXPECT_EQ(asset.target_tolerance, 1e-3);
  EXPECT_THAT(*asset.needs, ElementsAre("rigid"));
  EXPECT_EQ(asset.seed, 9007199254740991u);
}

TEST(LoadAsset, ReadsTheOtherSelections) {
  const TemporaryFolder folder;
  const auto fixed = [&](const std::string& selection) {
    return *load(folder, load_asset, R"({"name": "a", "object": {"mesh": "m", "fixed": )" + selection + "}}").fixed;
  };
  const auto sphere = std::get<SphereSelection>(fixed(R"({"sphere": {"center": [1, 2, 3], "radius": 0.5}})"));
  EXPECT_THAT(sphere.center, ElementsAre(1, 2, 3));
  EXPECT_EQ(sphere.radius, 0.5);
  EXPECT_EQ(std::get<FileSelection>(fixed(R"({"file": "a.bou"})")).file, folder / "a.bou");
  EXPECT_THAT(std::get<IdSelection>(fixed(R"({"ids": [5, 0]})")).ids, ElementsAre(5, 0));
}

TEST(LoadScene, FillsInDefaults) {
  const TemporaryFolder folder;
  const SceneConfig scene = load(folder, load_scene, R"({"bundle": "bar.h5"})");
  EXPECT_EQ(scene.bundle, folder / "bar.h5");
  EXPECT_EQ(scene.time_step, 0.001);
  EXPECT_EQ(scene.steps, 1000);
  EXPECT_EQ(scene.integrator, "bdf2");
  EXPECT_EQ(scene.gravity, Eigen::Vector3d::Zero());
  EXPECT_FALSE(scene.examples || scene.trajectory);
  EXPECT_EQ(scene.newton.max_iterations, 20);
  EXPECT_EQ(scene.every, 10);
}

TEST(LoadScene, ReadsEveryMember) {
  const TemporaryFolder folder;
  write_file(folder / "ids.txt", "3, 1\n");
  const SceneConfig scene = load(folder, load_scene, R"({
    "bundle": "car.h5", "time_step": 0.01, "steps": 20, "gravity": [0, -0.98, 0], "integrator": "newmark",
    "internal_force": "cubature", "instances": 1,
    "damping": {"mass": 0.02, "stiffness": 0.003}, "newton": {"max_iterations": 5, "tolerance": 1e-8},
    "examples": {"stiffness": 400, "damping": 2, "bias": 0.6, "target": "solve", "force": "linear",
                 "energy_reference": "rest"},
    "forces": [{"vertices": {"ids": [10, 11]}, "force": [0, 0, 50], "start": 0.25, "end": 0.5},
               {"vertices": {"file": "ids.txt"}, "force": [1, 0, 0]}],
    "output": {"trajectory": "run.h5", "every": 2}})");
  EXPECT_EQ(scene.time_step, 0.01);
  EXPECT_EQ(scene.steps, 20);
  EXPECT_EQ(scene.gravity, Eigen::Vector3d(0, -0.98, 0));
  EXPECT_EQ(scene.integrator, "newmark");
  EXPECT_EQ(scene.mass_damping, 0.02);
  EXPECT_EQ(scene.stiffness_damping, 0.003);
  EXPECT_EQ(scene.newton.max_iterations, 5);
  EXPECT_EQ(scene.newton.tolerance, 1e-8);
  EXPECT_EQ(scene.examples->stiffness, 400);
  EXPECT_EQ(scene.examples->damping, 2);
  EXPECT_EQ(scene.examples->bias, 0.6);
  EXPECT_EQ(scene.examples->energy_reference, "rest");
  ASSERT_EQ(scene.forces.size(), 2u);
  EXPECT_THAT(scene.forces[0].vertices, ElementsAre(10, 11));
  EXPECT_EQ(scene.forces[0].force, Eigen::Vector3d(0, 0, 50));
  EXPECT_EQ(scene.forces[0].start, 0.25);
  EXPECT_EQ(scene.forces[0].end, 0.5);
  EXPECT_THAT(scene.forces[1].vertices, ElementsAre(2, 0));
  EXPECT_EQ(scene.forces[1].end, std::numeric_limits<double>::infinity());
  EXPECT_EQ(*scene.trajectory, folder / "run.h5");
  EXPECT_EQ(scene.every, 2);
}

TEST(LoadScene, ResolvesPathsOfAFileInTheCurrentFolder) {
  const TemporaryFolder folder;
  const auto former = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  write_file("scene.json", R"({"bundle": "bar.h5"})");
  EXPECT_EQ(load_scene("scene.json").bundle, "bar.h5");
  std::filesystem::current_path(former);
}

TEST(NeedsOfAScene, AreExamplesWhereItHasAnExampleForce) {
  SceneConfig scene;
  EXPECT_FALSE(needs_of(scene).examples);
  EXPECT_TRUE(needs_of(scene).rigid);
  scene.examples.emplace();
  EXPECT_TRUE(needs_of(scene).examples);
}

TEST(VertexIds, AreReadFromBouFiles) {
  const TemporaryFolder folder;
  write_file(folder / "a.bou", "# clamp\n1, 2,3\r\n\n 10\t7 # two\n9");
  EXPECT_THAT(read_vertex_ids(folder / "a.bou"), ElementsAre(0, 1, 2, 9, 6, 8));
}

}  // namespace
}  // namespace exmat
