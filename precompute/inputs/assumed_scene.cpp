#include "precompute/inputs/assumed_scene.h"

#include <cstdint>

#include "precompute/targets/target_table.h"

namespace exmat::precompute {
namespace {

constexpr double kTimeStep = 0.004;  // [s]
constexpr double kStiffness = 400;   // [1/s^2]: poses are taken in a third of a second
constexpr double kDamping = 15;      // [1/s], with a little overshooting
constexpr double kTurn = 0.3;        // from one pose to the next [s]
constexpr double kFloorStiffness = 1e6, kFloorFriction = 0.5;

}  // namespace

Json assumed_scene(const Json& asset, const std::string& name, const SurfaceFile& surface) {
  const std::size_t poses = asset.contains("examples") ? asset["examples"].size() : 0;
  const bool free = !asset["object"].contains("fixed");
  const double duration = 2 * static_cast<double>(poses) + (free ? 2 : 1);
  Json scene = {{"bundle", name + ".h5"},
                {"time_step", kTimeStep},
                {"steps", static_cast<std::int64_t>(duration / kTimeStep)},
                {"gravity", {0, -9.81, 0}},
                {"damping", {{"mass", free ? 0.2 : 1.0}, {"stiffness", 0.002}}},
                {"output", {{"trajectory", name + "_run.h5"}, {"every", 5}, {"render", true}}}};
  if (free)
    scene["obstacles"] = {
        {{"plane", {{"point", {0, surface.mesh.vertices.col(1).minCoeff(), 0}}, {"normal", {0, 1, 0}}}},
         {"stiffness", kFloorStiffness},
         {"friction", kFloorFriction}}};
  if (poses == 0) return scene;
  Json keys = Json::array();
  const auto add = [&](double time, std::size_t example) {
    std::vector<double> weights(poses + 1, 0);
    weights[example] = 1;
    keys.push_back({{"time", time}, {"value", weights}});
  };
  for (std::size_t k = 0; k < poses; ++k) {
    const double start = 2 * static_cast<double>(k) + (free ? 1.5 : 0.5);
    add(start, 0);
    add(start + kTurn, k + 1);
    add(start + 1, k + 1);
    add(start + 1 + kTurn, 0);
  }
  scene["examples"] = {{"stiffness", kStiffness}, {"damping", kDamping}, {"weights", {{"keys", keys}}}};
  if (!surface.skeleton && static_cast<std::int64_t>(poses) + 1 <= kMostPolynomialExamples)
    scene["examples"]["compensate"] = true;
  return scene;
}

}  // namespace exmat::precompute
