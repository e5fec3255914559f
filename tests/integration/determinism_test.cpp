#include <gtest/gtest.h>
#include <vector>

#include "common/bundle/file_schemas.h"
#include "common/hdf5/hdf5_file.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace {

// Byte for byte and bit for bit: no tolerance.

std::vector<double> values(const Hdf5File& file, const std::string& path) {
  const Hdf5Dataset dataset = file.open_dataset(path);
  std::vector<double> values(dataset.element_count());
  dataset.read(values.data(), ElementType::kFloat64);
  return values;
}

void expect_same_trajectory(const std::filesystem::path& a, const std::filesystem::path& b) {
  const Hdf5File first = Hdf5File::open(a), second = Hdf5File::open(b);
  for (const DatasetSchema& dataset : trajectory_schema().datasets) {
    if (dataset.path == "/step_time") continue;
    const bool present = first.has_dataset(dataset.path);
    ASSERT_EQ(second.has_dataset(dataset.path), present) << dataset.path;
    if (present) {
      EXPECT_EQ(values(first, dataset.path), values(second, dataset.path)) << dataset.path;
    }
  }
}

struct Variant {
  std::string name, threads;
};
const std::vector<Variant> kVariants{{"one", "1"}, {"again", "1"}, {"two", "2"}, {"default", "0"}};

void expect_same_bundles(const TemporaryFolder& folder, const std::filesystem::path& asset) {
  std::string first;
  for (const Variant& variant : kVariants) {
    const auto bundle = folder.path(variant.name + ".h5");
    const Outcome outcome = exmat_precompute({"bundle", asset, "-o", bundle, "--threads", variant.threads});
    ASSERT_EQ(outcome.status, 0) << outcome.errors;
    if (first.empty()) first = read_file(bundle);
    ASSERT_FALSE(first.empty());
    EXPECT_TRUE(read_file(bundle) == first) << variant.name;
  }
}

// By `auto` where it is stable: with a sanitizer, the times of polynomial and cubature are near the limit of what is
// clear.
#ifdef __SANITIZE_ADDRESS__
constexpr auto kInternalForce = "cubature";
#else
constexpr auto kInternalForce = "auto";
#endif

TEST(Determinism, BundlesOfAConstrainedBodyAreTheSameBytes) {
  const TemporaryFolder folder;
  expect_same_bundles(folder, write_bar(folder, {}, {{"internal_force", kInternalForce}}));
}

TEST(Determinism, BundlesOfAFreeBodyAreTheSameBytes) {
  const TemporaryFolder folder;
  expect_same_bundles(folder, write_small_bar(folder, Json::parse(R"({
    "object": { "fixed": null }, "cubature": { "elements": null, "tolerance": 0.1, "method": "greedy" } })")));
}

TEST(Determinism, TrajectoriesAreTheSameButForTheStepTime) {
  const TemporaryFolder folder;
  const auto asset = write_small_bar(folder);
  ASSERT_EQ(exmat_precompute({"bundle", asset, "-o", folder.path("bundle.h5")}).status, 0);
  const auto scene = write_scene(folder, Json::parse(R"({
    "steps": 200, "gravity": [0, -9.81, 0], "damping": { "mass": 0.1, "stiffness": 0.001 },
    "examples": { "stiffness": 500, "damping": 2, "bias": 0.5 }, "output": { "every": 5 } })"));
  for (const Variant& variant : kVariants) {
    const Outcome outcome =
        exmat_runtime({"run", scene, "-o", folder.path(variant.name + ".h5"), "--threads", variant.threads});
    ASSERT_EQ(outcome.status, 0) << outcome.errors;
    expect_same_trajectory(folder.path(kVariants[0].name + ".h5"), folder.path(variant.name + ".h5"));
  }
}

}  // namespace
}  // namespace exmat::test
