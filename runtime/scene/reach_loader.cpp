#include "runtime/scene/reach_loader.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <utility>

#include "common/core/error.h"
#include "runtime/scene/attachment_loader.h"
#include "runtime/scene/keyed_settings.h"
#include "runtime/sim/step/sleep.h"

namespace exmat::runtime {
namespace {

[[noreturn]] void refuse(const SceneConfig& config, const std::string& member, std::string expected, std::string found,
                         std::string advice = "") {
  throw InputError({config.file.string(), fmt::format("{}/reach{}", config.place, member), std::move(expected),
                    std::move(found), std::move(advice)});
}

/// The number of the example force in the scene's.
std::size_t find_force(const SceneConfig& config, const LoadedScene& loaded) {
  const std::string& region = config.reach->region;
  const auto& forces = loaded.model->examples;
  const auto found = std::ranges::find(forces, region, &ExampleModel::region);
  if (found == forces.end()) {
    std::vector<std::string> names;
    for (const RegionForceConfig& own : config.regions) names.push_back(own.name);
    if (region.empty())
      refuse(config, "", "a scene with \"examples\", whose weights are chosen", "none",
             names.empty() ? "" : fmt::format("or name a region: \"{}\"", fmt::join(names, "\" or \"")));
    refuse(config, "/region",
           names.empty() ? "no region, since the scene has none"
                         : fmt::format("a region of the scene: \"{}\"", fmt::join(names, "\" or \"")),
           fmt::format("\"{}\"", region));
  }
  const auto force = static_cast<std::size_t>(found - forces.begin());
  const ExampleSettings& settings = loaded.scene.examples[force];
  if (!acts(settings)) refuse(config, "", "an example force, by its stiffness", "a stiffness of 0");
  if (settings.given_weights.size() > 0 || !settings.drivers.empty())
    refuse(config, "", "examples without weights and drivers, or no reach", "both");
  return force;
}

Eigen::VectorXd limits(const SceneConfig& config, const std::optional<Eigen::VectorXd>& given, double usual,
                       const char* member, Eigen::Index examples) {
  if (!given) return Eigen::VectorXd::Constant(examples, usual);
  if (given->size() != examples)
    refuse(config, member, fmt::format("{} numbers, one for each example", examples), fmt::format("{}", given->size()),
           "the first is that of the rest pose");
  return *given;
}

}  // namespace

LoadedReach load_reach(const SceneConfig& config, const ObjectData& object, LoadedScene& loaded) {
  const ReachConfig& own = *config.reach;
  if (loaded.model->skeleton) refuse(config, "", "a body that steps in its modes", "one on a skeleton");
  LoadedReach reach;
  ReachTargets& targets = reach.targets;
  targets.force = find_force(config, loaded);
  targets.change = own.change;
  targets.horizon = own.horizon;
  const Eigen::Index examples = loaded.model->examples[targets.force].weights.examples();
  targets.lowest = limits(config, own.lowest, 0, "/lowest", examples);
  targets.highest = limits(config, own.highest, 1, "/highest", examples);
  if (!can_hold(targets.lowest, targets.highest))
    refuse(config, "", "limits between which weights add up to 1, none of lowest above that of highest",
           fmt::format("sums of {:g} and {:g}", targets.lowest.sum(), targets.highest.sum()));
  const auto points = std::ssize(own.targets);
  targets.rest.resize(points, 3);
  targets.basis_rows.resize(3 * points, loaded.model->modes());
  targets.places.resize(3 * points);
  for (Eigen::Index i = 0; i < points; ++i) {
    const ReachTargetConfig& target = own.targets[static_cast<std::size_t>(i)];
    const std::string member = fmt::format("/targets/{}/vertices", i);
    const Patch patch = load_patch(config, object, target.vertices, config.place + "/reach" + member,
                                   /*in_modes=*/true, loaded);
    if (!loaded.model->frame->moves() && patch.basis_rows.isZero(0))
      refuse(config, member, "vertices of which some move", "fixed ones alone");
    const Eigen::VectorXd shares = patch.masses / patch.masses.sum();
    targets.rest.row(i) = shares.transpose() * patch.rest;
    auto rows = targets.basis_rows.middleRows<3>(3 * i);
    rows.setZero();
    for (Eigen::Index k = 0; k < shares.size(); ++k) rows += shares[k] * patch.basis_rows.middleRows<3>(3 * k);
    reach.places.push_back(make_setting(target.position));
    reach.places.back().sample(0, targets.places.segment<3>(3 * i));
  }
  return reach;
}

void move_targets(const LoadedReach& reach, const StepScene& scene, State& state, Reach& own) {
  const double end = static_cast<double>(state.step + 1) * scene.time_step;
  bool moves = false;
  for (std::size_t i = 0; i < reach.places.size(); ++i) {
    Eigen::Vector3d place;
    reach.places[i].sample(end, place);
    auto now = own.targets().places.segment<3>(3 * static_cast<Eigen::Index>(i));
    moves |= now != place;
    now = place;
  }
  if (moves) wake(state);
}

}  // namespace exmat::runtime
