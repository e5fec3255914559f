#include "runtime/api/settings.h"

#include <cstring>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <vector>

#include "common/config/config.h"
#include "runtime/api/failures.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

// The one other place that has defaults: the schema, by way of a scene file without members.
TEST(Settings, DefaultsAreThoseOfASceneFile) {
  const test::TemporaryFolder folder;
  const SceneConfig file =
      load_scene(folder.write("scene.json", R"({"bundle": "b.h5", "examples": {"stiffness": 0}})"));
  const SceneConfig found = scene_of("b.h5", nullptr);
  EXPECT_EQ(found.time_step, file.time_step);
  EXPECT_EQ(found.integrator, file.integrator);
  EXPECT_EQ(found.internal_force, file.internal_force);
  EXPECT_EQ(found.mass_damping, file.mass_damping);
  EXPECT_EQ(found.stiffness_damping, file.stiffness_damping);
  EXPECT_EQ(found.newton.max_iterations, file.newton.max_iterations);
  EXPECT_EQ(found.newton.tolerance, file.newton.tolerance);
  EXPECT_EQ(found.precision, file.precision);
  EXPECT_EQ(found.sleep.energy, file.sleep.energy);
  EXPECT_EQ(found.sleep.time, file.sleep.time);
  EXPECT_EQ(found.gravity, file.gravity);
  EXPECT_FALSE(found.examples);
  exmat_settings with = default_settings();
  with.use_examples = 1;
  const ExampleForceConfig examples = scene_of("b.h5", &with).examples.value();
  EXPECT_EQ(examples.damping, file.examples->damping);
  EXPECT_EQ(examples.bias, file.examples->bias);
  EXPECT_EQ(examples.target, file.examples->target);
  EXPECT_EQ(examples.target_iterations, file.examples->target_iterations);
  EXPECT_EQ(examples.energy_reference, file.examples->energy_reference);
}

// A caller of the first version: what it does not know is at its default.
TEST(Settings, OfAnOlderCallerEndWhereItsStructEnds) {
  exmat_settings settings = default_settings();
  settings.size = kSettingsSizes.first;
  settings.time_step = 0.25;
  std::vector<unsigned char> bytes(kSettingsSizes.first);
  std::memcpy(bytes.data(), &settings, bytes.size());
  EXPECT_EQ(scene_of("b.h5", reinterpret_cast<const exmat_settings*>(bytes.data())).time_step, 0.25);
}

TEST(Settings, BeyondAllScalesAreRefused) {
  for (double exmat_settings::*const member :
       {&exmat_settings::time_step, &exmat_settings::example_stiffness, &exmat_settings::example_damping,
        &exmat_settings::sleep_energy, &exmat_settings::sleep_time, &exmat_settings::space_release}) {
    exmat_settings settings = default_settings();
    settings.*member = 1e200;
    EXPECT_THROW(scene_of("b.h5", &settings), InvalidArgument);
  }
  exmat_settings settings = default_settings();
  settings.gravity[1] = -1e200;
  try {
    scene_of("b.h5", &settings);
    ADD_FAILURE() << "taken";
  } catch (const InvalidArgument& error) {
    EXPECT_THAT(error.what(), HasSubstr("settings.gravity[1] = -1e+200: expected a finite number, of at most 1e+30"));
  }
}

TEST(Settings, OfNoVersionAreRefused) {
  for (const std::size_t size : {std::size_t{0}, kSettingsSizes.first - 1, kMostStructBytes + 1}) {
    exmat_settings settings = default_settings();
    settings.size = size;
    EXPECT_THROW(scene_of("b.h5", &settings), InvalidArgument) << size;
  }
}

}  // namespace
}  // namespace exmat::runtime
