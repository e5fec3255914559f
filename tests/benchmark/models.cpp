#include "tests/benchmark/models.h"

#include <map>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "tests/support/synthetic_polynomial.h"
#include "tests/support/synthetic_targets.h"

namespace exmat::benchmarks {
namespace {

CubatureData evenly_spread(const CubatureData& all, int elements) {
  const Eigen::Index count = all.weights.size();
  CubatureData some = all;
  some.elements.resize(elements);
  some.volumes.resize(elements);
  some.gradient.resize(9 * elements, all.gradient.cols());
  for (Eigen::Index j = 0; j < elements; ++j) {
    const Eigen::Index element = (2 * j + 1) * count / (2 * elements);
    some.elements[j] = all.elements[element];
    some.volumes[j] = all.volumes[element];
    some.gradient.middleRows<9>(9 * j) = all.gradient.middleRows<9>(9 * element);
  }
  some.weights.setConstant(elements, static_cast<double>(count) / elements);
  some.youngs_modulus = all.youngs_modulus.head(elements);  // the same everywhere
  some.poisson_ratio = all.poisson_ratio.head(elements);
  return some;
}

ReducedModel whole_bar(int modes, bool free) {
  test::BarOptions options{
      .cells = {8, 3, 3}, .free = free, .linear_modes = modes - 3, .eigenfunctions = 14, .examples = kExamples};
  ReducedModel model = test::make_bar(options).model;
  model.polynomial = test::make_polynomial(*model.cubature);
  model.targets = test::linear_targets(model.examples->examples, kTableDegree);
  return model;
}

}  // namespace

const ReducedModel& bar_model(int modes, int elements, bool free) {
  static std::map<std::pair<int, bool>, ReducedModel> wholes;
  static std::map<std::tuple<int, int, bool>, ReducedModel> models;
  if (!wholes.contains({modes, free})) wholes[{modes, free}] = whole_bar(modes, free);
  const ReducedModel& whole = wholes[{modes, free}];
  const auto [found, made] = models.try_emplace({modes, elements, free}, whole);
  if (made) found->second.cubature = evenly_spread(*whole.cubature, elements);
  return found->second;
}

std::string name_of(Target target) {
  if (target == Target::kNone) return "no_examples";
  return target == Target::kTable ? "table" : "solve";
}

std::unique_ptr<const runtime::Model> prepare(const ReducedModel& model, Target target, bool polynomial) {
  auto result = runtime::build_model(
      model, {.examples = target != Target::kNone, .target_table = target == Target::kTable, .polynomial = polynomial});
  if (!result.model) throw std::runtime_error(to_string(result.complaint));
  return std::move(result.model);
}

runtime::StepScene swing(const runtime::Model& model, Target target) {
  runtime::StepScene scene;
  scene.mass_damping = 0.02;
  scene.stiffness_damping = 0.003;
  scene.gravity_force = gravity_force(model, {0, -3, 0});
  if (target != Target::kNone) scene.examples = {runtime::ExampleSettings{400, 2, 0.6, 4}};
  return scene;
}

}  // namespace exmat::benchmarks
