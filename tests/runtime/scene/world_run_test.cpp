#include "runtime/scene/world_run.h"

#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

/// Free blocks and a clamped one, as bundles.
class WorldRunTest : public ::testing::Test {
 protected:
  void SetUp() override {
    test::Bar free =
        test::make_bar({.cells = {4, 2, 2}, .lengths = {0.4, 0.2, 0.2}, .youngs_modulus = 1e6, .free = true});
    free.model.contact = test::surface_contact(free.model);
    write_bundle(free.model, folder_.path() / "free.h5");
    test::Bar clamped = test::make_bar({.youngs_modulus = 1e6});
    clamped.model.contact = test::surface_contact(clamped.model);
    write_bundle(clamped.model, folder_.path() / "clamped.h5");
  }
  WorldConfig world(const std::string& bodies, const std::string& more = "") const {
    const auto file = folder_.path() / "world.json";
    std::ofstream(file) << R"({"time_step": 0.002, "steps": 60, "gravity": [0, 0, -9.81],
      "contact": {"stiffness": 1e7, "damping": 2e4, "friction": 0.4}, "bodies": [)"
                        << bodies << "]" << more << "}";
    return *load_world(file);
  }

  test::TemporaryFolder folder_;
};

constexpr const char* kTwoKinds = R"({"name": "shelf", "bundle": "clamped.h5"},
  {"name": "block", "bundle": "free.h5", "body": {"position": [0.3, 0.013, 0.26]},
   "grid": {"counts": [1, 1, 2], "spacing": [0, 0, 0.22]}})";

TEST_F(WorldRunTest, WritesAGroupForEachBodyAndRunsTheSameEachTime) {
  WorldConfig config = world(kTwoKinds, R"(, "output": {"trajectory": "w.h5", "every": 20})");
  const LoadedWorld loaded = load_world_run(config);
  const WorldSummary summary = run(loaded, config);
  EXPECT_EQ(summary.bodies, 3);
  EXPECT_EQ(summary.steps, 60);
  EXPECT_EQ(summary.unconverged_steps, 0);
  EXPECT_GT(summary.most_pairs, 0);
  EXPECT_GT(summary.largest_island, 1);
  EXPECT_LE(summary.end.total(), summary.start.total());
  const Hdf5File file = Hdf5File::open(folder_.path() / "w.h5");
  for (const char* name : {"shelf", "block_0", "block_1"}) {
    const std::string group = std::string("/bodies/") + name;
    EXPECT_EQ(file.open_dataset(group + "/vertices").sizes()[0], 4) << name;
    EXPECT_EQ(file.open_dataset(group + "/energy/kinetic").sizes()[0], 4) << name;
  }
  EXPECT_FALSE(file.has_dataset("/vertices"));
  EXPECT_TRUE(std::filesystem::exists(folder_.path() / "w.xdmf"));
  // The upper block starts above the lower one.
  std::vector<double> position(3 * 4);
  const Hdf5Dataset places = file.open_dataset("/bodies/block_1/body/position");
  places.read(position.data(), ElementType::kFloat64);
  EXPECT_NEAR(position[2], 0.26 + 0.22, 1e-12);
  config.trajectory.reset();
  EXPECT_EQ(run(loaded, config).state_hash, summary.state_hash);
}

TEST_F(WorldRunTest, ABodyWithFixedVerticesHasOnePlace) {
  const WorldConfig config =
      world(R"({"name": "shelf", "bundle": "clamped.h5", "grid": {"counts": [2, 1, 1], "spacing": [2, 0, 0]}})");
  try {
    load_world_run(config);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/bodies/0"));
    EXPECT_THAT(error.what(), HasSubstr("one place"));
  }
}

}  // namespace
}  // namespace exmat::runtime
