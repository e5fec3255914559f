#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "precompute/pipeline/build_reduced_model.h"
#include "precompute/study/measure/error_metrics.h"
#include "precompute/study/measure/runs.h"
#include "tests/support/temporary_folder.h"

// The reduced motion of scenes that examples drive, against the full space of the same equations, whose targets are
// sought among all poses over all tets. To save time, the time step is longer than the scenes' own in both, and
// training has half of its runs.

namespace exmat::precompute {
namespace {

struct Case {
  const char* folder;
  MaterialModel material;
  double time_step;
  std::int64_t steps;
  double most;    // error that is allowed
  double former;  // that of targets in the modal basis and no training; 0: the smaller bodies show it
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.folder; }

class FidelityOf : public ::testing::TestWithParam<Case> {
 protected:
  FidelityOf() {
    const std::filesystem::path folder = std::filesystem::path(EXMAT_SOURCE_DIR) / "examples" / GetParam().folder;
    asset_ = load_asset(folder / "asset_recommended.json");
    asset_.material.model = GetParam().material;
    asset_.basis_size = 30;
    asset_.cubature_elements = 90;
    asset_.training.segments = 4;
    asset_.internal_force = ForceMethod::kCubature;
    scene_ = load_scene(folder / "scene_recommended.json");
    scene_.time_step = GetParam().time_step;
    scene_.steps = GetParam().steps;
    scene_.bundle = folder_ / "bundle.h5";
    for (int i = 1; i <= 40; ++i) times_.push_back(static_cast<double>(i * scene_.steps / 40) * scene_.time_step);
  }

  ReducedModel build() {
    BuildReport report;
    // Both bundles of a scene have the same stages before training.
    const BuildOptions options{.cache = folder_ / "cache", .scene = &scene_};
    ReducedModel model = build_reduced_model(asset_, needs_of(scene_), report, options);
    for (const std::string& warning : report.warnings) SCOPED_TRACE(warning);
    return model;
  }
  double error(const ReducedModel& model, const BodyFrames& reference) {
    write_bundle(model, scene_.bundle);
    const SparseMatrix mass = scalar_mass(model.object->mesh, model.object->materials.density);
    const BodyFrames frames = run_reduced(scene_, times_).frames;
    return trajectory_errors(frames, reference, model.object->mesh.vertices, mass, false).position.mean;
  }

  test::TemporaryFolder folder_;
  AssetConfig asset_;
  SceneConfig scene_;
  std::vector<double> times_;
};

INSTANTIATE_TEST_SUITE_P(
    Scenes, FidelityOf,
    ::testing::Values(Case{"04_bar_cuboid", MaterialModel::kStVenantKirchhoff, 0.004, 500, 0.03, 0.057},
                      Case{"07_teddy_global", MaterialModel::kStVenantKirchhoff, 0.004, 375, 0.03, 0.381},
                      Case{"06_cross", MaterialModel::kStableNeoHookean, 0.005, 120, 0.05, 0}),
    [](const auto& scene) { return std::string(scene.param.folder).substr(3); });

TEST_P(FidelityOf, AScenesExamplesIsThatOfTheFullSpace) {
  const ReducedModel model = build();
  write_bundle(model, scene_.bundle);
  const BodyFrames reference = run_full_space(scene_, model, times_);
  const double found = error(model, reference);
  EXPECT_LE(found, GetParam().most);
  RecordProperty("error", fmt::format("{:.4f}", found));
  if (GetParam().former == 0) return;

  // The fault that there was: no training, and targets in the span of the basis.
  asset_.training.from = Training::kNone;
  ReducedModel former = build();
  former.targets.reset();
  former.target_space.reset();
  for (RegionData& region : former.regions) {
    region.targets.reset();
    region.target_space.reset();
  }
  const double before = error(former, reference);
  EXPECT_GT(before, GetParam().most) << "the test would not notice";
  EXPECT_NEAR(before, GetParam().former, 0.1 * GetParam().former);  // another choice of elements changes it
  RecordProperty("former_error", fmt::format("{:.4f}", before));
  fmt::print("{}: {:.2f} %, formerly {:.2f} %\n", GetParam().folder, 100 * found, 100 * before);
}

}  // namespace
}  // namespace exmat::precompute
