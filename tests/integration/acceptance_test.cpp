#include <cstdlib>
#include <gtest/gtest.h>

#include "tests/integration/support.h"

// Where the acceptance check and the paper's car lie; the environment variable of this name goes first.
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

TEST_F(Acceptance, TwistedBar) { expect_accepted(kExample / "asset.json"); }

TEST_F(Acceptance, Car) {
  const auto car = shared_folder() / "data" / "car";
  if (!std::filesystem::exists(car / "car.veg")) GTEST_SKIP() << "no car: " << car;
  Json asset = Json::parse(R"({
    "name": "car",
    "object": { "material": { "model": "stvk", "youngs_modulus": 6e6, "poisson_ratio": 0.4, "density": 1000 } },
    "shape_space": { "eigenfunctions": 6 },
    "examples": [ { "name": "rest", "rest": true }, { "name": "bend" } ],
    "basis": { "size": 20, "linear_modes": 12 },
    "cubature": { "elements": 23 } })");
  asset["object"]["mesh"] = car / "car.veg";
  asset["examples"][0]["mesh"] = car / "ex0.veg";
  asset["examples"][1]["mesh"] = car / "ex1.veg";
  expect_accepted(folder_.write("asset.json", asset.dump(2)));
}

}  // namespace
}  // namespace exmat::test
