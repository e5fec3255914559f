#include "runtime/bench/bench.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "common/core/error.h"
#include "common/core/progress.h"
#include "common/core/timer.h"
#include "runtime/bench/bench_plan.h"
#include "runtime/bench/dgemm_rate.h"
#include "runtime/scene/bodies.h"
#include "runtime/scene/step_work.h"

namespace exmat::runtime {
namespace {

constexpr double kTurnSeconds = 5e-3;  // of steps between two measurements of the DGEMM rate

/// Means per step, added up before they are divided.
struct Sums {
  double newton_iterations = 0, factorisations = 0, line_search_evaluations = 0, projections = 0, target_iterations = 0;
  double touching_pairs = 0, islands = 0;
  std::array<double, kBenchStageNames.size()> flops{};
  double bytes = 0;
};

class Bench {
 public:
  Bench(const LoadedWorld& loaded, const WorldConfig& config)
      : config_(config), plain_(loaded, config), profiled_(loaded, config) {}

  void measure(const BenchOptions& options, BenchResult& result) {
    const double step_seconds = warm_up(kWarmUpShare * options.seconds);
    const BenchPlan plan(options, config_.steps, step_seconds);
    result.steps = plan.steps;
    result.rounds = plan.rounds;
    turn_ = std::clamp<std::int64_t>(std::llround(kTurnSeconds / step_seconds), 1, result.steps);
    const std::int64_t samples = plan.samples();
    result.step_seconds = Samples(samples);
    for (BenchStage& stage : result.stages) stage.seconds = Samples(samples);
    result.world_stages.fill(Samples(samples));
    Progress progress("bench", samples);
    for (std::int64_t round = 0; round < result.rounds; ++round) measure_round(result, progress);
    conclude(static_cast<double>(samples), result);
  }

 private:
  /// Steps for so long; returns the mean time of a step of all bodies.
  double warm_up(double seconds) {
    const Timer timer;
    std::int64_t steps = 0;
    do {
      plain_.step();
      profiled_.step();
      plain_.require_finite();
      if (++steps % config_.steps == 0) restart();
    } while (timer.seconds() < seconds);
    return timer.seconds() / static_cast<double>(2 * steps);
  }

  void restart() {
    plain_.restart();
    profiled_.restart();
  }

  void measure_round(BenchResult& result, Progress& progress) {
    restart();
    for (std::int64_t left = result.steps; left > 0; left -= turn_) {
      measure_dgemm();
      const std::int64_t steps = std::min(turn_, left);
      for (std::int64_t i = 0; i < steps; ++i) step_plain(result);
      for (std::int64_t i = 0; i < steps; ++i) step_profiled(result);
      progress.advance(steps);
    }
  }

  /// Every few milliseconds, however short a round is.
  void measure_dgemm() {
    if (dgemm_.best() > 0 && since_dgemm_.seconds() < kTurnSeconds) return;
    dgemm_.measure();
    since_dgemm_ = Timer();
  }

  void step_plain(BenchResult& result) {
    const Timer timer;
    const WorldReport report = plain_.step();
    result.step_seconds.add(timer.seconds() / plain_.count());
    plain_.require_finite();
    for (int i = 0; i < plain_.count(); ++i) {
      const StepReport& own = plain_.world().report(i);
      sums_.newton_iterations += own.newton_iterations;
      sums_.factorisations += own.factorisations;
      sums_.line_search_evaluations += own.line_search_evaluations;
      sums_.projections += own.projections;
      sums_.target_iterations += own.target_iterations;
    }
    sums_.touching_pairs += report.touching_pairs;
    sums_.islands += report.islands;
    result.most_pairs = std::max(result.most_pairs, report.touching_pairs);
    result.largest_island = std::max(result.largest_island, report.largest_island);
    result.unconverged_islands += report.unconverged_islands;
  }

  void step_profiled(BenchResult& result) {
    WorldProfile profile;
    profiled_.world().set_profile(&profile);
    const Timer timer;
    profiled_.step();
    const double seconds = timer.seconds();
    profiled_.world().set_profile(nullptr);
    StepWork work;
    if (!result.is_world)
      for (int i = 0; i < profiled_.count(); ++i) {
        const World& world = profiled_.world();
        if ((world.report(i).status & kStepAsleep) == 0)
          work += step_work(world.model(i), world.scene(i), world.report(i));
      }
    add_stages(profile.bodies, profile.bodies_seconds, work, result);
    double& other = profile.seconds[static_cast<std::size_t>(WorldStage::kOther)];
    other = std::max(0.0, seconds - std::accumulate(profile.seconds.begin(), profile.seconds.end(), 0.0));
    for (std::size_t stage = 0; stage < profile.seconds.size(); ++stage)
      result.world_stages[stage].add(profile.seconds[stage] / profiled_.count());
  }

  void add_stages(const Profile& profile, double seconds, const StepWork& work, BenchResult& result) {
    const double staged = std::accumulate(profile.seconds.begin(), profile.seconds.end(), 0.0);
    for (std::size_t stage = 0; stage < kBenchStageNames.size(); ++stage)
      if (stage != kOtherStage) add(stage, profile.seconds[stage], profile.flops[stage], result);
    add(kOtherStage, std::max(0.0, seconds - staged), work.other_flops, result);
    sums_.flops[static_cast<std::size_t>(Stage::kWeights)] += work.weights_flops;
    sums_.flops[static_cast<std::size_t>(Stage::kTarget)] += work.target_flops;
    sums_.bytes += work.bytes;
  }

  void add(std::size_t stage, double seconds, double flops, BenchResult& result) {
    result.stages[stage].seconds.add(seconds / profiled_.count());
    sums_.flops[stage] += flops;
  }

  void conclude(double steps, BenchResult& result) const {
    const double body_steps = steps * plain_.count();
    for (std::size_t stage = 0; stage < kBenchStageNames.size(); ++stage)
      result.stages[stage].flops = sums_.flops[stage] / body_steps;
    result.bytes = sums_.bytes / body_steps;
    result.newton_iterations = sums_.newton_iterations / body_steps;
    result.factorisations = sums_.factorisations / body_steps;
    result.line_search_evaluations = sums_.line_search_evaluations / body_steps;
    result.projections = sums_.projections / body_steps;
    result.target_iterations = sums_.target_iterations / body_steps;
    result.touching_pairs = sums_.touching_pairs / steps;
    result.islands = sums_.islands / steps;
    result.dgemm_flops_per_second = dgemm_.best();
    result.dgemm_median_per_second = dgemm_.median();
    result.instances = plain_.count();
    result.threads = plain_.threads();
    result.state_hash = plain_.hash();
  }

  const WorldConfig& config_;
  Bodies plain_, profiled_;
  DgemmRate dgemm_;
  Timer since_dgemm_;
  Sums sums_;
  std::int64_t turn_ = 1;
};

std::string target_name(const LoadedScene& loaded) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < loaded.scene.examples.size(); ++i)
    if (acts(loaded.scene.examples[i])) names.insert(loaded.model->examples[i].table ? "table" : "solve");
  if (names.empty()) return "none";
  return names.size() == 1 ? *names.begin() : "table and solve";
}

}  // namespace

double BenchResult::flops() const {
  return std::accumulate(stages.begin(), stages.end(), 0.0,
                         [](double sum, const BenchStage& stage) { return sum + stage.flops; });
}

double BenchResult::flops_per_second() const { return flops() / step_seconds.quantile(0.5); }

double BenchResult::limit_seconds() const { return flops() / dgemm_flops_per_second; }

double BenchResult::limit_ratio() const { return step_seconds.quantile(0.5) / limit_seconds(); }

double BenchResult::steps_per_second() const { return 1 / step_seconds.mean(); }

double BenchResult::real_time_factor() const { return time_step / (step_seconds.mean() * instances); }

BenchResult bench(const LoadedWorld& loaded, const WorldConfig& config, const BenchOptions& options) {
  BenchResult result;
  for (std::size_t i = 0; i < loaded.kinds.size(); ++i) {
    const LoadedKind& kind = loaded.kinds[i];
    const Model& model = *kind.loaded.model;
    BenchKind& own = result.kinds.emplace_back();
    own.name = config.bodies[i].name;
    own.bodies = std::ssize(config.bodies[i].places);
    own.vertices = kind.loaded.summary.vertices;
    own.tets = kind.loaded.summary.tets;
    for (const ExampleModel& examples : model.examples) own.examples += examples.weights.examples();
    own.modes = model.modes();
    own.elements = model.internal_force.cubature().elements();
    own.internal_force = model.internal_force.polynomial() ? "polynomial" : "cubature";
    own.target = target_name(kind.loaded);
    if (model.contact) own.contact_vertices = model.contact->vertices();
    if (kind.surface) own.triangles = kind.surface->surface.triangles();
    result.is_world = result.is_world || kind.surface != nullptr;
  }
  result.integrator = name_of(config.bodies.front().scene.integrator);
  result.instruction_set = kernels().name;
  result.time_step = config.time_step;
  Bench(loaded, config).measure(options, result);
  return result;
}

namespace {

/// A single kind's members stand at the root.
nlohmann::ordered_json to_json(const BenchKind& kind) {
  return {{"r", kind.modes},
          {"s", kind.elements},
          {"internal_force", kind.internal_force},
          {"target", kind.target},
          {"examples", kind.examples},
          {"vertices", kind.vertices},
          {"tets", kind.tets},
          {"contact_vertices", kind.contact_vertices},
          {"triangles", kind.triangles}};
}

nlohmann::ordered_json stages_to_json(const BenchResult& result) {
  nlohmann::ordered_json stages = nlohmann::ordered_json::object();
  for (std::size_t stage = 0; stage < kBenchStageNames.size(); ++stage) {
    nlohmann::ordered_json& member = stages[std::string(kBenchStageNames[stage])];
    member = times_to_json(result.stages[stage].seconds);
    if (!result.is_world) member["flops"] = result.stages[stage].flops;
  }
  return stages;
}

nlohmann::ordered_json world_stages_to_json(const BenchResult& result) {
  nlohmann::ordered_json stages = nlohmann::ordered_json::object();
  const double whole = std::accumulate(result.world_stages.begin(), result.world_stages.end(), 0.0,
                                       [](double sum, const Samples& stage) { return sum + stage.mean(); });
  for (std::size_t stage = 0; stage < kWorldStageNames.size(); ++stage) {
    nlohmann::ordered_json& member = stages[std::string(kWorldStageNames[stage])];
    member = times_to_json(result.world_stages[stage]);
    member["share"] = result.world_stages[stage].mean() / whole;
  }
  return stages;
}

}  // namespace

nlohmann::ordered_json to_json(const BenchResult& result) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  const bool is_one_kind = result.kinds.size() == 1;
  if (is_one_kind) json = to_json(result.kinds.front());
  json.update({{"steps", result.steps},
               {"instances", result.instances},
               {"step", times_to_json(result.step_seconds)},
               {"stages", result.is_world ? world_stages_to_json(result) : stages_to_json(result)},
               {"newton_iterations_mean", result.newton_iterations},
               {"factorisations_mean", result.factorisations},
               {"line_search_evaluations_mean", result.line_search_evaluations},
               {"projections_mean", result.projections},
               {"target_iterations_mean", result.target_iterations},
               {"real_time_factor", result.real_time_factor()},
               {"steps_per_second", result.steps_per_second()},
               {"dgemm_gflops", 1e-9 * result.dgemm_flops_per_second},
               {"dgemm_median_gflops", 1e-9 * result.dgemm_median_per_second}});
  if (!result.is_world)
    json.update({{"flops", result.flops()},
                 {"gflops", 1e-9 * result.flops_per_second()},
                 {"limit_ratio", result.limit_ratio()},
                 {"limit_us", microseconds(result.limit_seconds())},
                 {"bytes", result.bytes}});
  else
    json.update({{"single_body_stages", stages_to_json(result)},
                 {"touching_pairs_mean", result.touching_pairs},
                 {"touching_pairs_most", result.most_pairs},
                 {"islands_mean", result.islands},
                 {"largest_island", result.largest_island},
                 {"unconverged_islands", result.unconverged_islands}});
  json.update({{"rounds", result.rounds},
               {"threads", result.threads},
               {"instruction_set", result.instruction_set},
               {"integrator", result.integrator},
               {"time_step", result.time_step}});
  if (!result.kinds.front().name.empty()) {
    json["bodies"] = nlohmann::ordered_json::array();
    for (const BenchKind& kind : result.kinds) {
      nlohmann::ordered_json own{{"name", kind.name}, {"instances", kind.bodies}};
      own.update(to_json(kind));
      json["bodies"].push_back(std::move(own));
    }
  }
  json["state_hash"] = fmt::format("{:016x}", result.state_hash);
  return json;
}

}  // namespace exmat::runtime
