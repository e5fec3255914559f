#include <fmt/format.h>
#include <map>

#include "common/config/config.h"
#include "common/mesh/geometry.h"
#include "runtime/scene/scene_loader.h"
#include "tests/benchmark/models.h"
#include "tests/benchmark/register.h"
#include "tests/benchmark/steps.h"
#include "tests/support/box_mesh.h"
#include "tests/support/temporary_folder.h"

namespace exmat::benchmarks {
namespace {

/// The reduced arrays of the bar with a mesh of 6 x cells^3 tets and arrays of its size that no step should touch.
ReducedModel of_size(int cells) {
  ReducedModel model = bar_model(20, 60);
  ObjectData& object = *model.object;
  object.mesh = test::cube_grid(cells);
  object.surface = surface_triangles(object.mesh.tets);
  object.fixed = (object.mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  TetMaterials& materials = object.materials;
  for (Eigen::VectorXd* values : {&materials.density, &materials.youngs_modulus, &materials.poisson_ratio}) {
    const double value = (*values)[0];
    values->setConstant(object.mesh.tet_count(), value);
  }
  model.modal->basis.setConstant(3 * object.mesh.vertex_count(), 20, 0.01);
  model.shape_space->eigenfunctions.setConstant(object.mesh.vertex_count(), model.shape_space->eigenvalues.size(), 1);
  return model;
}

/// As `exmat-runtime run` loads it, without a trajectory.
const runtime::LoadedScene& loaded(int cells) {
  static std::map<int, runtime::LoadedScene> scenes;
  if (const auto found = scenes.find(cells); found != scenes.end()) return found->second;
  const test::TemporaryFolder folder;
  write_bundle(of_size(cells), folder / "bundle.h5");
  const SceneConfig config = load_scene(folder.write(
      "scene.json", R"({"bundle": "bundle.h5", "gravity": [0, -3, 0], "damping": {"mass": 0.02, "stiffness": 0.003},
                        "internal_force": "cubature", "examples": {"stiffness": 400, "damping": 2, "bias": 0.6}})"));
  return scenes.emplace(cells, runtime::load_run(config)).first->second;
}

}  // namespace

void register_sizes() {
  for (const int cells : {6, 12, 26, 55})
    add(fmt::format("size/{}_tets", 6 * cells * cells * cells), [=](::benchmark::State& state) {
      const runtime::LoadedScene& scene = loaded(cells);
      std::size_t bytes = 0;
      for (const ReadRecord& record : scene.records) bytes += record.bytes;
      state.counters["bytes_read"] = static_cast<double>(bytes);
      time_steps(state, *scene.model, scene.scene, scene.start);
    });
}

}  // namespace exmat::benchmarks
