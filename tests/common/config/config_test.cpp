#include "common/config/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/config/vertex_ids.h"
#include "tests/common/bundle/small_model.h"

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
  EXPECT_EQ(asset.material.model, MaterialModel::kStVenantKirchhoff);
  EXPECT_FALSE(asset.material.density || asset.fixed || asset.cubature_elements || asset.cubature_tolerance ||
               asset.needs || asset.object_skeleton || asset.render_mesh || asset.contact_vertices ||
               asset.contact_count);
  EXPECT_TRUE(asset.examples.empty());
  EXPECT_EQ(asset.eigenfunctions, 20);
  EXPECT_FALSE(asset.pose_tolerance);
  EXPECT_EQ(asset.formulation, Formulation::kSmoothed);
  EXPECT_FALSE(asset.basis_size);
  EXPECT_EQ(asset.cubature_method, CubatureMethod::kGreedySwap);
  EXPECT_EQ(asset.target_tolerance, 1e-4);
  EXPECT_EQ(asset.internal_force, ForceMethod::kAuto);
  EXPECT_EQ(asset.seed, 1u);
}

TEST(LoadAsset, MultipliesUnitAndScale) {
  const TemporaryFolder folder;
  const auto unit = [&](const std::string& members) {
    return load(folder, load_asset, R"({"name": "a", "object": {"mesh": "m.veg")" + members + "}}").length_unit;
  };
  EXPECT_EQ(unit(""), 1);
  EXPECT_EQ(unit(R"(, "unit": "mm")"), 1e-3);
  EXPECT_EQ(unit(R"(, "unit": "in")"), 0.0254);
  EXPECT_EQ(unit(R"(, "scale": 3)"), 3);
  EXPECT_EQ(unit(R"(, "unit": "cm", "scale": 50)"), 0.5);
}

TEST(LoadAsset, ReadsEveryMember) {
  const TemporaryFolder folder;
  const AssetConfig asset = load(folder, load_asset, R"({
    "name": "car",
    "object": {"mesh": "/data/car.veg", "drop": ["degenerate_tets", "smaller_components"],
               "material": {"model": "stvk", "youngs_modulus": 6.0e6, "poisson_ratio": 0.4, "density": 1000},
               "fixed": {"box": {"min": [0, -1, 0], "max": [1, 1, 0.01]}},
               "materials": [{"tets": {"set": "wheel 1"}, "density": 7}], "render_mesh": "draw/car.obj",
               "skeleton": "draw/bones.json"},
    "shape_space": {"eigenfunctions": 6, "tolerance": 0.05, "weighting": "none"},
    "examples": [{"name": "rest", "mesh": "../ex0.veg", "rest": true},
                 {"name": "bend", "mesh": "sub/./ex1.veg", "drop": ["unreferenced_vertices"]}],
    "alignment": {"method": "coupled", "frame": "free", "landmarks": "marks.txt", "accept": true,
                  "map": [{"example": "bend", "file": "bend.txt"}],
                  "regions": [{"object": {"ids": [1, 2]},
                               "examples": [{"example": "bend", "vertices": {"file": "end.txt"}}]}]},
    "basis": {"size": 20, "linear_modes": 12, "example_fields": false},
    "cubature": {"elements": 23, "method": "nn_htp", "training_poses": 50},
    "targets": {"tolerance": 1e-3},
    "internal_force": "polynomial",
    "contact": {"vertices": {"ids": [3, 4, 5]}, "count": 2},
    "needs": ["rigid", "targets", "contact"],
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
  EXPECT_EQ(std::get<SetSelection>(asset.material_regions.at(0).tets).name, "wheel 1");
  EXPECT_EQ(asset.render_mesh, folder / "draw/car.obj");
  EXPECT_EQ(asset.object_skeleton, folder / "draw/bones.json");
  EXPECT_EQ(asset.eigenfunctions, 6);
  EXPECT_EQ(asset.pose_tolerance, 0.05);
  EXPECT_EQ(asset.weighting, Weighting::kNone);
  ASSERT_EQ(asset.examples.size(), 2u);
  EXPECT_TRUE(asset.examples[0].rest);
  EXPECT_EQ(asset.examples[0].mesh, folder.path().parent_path() / "ex0.veg");
  EXPECT_EQ(asset.examples[1].name, "bend");
  EXPECT_EQ(asset.examples[1].mesh, folder / "sub/ex1.veg");
  EXPECT_TRUE(asset.examples[1].drop.unreferenced_vertices);
  EXPECT_EQ(asset.alignment.method, AlignmentMethod::kCoupled);
  EXPECT_EQ(asset.alignment.frame, AlignmentFrame::kFree);
  EXPECT_EQ(asset.alignment.landmarks, folder / "marks.txt");
  EXPECT_TRUE(asset.alignment.accept);
  ASSERT_EQ(asset.alignment.maps.size(), 1U);
  EXPECT_EQ(asset.alignment.maps[0].example, "bend");
  EXPECT_EQ(asset.alignment.maps[0].file, folder / "bend.txt");
  ASSERT_EQ(asset.alignment.regions.size(), 1U);
  EXPECT_EQ(std::get<IdSelection>(asset.alignment.regions[0].object).ids, (std::vector<std::int64_t>{1, 2}));
  EXPECT_EQ(std::get<FileSelection>(asset.alignment.regions[0].examples[0].vertices).file, folder / "end.txt");
  EXPECT_EQ(asset.basis_size, 20);
  EXPECT_EQ(asset.linear_modes, 12);
  EXPECT_FALSE(asset.example_fields);
  EXPECT_EQ(asset.cubature_elements, 23);
  EXPECT_EQ(asset.cubature_method, CubatureMethod::kNnHtp);
  EXPECT_EQ(asset.training_poses, 50);
  EXPECT_EQ(asset.target_tolerance, 1e-3);
  EXPECT_EQ(asset.internal_force, ForceMethod::kPolynomial);
  EXPECT_THAT(std::get<IdSelection>(*asset.contact_vertices).ids, ElementsAre(3, 4, 5));
  EXPECT_EQ(asset.contact_count, 2);
  EXPECT_THAT(*asset.needs, ElementsAre("rigid", "targets", "contact"));
  EXPECT_EQ(asset.seed, 9007199254740991u);
}

TEST(LoadAsset, ReadsTheOtherSelections) {
  const TemporaryFolder folder;
  const auto fixed = [&](const std::string& selection) {
    return *load(folder, load_asset, R"({"name": "a", "object": {"mesh": "m", "fixed": )" + selection + "}}").fixed;
  };
  const auto sphere = std::get<SphereSelection>(fixed(R"({"sphere": {"center": [1, 2, 3], "radius": 0.5}})"));
  EXPECT_THAT(sphere.centre, ElementsAre(1, 2, 3));
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
  EXPECT_EQ(scene.integrator, Integrator::kBdf2);
  EXPECT_EQ(scene.gravity, Eigen::Vector3d::Zero());
  EXPECT_FALSE(scene.examples || scene.trajectory || scene.render || needs_of(scene).render);
  EXPECT_EQ(scene.newton.max_iterations, 200);
  EXPECT_EQ(scene.precision, Precision::kDouble);
  EXPECT_EQ(scene.sleep.energy, 0);
  EXPECT_EQ(scene.sleep.time, 0.5);
  EXPECT_EQ(scene.internal_force, ForceMethod::kAuto);
  EXPECT_EQ(scene.instances, 1);
  EXPECT_EQ(scene.every, 10);
}

TEST(LoadAsset, ReadsEveryMemberOfSurfaces) {
  const TemporaryFolder folder;
  const AssetConfig asset = load(folder, load_asset, R"({
    "name": "hero",
    "object": {"surface": "art/hero.glb", "cell_size": 0.25, "fixed": {"part": "_FIXED"},
               "materials": [{"tets": {"color": {"rgb": [1, 0.5, 0], "within": 0.2}}, "density": 7}]},
    "contact": {"vertices": {"color": {"rgb": [0, 0, 1]}}},
    "examples": [{"name": "wave", "morph": "Wave"}, {"name": "bow", "surface": "art/bow.obj"},
                 {"name": "jump", "surface": "art/jump.pc2", "frame": 12},
                 {"name": "other", "surface": "art/other.glb", "morph": "key"}]})");
  EXPECT_EQ(asset.object_surface, folder / "art/hero.glb");
  EXPECT_EQ(asset.object_mesh, *asset.object_surface);
  EXPECT_EQ(asset.render_mesh, asset.object_surface);  // what is drawn, where nothing else is named
  EXPECT_EQ(asset.cell_size, 0.25);
  EXPECT_FALSE(asset.cells);
  EXPECT_EQ(std::get<PartSelection>(*asset.fixed).name, "_FIXED");
  const auto& orange = std::get<ColourSelection>(asset.material_regions[0].tets);
  EXPECT_THAT(orange.colour, ElementsAre(1, 0.5, 0));
  EXPECT_EQ(orange.within, 0.2);
  EXPECT_THAT(std::get<ColourSelection>(*asset.contact_vertices).colour, ElementsAre(0, 0, 1));
  ASSERT_EQ(asset.examples.size(), 4u);
  EXPECT_EQ(asset.examples[0].morph, "Wave");
  EXPECT_FALSE(asset.examples[0].surface);
  EXPECT_EQ(asset.examples[0].file(asset.object_mesh), folder / "art/hero.glb");
  EXPECT_EQ(asset.examples[1].surface, folder / "art/bow.obj");
  EXPECT_EQ(asset.examples[1].file(asset.object_mesh), folder / "art/bow.obj");
  EXPECT_EQ(asset.examples[2].frame, 12);
  EXPECT_EQ(asset.examples[3].morph, "key");
}

TEST(LoadScene, ReadsEveryMember) {
  const TemporaryFolder folder;
  write_file(folder / "ids.txt", "3, 1\n");
  const SceneConfig scene = load(folder, load_scene, R"({
    "bundle": "car.h5", "time_step": 0.01, "steps": 20, "gravity": [0, -0.98, 0], "integrator": "newmark",
    "internal_force": "polynomial", "instances": 1000,
    "damping": {"mass": 0.02, "stiffness": 0.003}, "newton": {"max_iterations": 5, "tolerance": 1e-8},
    "sleep": {"energy": 1e-5, "time": 0.25}, "precision": "mixed",
    "examples": {"stiffness": 400, "damping": 2, "bias": 0.6, "target": "table", "target_iterations": 7,
                 "force": "linear", "energy_reference": "rest", "compensate": true},
    "forces": [{"vertices": {"ids": [10, 11]}, "force": [0, 0, 50], "start": 0.25, "end": 0.5},
               {"vertices": {"file": "ids.txt"}, "force": [1, 0, 0]},
               {"vertices": {"part": "hand"}, "force": [1, 0, 0]}, {"vertices": {"point": [1, 2, 3]}, "force": [1, 0, 0]}],
    "attachments": [{"vertices": {"part": "hand"}, "body": 3, "to": "world", "kind": "spring", "stiffness": 50,
                     "damping": 7, "break_force": 9, "motion": [{"time": 0}, {"time": 1, "position": [1, 0, 0]}]},
                    {"vertices": {"file": "ids.txt"}}],
    "output": {"trajectory": "run.h5", "every": 2, "render": true}})");
  ASSERT_EQ(scene.attachments.size(), 2u);
  EXPECT_EQ(scene.attachments[0].place, "/attachments/0");
  EXPECT_EQ(std::get<PartSelection>(scene.attachments[0].vertices).name, "hand");
  EXPECT_EQ(scene.attachments[0].only, 3U);
  EXPECT_EQ(scene.attachments[0].kind, AttachmentKind::kSpring);
  EXPECT_EQ(scene.attachments[0].stiffness, 50);
  EXPECT_EQ(scene.attachments[0].damping, 7);
  EXPECT_EQ(scene.attachments[0].break_force, 9);
  EXPECT_EQ(scene.attachments[0].motion.size(), 2U);
  EXPECT_FALSE(scene.attachments[0].obstacle || scene.attachments[1].obstacle || scene.attachments[1].only);
  EXPECT_EQ(std::get<FileSelection>(scene.attachments[1].vertices).file, folder / "ids.txt");
  EXPECT_EQ(scene.attachments[1].kind, AttachmentKind::kFixed);
  EXPECT_EQ(scene.attachments[1].stiffness, 1e4);
  EXPECT_EQ(scene.attachments[1].damping, 0);
  EXPECT_EQ(scene.attachments[1].break_force, std::numeric_limits<double>::infinity());
  EXPECT_EQ(scene.time_step, 0.01);
  EXPECT_EQ(scene.steps, 20);
  EXPECT_EQ(scene.gravity, Eigen::Vector3d(0, -0.98, 0));
  EXPECT_EQ(scene.integrator, Integrator::kNewmark);
  EXPECT_EQ(scene.mass_damping, 0.02);
  EXPECT_EQ(scene.stiffness_damping, 0.003);
  EXPECT_EQ(scene.newton.max_iterations, 5);
  EXPECT_EQ(scene.newton.tolerance, 1e-8);
  EXPECT_EQ(scene.precision, Precision::kMixed);
  EXPECT_EQ(scene.sleep.energy, 1e-5);
  EXPECT_EQ(scene.sleep.time, 0.25);
  EXPECT_EQ(scene.examples->stiffness, 400);
  EXPECT_EQ(scene.examples->damping, 2);
  EXPECT_EQ(scene.examples->bias, 0.6);
  EXPECT_EQ(scene.examples->target, TargetSource::kTable);
  EXPECT_EQ(scene.examples->target_iterations, 7);
  EXPECT_TRUE(scene.examples->compensate);
  EXPECT_EQ(scene.examples->energy_reference, EnergyReference::kRest);
  EXPECT_EQ(scene.internal_force, ForceMethod::kPolynomial);
  EXPECT_EQ(scene.instances, 1000);
  ASSERT_EQ(scene.forces.size(), 4u);
  EXPECT_FALSE(scene.forces[0].places || scene.forces[1].places);
  EXPECT_EQ(std::get<PartSelection>(scene.forces[2].places.value()).name, "hand");
  EXPECT_EQ(std::get<PointSelection>(scene.forces[3].places.value()).point, (std::array<double, 3>{1, 2, 3}));
  EXPECT_THAT(scene.forces[0].vertices, ElementsAre(10, 11));
  EXPECT_EQ(scene.forces[0].force, Eigen::Vector3d(0, 0, 50));
  EXPECT_EQ(scene.forces[0].start, 0.25);
  EXPECT_EQ(scene.forces[0].end, 0.5);
  EXPECT_THAT(scene.forces[1].vertices, ElementsAre(2, 0));
  EXPECT_EQ(scene.forces[1].end, std::numeric_limits<double>::infinity());
  EXPECT_EQ(*scene.trajectory, folder / "run.h5");
  EXPECT_TRUE(scene.render && needs_of(scene).render);
  EXPECT_EQ(scene.every, 2);
}

TEST(LoadScene, ReadsMeshesAndHeightFields) {
  const TemporaryFolder folder;
  const SceneConfig scene = load(folder, load_scene, R"({"bundle": "b.h5", "obstacles": [
    {"mesh": {"file": "a/level.obj", "scale": 0.01, "position": [1, 2, 3], "orientation": [0, 1, 0, 0],
              "thickness": 0.1}, "friction": 0.5},
    {"mesh": {"file": "rock.ply"}},
    {"height_field": {"file": "hills.csv", "spacing": [0.5, 0.25], "position": [0, 0, -1]}},
    {"height_field": {"heights": [[0, 1, 2], [3, 4, 5]], "spacing": [1, 1]}}]})");
  ASSERT_EQ(scene.obstacles.size(), 4u);
  const auto& level = std::get<MeshConfig>(scene.obstacles[0].shape);
  EXPECT_EQ(level.file, folder / "a/level.obj");
  EXPECT_EQ(level.scale, 0.01);
  EXPECT_EQ(level.thickness, 0.1);
  EXPECT_EQ(level.position, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(level.orientation.x(), 1);
  const auto& rock = std::get<MeshConfig>(scene.obstacles[1].shape);
  EXPECT_EQ(rock.scale, 1);
  EXPECT_EQ(rock.thickness, 0);
  const auto& hills = std::get<HeightFieldConfig>(scene.obstacles[2].shape);
  EXPECT_EQ(hills.file, folder / "hills.csv");
  EXPECT_EQ(hills.spacing, Eigen::Vector2d(0.5, 0.25));
  EXPECT_EQ(hills.position, Eigen::Vector3d(0, 0, -1));
  const auto& steps = std::get<HeightFieldConfig>(scene.obstacles[3].shape);
  EXPECT_FALSE(steps.file);
  EXPECT_EQ(steps.heights, (Eigen::MatrixXd(2, 3) << 0, 1, 2, 3, 4, 5).finished());
}

TEST(LoadScene, ReadsKeys) {
  const TemporaryFolder folder;
  const SceneConfig scene = load(folder, load_scene, R"({"bundle": "b.h5",
    "gravity": {"keys": [{"time": -1, "value": [0, 0, 0]}, {"time": 2, "value": [0, -9.81, 0]}], "interpolation": "step"},
    "examples": {"stiffness": {"keys": [{"time": 0, "value": 0}, {"time": 1, "value": 400}, {"time": 2, "value": 3}]},
                 "damping": {"keys": [{"time": 0.5, "value": 2}], "interpolation": "linear"},
                 "weights": {"keys": [{"time": 0, "value": [1, 0]}, {"time": 1, "value": [0.5, 0.5]}]}},
    "regions": [{"name": "arm", "stiffness": 5, "bias": {"keys": [{"time": 0, "value": 1}, {"time": 3, "value": 0.25}]}},
                {"name": "leg", "stiffness": 5, "weights": [0.25, 0.75]}]})");
  EXPECT_THAT(scene.gravity_keys.times, ElementsAre(-1, 2));
  EXPECT_EQ(scene.gravity_keys.values[1], Eigen::Vector3d(0, -9.81, 0));
  EXPECT_EQ(scene.gravity_keys.interpolation, Interpolation::kStep);
  EXPECT_EQ(scene.gravity, Eigen::Vector3d(0, -9.81, 0)) << "the strongest";
  const ExampleKeysConfig& keys = scene.examples->keys;
  EXPECT_THAT(keys.stiffness.times, ElementsAre(0, 1, 2));
  EXPECT_EQ(keys.stiffness.values[2][0], 3);
  EXPECT_EQ(keys.stiffness.interpolation, Interpolation::kLinear);
  EXPECT_EQ(scene.examples->stiffness, 400) << "the strongest";
  EXPECT_EQ(scene.examples->damping, 2);
  EXPECT_EQ(keys.weights.values[1], Eigen::Vector2d(0.5, 0.5));
  EXPECT_EQ(*scene.examples->weights, Eigen::Vector2d(1, 0));
  EXPECT_TRUE(keys.bias.empty());
  EXPECT_EQ(scene.regions[0].force.keys.bias.times.size(), 2u);
  EXPECT_EQ(scene.regions[0].force.bias, 0.25);
  EXPECT_EQ(*scene.regions[1].force.weights, Eigen::Vector2d(0.25, 0.75));
  EXPECT_TRUE(scene.regions[1].force.keys.empty());
  EXPECT_EQ(place_of_keys(scene), "/gravity");
}

TEST(LoadScene, ReadsJointsAndWhatTheyDrive) {
  const TemporaryFolder folder;
  const SceneConfig scene = load(folder, load_scene, R"({"bundle": "b.h5",
    "examples": {"stiffness": 5, "drivers": [
      {"example": "flex", "joint": "arm", "axis": [0, 0, 2], "angles": [0.5, -1]},
      {"example": "shrug", "joint": "neck", "rotation": [0.6, 0, 0.8, 0], "radius": 0.25}]},
    "body": {"bones": [{"joint": "arm", "motion": [{"time": 0}, {"time": 2, "position": [0, 1, 0]}]}]}})");
  ASSERT_EQ(scene.examples->drivers.size(), 2U);
  const DriverConfig &flex = scene.examples->drivers[0], &shrug = scene.examples->drivers[1];
  EXPECT_EQ(flex.example, "flex");
  EXPECT_EQ(flex.joint, "arm");
  EXPECT_EQ(flex.axis, Eigen::Vector3d::UnitZ());
  EXPECT_THAT(flex.angles, ElementsAre(0.5, -1));
  EXPECT_FALSE(flex.rotation);
  EXPECT_DOUBLE_EQ(shrug.rotation->y(), 0.8);
  EXPECT_EQ(shrug.radius, 0.25);
  ASSERT_EQ(scene.body.bones.size(), 1U);
  EXPECT_EQ(scene.body.bones[0].joint, "arm");
  EXPECT_EQ(scene.body.bones[0].motion[1].position, Eigen::Vector3d::UnitY());
  EXPECT_TRUE(needs_of(scene).full_space);
}

TEST(LoadScene, ReadsObstacles) {
  const TemporaryFolder folder;
  const SceneConfig scene = load(folder, load_scene, R"({"bundle": "b.h5", "obstacles": [
    {"plane": {"point": [0, -1.7, 0], "normal": [0, 2, 0]}, "stiffness": 2e6, "damping": 30, "friction": 0.5},
    {"sphere": {"radius": 0.5}},
    {"box": {"center": [1, 2, 3], "half_extents": [0.1, 0.2, 0.3], "orientation": [0, 0, 1, 0]}},
    {"capsule": {"start": [0, 0, 0], "end": [1, 0, 0], "radius": 0.25},
     "motion": [{"time": 0}, {"time": 1.5, "position": [1, 0, 0], "orientation": [0.6, 0.8, 0, 0]}]}]})");
  ASSERT_EQ(scene.obstacles.size(), 4u);
  const auto& plane = std::get<PlaneConfig>(scene.obstacles[0].shape);
  EXPECT_EQ(plane.point, Eigen::Vector3d(0, -1.7, 0));
  EXPECT_EQ(plane.normal, Eigen::Vector3d::UnitY());
  EXPECT_EQ(scene.obstacles[0].stiffness, 2e6);
  EXPECT_EQ(scene.obstacles[0].damping, 30);
  EXPECT_EQ(scene.obstacles[0].friction, 0.5);
  const auto& sphere = std::get<SphereConfig>(scene.obstacles[1].shape);
  EXPECT_EQ(sphere.centre, Eigen::Vector3d::Zero());
  EXPECT_EQ(sphere.radius, 0.5);
  EXPECT_EQ(scene.obstacles[1].stiffness, 1e6);
  EXPECT_EQ(scene.obstacles[1].friction, 0);
  EXPECT_TRUE(scene.obstacles[1].motion.empty());
  const auto& box = std::get<BoxConfig>(scene.obstacles[2].shape);
  EXPECT_EQ(box.half_extents, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(box.orientation.y(), 1);
  EXPECT_EQ(std::get<CapsuleConfig>(scene.obstacles[3].shape).end, Eigen::Vector3d::UnitX());
  ASSERT_EQ(scene.obstacles[3].motion.size(), 2u);
  EXPECT_EQ(scene.obstacles[3].motion[0].orientation.w(), 1);
  EXPECT_EQ(scene.obstacles[3].motion[1].time, 1.5);
  EXPECT_EQ(scene.obstacles[3].motion[1].position, Eigen::Vector3d::UnitX());
  EXPECT_DOUBLE_EQ(scene.obstacles[3].motion[1].orientation.x(), 0.8);
}

TEST(LoadScene, ReadsTheBody) {
  const TemporaryFolder folder;
  const auto body = [&](const std::string& members) {
    return load(folder, load_scene, R"({"bundle": "b.h5", "body": )" + members + "}").body;
  };
  const BodyConfig none = body("{}");
  EXPECT_FALSE(none.position || none.orientation || none.linear_velocity || none.angular_velocity || none.reduced ||
               none.pose);
  const BodyConfig rigid = body(R"({"position": [1, 2, 3], "orientation": [0.6, 0, 0, 0.8],
                                    "linear_velocity": [-2, 0, 0], "angular_velocity": [0, 0, 7],
                                    "reduced": [1, 2.5]})");
  EXPECT_EQ(*rigid.position, Eigen::Vector3d(1, 2, 3));
  EXPECT_DOUBLE_EQ(rigid.orientation->z(), 0.8);
  EXPECT_EQ(*rigid.linear_velocity, Eigen::Vector3d(-2, 0, 0));
  EXPECT_EQ(*rigid.angular_velocity, Eigen::Vector3d(0, 0, 7));
  EXPECT_EQ(*rigid.reduced, Eigen::Vector2d(1, 2.5));
  const BodyConfig posed = body(R"({"pose": {"example": "bend", "weight": 0.5}, "motion": [{"time": 2}]})");
  EXPECT_EQ(posed.pose->example, "bend");
  EXPECT_EQ(posed.pose->weight, 0.5);
  EXPECT_EQ(posed.motion.size(), 1u);
  EXPECT_EQ(body(R"({"pose": {"example": "bend"}})").pose->weight, 1);
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
  EXPECT_FALSE(needs_of(scene).targets);
  EXPECT_EQ(needs_of(scene).internal_force, ForceMethod::kAuto);
  EXPECT_EQ(needs_of(scene).energy_reference, EnergyReference::kExample);
  scene.internal_force = ForceMethod::kCubature;
  scene.examples.emplace();
  scene.examples->energy_reference = EnergyReference::kRest;
  EXPECT_TRUE(needs_of(scene).examples);
  EXPECT_TRUE(needs_of(scene).targets);
  EXPECT_EQ(needs_of(scene).internal_force, ForceMethod::kCubature);
  EXPECT_EQ(needs_of(scene).energy_reference, EnergyReference::kRest);
}

TEST(NeedsOfAScene, AreContactWhereItHasObstacles) {
  SceneConfig scene;
  EXPECT_FALSE(needs_of(scene).contact);
  scene.obstacles.emplace_back();
  EXPECT_TRUE(needs_of(scene).contact);
}

TEST(NeedsOfAScene, AreExamplesWhereItStartsFromOne) {
  SceneConfig scene;
  scene.body.pose = PoseConfig{"bend", 1};
  EXPECT_TRUE(needs_of(scene).examples);
  EXPECT_FALSE(needs_of(scene).targets);
}

TEST(NeedsOfAScene, AreTheRegionsThatItNames) {
  SceneConfig scene;
  EXPECT_TRUE(needs_of(scene).regions.value().empty());
  scene.regions = {{"left", {}},
                   {"right", {.target = TargetSource::kSolve, .energy_reference = EnergyReference::kRest}}};
  const Needs needs = needs_of(scene);
  EXPECT_FALSE(needs.examples);
  ASSERT_EQ(needs.regions->size(), 2U);
  EXPECT_EQ(needs.regions->at(0).name, "left");
  EXPECT_TRUE(needs.regions->at(0).targets);
  EXPECT_FALSE(needs.regions->at(1).targets);
  EXPECT_EQ(needs.regions->at(1).energy_reference, EnergyReference::kRest);
}

TEST(NeedsOfAScene, AreNoTargetsWhereItSolvesForThem) {
  SceneConfig scene;
  scene.examples.emplace();
  for (const TargetSource target : {TargetSource::kAuto, TargetSource::kTable, TargetSource::kSolve}) {
    scene.examples->target = target;
    EXPECT_EQ(needs_of(scene).targets, scene.examples->target != TargetSource::kSolve);
  }
}

TEST(VertexIds, AreReadFromBouFiles) {
  const TemporaryFolder folder;
  write_file(folder / "a.bou", "# clamp\n1, 2,3\r\n\n 10\t7 # two\n9");
  EXPECT_THAT(read_vertex_ids(folder / "a.bou"), ElementsAre(0, 1, 2, 9, 6, 8));
}

TEST(LoadAsset, MaterialsOfPartsComeInOrder) {
  const TemporaryFolder folder;
  const auto asset = load(folder, load_asset, R"({"name": "a", "object": {"mesh": "m",
    "material": {"model": "stable_neo_hookean"},
    "materials": [{"tets": {"box": {"min": [0, 0, 0], "max": [1, 1, 1]}}, "youngs_modulus": 2e5},
                  {"tets": {"file": "hard.txt"}, "poisson_ratio": -0.2, "density": 7}]}})");
  EXPECT_EQ(asset.material.model, MaterialModel::kStableNeoHookean);
  ASSERT_EQ(asset.material_regions.size(), 2U);
  EXPECT_EQ(std::get<BoxSelection>(asset.material_regions[0].tets).max[0], 1);
  EXPECT_EQ(asset.material_regions[0].youngs_modulus, 2e5);
  EXPECT_FALSE(asset.material_regions[0].density || asset.material_regions[1].youngs_modulus);
  EXPECT_EQ(std::get<FileSelection>(asset.material_regions[1].tets).file, folder / "hard.txt");
  EXPECT_EQ(asset.material_regions[1].poisson_ratio, -0.2);
  EXPECT_EQ(asset.material_regions[1].density, 7);
}

}  // namespace
}  // namespace exmat
