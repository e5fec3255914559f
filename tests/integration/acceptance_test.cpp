#include <cstdlib>
#include <gtest/gtest.h>

#include "tests/integration/support.h"

// Folder of the acceptance check and the paper's car; the environment variable of this name goes first.
#ifndef EXMAT_SHARED_DIR
#define EXMAT_SHARED_DIR EXMAT_SOURCE_DIR "/../shared"
#endif

namespace exmat::test {
namespace {

const std::filesystem::path kExample = EXMAT_SOURCE_DIR "/examples/01_twisted_bar";

std::filesystem::path shared_folder() {
  const char* folder = std::getenv("EXMAT_SHARED_DIR");
  return folder != nullptr ? folder : EXMAT_SHARED_DIR;
}

Outcome python(const std::vector<std::string>& arguments) { return execute("/usr/bin/python3", arguments); }

/// Why a test that reads HDF5 in Python cannot run here; empty if it can.
std::string what_is_missing(const std::string& modules) {
  return python({"-c", "import " + modules}).status == 0 ? "" : "/usr/bin/python3 lacks one of " + modules;
}

class Acceptance : public testing::Test {
 protected:
  /// Builds an asset with the program and has the acceptance check recompute the bundle.
  void expect_accepted(const std::filesystem::path& asset) {
    const auto check = shared_folder() / "checks" / "verify_bundle.py";
    if (!std::filesystem::exists(check)) GTEST_SKIP() << "no acceptance check: " << check;
    if (const auto missing = what_is_missing("h5py, numpy, scipy"); !missing.empty()) GTEST_SKIP() << missing;
    const auto bundle = folder_.path("bundle.h5");
    const Outcome built = exmat_precompute({"bundle", asset, "-o", bundle});
    ASSERT_EQ(built.status, 0) << built.errors;
    const Outcome checked = python({check, bundle});
    EXPECT_EQ(checked.status, 0) << checked.output << checked.errors;
  }

  TemporaryFolder folder_;
};

// The check recomputes bundles of linear tets.
TEST_F(Acceptance, TwistedBar) {
  Json asset = Json::parse(read_file(kExample / "asset.json"));
  asset["object"]["formulation"] = "linear";
  asset["object"]["mesh"] = kExample / "bar.msh";
  for (Json& example : asset["examples"]) example["mesh"] = kExample / example["mesh"].get<std::string>();
  expect_accepted(folder_.write("asset.json", asset.dump(2)));
}

/// The asset of the car, written; empty where there is no car.
std::filesystem::path write_car(const TemporaryFolder& folder) {
  const auto car = shared_folder() / "data" / "car";
  if (!std::filesystem::exists(car / "car.veg")) return {};
  Json asset = Json::parse(R"({
    "name": "car",
    "object": { "formulation": "linear",
                "material": { "model": "stvk", "youngs_modulus": 6e6, "poisson_ratio": 0.4, "density": 1000 } },
    "shape_space": { "eigenfunctions": 6 },
    "examples": [ { "name": "rest", "rest": true }, { "name": "bend" } ],
    "basis": { "size": 20, "linear_modes": 12 },
    "cubature": { "elements": 23 } })");
  asset["object"]["mesh"] = car / "car.veg";
  asset["examples"][0]["mesh"] = car / "ex0.veg";
  asset["examples"][1]["mesh"] = car / "ex1.veg";
  return folder.write("asset.json", asset.dump(2));
}

TEST_F(Acceptance, Car) {
  const auto asset = write_car(folder_);
  if (asset.empty()) GTEST_SKIP() << "no car in " << shared_folder();
  expect_accepted(asset);
}

// The published scene: the car drives into a wall. It turns back, stays near the obstacles' surfaces and in shape; an
// example force gives it energy, nothing else does.
TEST_F(Acceptance, CarAgainstTheWall) {
  const auto asset = write_car(folder_);
  if (asset.empty()) GTEST_SKIP() << "no car in " << shared_folder();
  if (const auto missing = what_is_missing("h5py, numpy"); !missing.empty()) GTEST_SKIP() << missing;
  const auto check = folder_.write("check.py", R"(import sys, h5py, numpy as np
run, bundle = h5py.File(sys.argv[1]), h5py.File(sys.argv[2])
x, p = run["vertices"][:].astype(float), run["linear_momentum"][:]
energy = sum(run["energy"][part][:] for part in ("kinetic", "elastic", "potential"))
assert np.isfinite(x).all() and np.isfinite(p).all()
assert p[0, 0] < 0 < p[-1, 0], ("the wall turns it back", p[0], p[-1])
size = np.linalg.norm(np.ptp(x[0], axis=0))
stretch = np.abs(np.linalg.norm(np.ptp(x, axis=1), axis=1) / size - 1).max()
assert stretch < 0.1, ("the bounding box keeps its size", stretch)
depth = -1.7 - bundle["contact/positions"][:, 1]  # the car begins 9 cm deep in the floor
assert x[:, :, 0].min() > -10 - 0.05 * size, ("depth in the wall", x[:, :, 0].min())
assert x[:, :, 1].min() > -1.7 - 0.02 * size, ("depth in the floor", x[:, :, 1].min())
pressed = 0.5e6 * (bundle["contact/areas"][:] * np.maximum(depth, 0) ** 2).sum()
if "examples" not in run:
    assert energy.max() <= 1.001 * (energy[0] + pressed), ("energy", energy.max(), energy[0] + pressed)
)");
  const Json wall = Json::parse(R"({ "plane": { "point": [-10, 6, 0], "normal": [1, 0, 0] }, "stiffness": 1e6 })");
  const Json floor = Json::parse(R"({ "plane": { "point": [0, -1.7, 0], "normal": [0, 1, 0] }, "stiffness": 1e6 })");
  Json scene = Json::parse(R"({ "bundle": "bundle.h5", "time_step": 0.005, "steps": 700, "gravity": [0, -0.98, 0],
                                "body": { "linear_velocity": [-2, 0, 0] },
                                "examples": { "stiffness": 50, "damping": 2 },
                                "output": { "trajectory": "trajectory.h5", "every": 10 } })");
  scene["obstacles"] = {wall, floor};
  const auto path = folder_.write("scene.json", scene.dump());
  const Outcome built = exmat_precompute({"bundle", asset, "-o", folder_.path("bundle.h5"), "--scene", path});
  ASSERT_EQ(built.status, 0) << built.errors;
  for (const bool examples : {true, false}) {
    if (!examples) scene.erase("examples");
    const Outcome stepped = exmat_runtime({"run", folder_.write("scene.json", scene.dump())});
    ASSERT_EQ(stepped.status, 0) << stepped.errors;
    const Outcome checked = python({check, folder_.path("trajectory.h5"), folder_.path("bundle.h5")});
    EXPECT_EQ(checked.status, 0) << examples << checked.output << checked.errors;
  }
}

}  // namespace
}  // namespace exmat::test
