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

namespace exmat::runtime {
namespace {

constexpr double kTurnSeconds = 5e-3;  // of steps between two measurements of the DGEMM rate

/// Means per step, added up before they are divided.
struct Sums {
  double newton_iterations = 0, factorisations = 0, line_search_evaluations = 0, projections = 0, target_iterations = 0;
  std::array<double, kBenchStageNames.size()> flops{};
  double bytes = 0;
};

class Bench {
 public:
  Bench(const LoadedScene& loaded, const SceneConfig& config)
      : config_(config), plain_(make_bodies(loaded, config)), profiled_(make_bodies(loaded, config)) {
    profiled_.set_profiled(true);
  }

  void measure(const BenchOptions& options, BenchResult& result) {
    const double step_seconds = warm_up(kWarmUpShare * options.seconds);
    const BenchPlan plan(options, config_.steps, step_seconds);
    result.steps = plan.steps;
    result.rounds = plan.rounds;
    turn_ = std::clamp<std::int64_t>(std::llround(kTurnSeconds / step_seconds), 1, result.steps);
    const std::int64_t samples = plan.samples();
    result.step_seconds = Samples(samples);
    for (BenchStage& stage : result.stages) stage.seconds = Samples(samples);
    Progress progress("bench", samples);
    for (std::int64_t round = 0; round < result.rounds; ++round) measure_round(result, progress);
    conclude(static_cast<double>(samples) * config_.instances, result);
  }

 private:
  /// Steps for so long; returns the mean time of a step of all bodies.
  double warm_up(double seconds) {
    const Timer timer;
    std::int64_t steps = 0;
    do {
      plain_.step();
      profiled_.step();
      require_finite(plain_, config_);
      if (++steps % config_.steps == 0) restart();
    } while (timer.seconds() < seconds);
    const double mean = timer.seconds() / static_cast<double>(2 * steps);
    profiled_.take_measured();
    return mean;
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
    const std::span<const StepReport> reports = plain_.step();
    result.step_seconds.add(timer.seconds() / config_.instances);
    require_finite(plain_, config_);
    for (const StepReport& report : reports) {
      sums_.newton_iterations += report.newton_iterations;
      sums_.factorisations += report.factorisations;
      sums_.line_search_evaluations += report.line_search_evaluations;
      sums_.projections += report.projections;
      sums_.target_iterations += report.target_iterations;
    }
  }

  void step_profiled(BenchResult& result) {
    profiled_.step();
    const Bodies::Measured measured = profiled_.take_measured();
    const Profile& profile = measured.profile;
    const StepWork& work = measured.work;
    const double staged = std::accumulate(profile.seconds.begin(), profile.seconds.end(), 0.0);
    for (std::size_t stage = 0; stage < kBenchStageNames.size(); ++stage)
      if (stage != kOtherStage) add(stage, profile.seconds[stage], profile.flops[stage], result);
    add(kOtherStage, std::max(0.0, measured.seconds - staged), work.other_flops, result);
    sums_.flops[static_cast<std::size_t>(Stage::kWeights)] += work.weights_flops;
    sums_.flops[static_cast<std::size_t>(Stage::kTarget)] += work.target_flops;
    sums_.bytes += work.bytes;
  }

  void add(std::size_t stage, double seconds, double flops, BenchResult& result) {
    result.stages[stage].seconds.add(seconds / config_.instances);
    sums_.flops[stage] += flops;
  }

  void conclude(double body_steps, BenchResult& result) const {
    for (std::size_t stage = 0; stage < kBenchStageNames.size(); ++stage)
      result.stages[stage].flops = sums_.flops[stage] / body_steps;
    result.bytes = sums_.bytes / body_steps;
    result.newton_iterations = sums_.newton_iterations / body_steps;
    result.factorisations = sums_.factorisations / body_steps;
    result.line_search_evaluations = sums_.line_search_evaluations / body_steps;
    result.projections = sums_.projections / body_steps;
    result.target_iterations = sums_.target_iterations / body_steps;
    result.dgemm_flops_per_second = dgemm_.best();
    result.dgemm_median_per_second = dgemm_.median();
    result.threads = plain_.threads();
    result.state_hash = plain_.hash();
  }

  const SceneConfig& config_;
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

BenchResult bench(const LoadedScene& loaded, const SceneConfig& config, const BenchOptions& options) {
  BenchResult result;
  const InternalForce& force = loaded.model->internal_force;
  result.modes = loaded.model->modes();
  result.elements = force.cubature().elements();
  result.vertices = loaded.summary.vertices;
  result.tets = loaded.summary.tets;
  for (const ExampleModel& examples : loaded.model->examples) result.examples += examples.weights.examples();
  result.integrator = name_of(config.integrator);
  result.internal_force = force.polynomial() ? "polynomial" : "cubature";
  result.target = target_name(loaded);
  result.instruction_set = kernels().name;
  result.time_step = config.time_step;
  result.instances = config.instances;
  Bench(loaded, config).measure(options, result);
  return result;
}

nlohmann::ordered_json to_json(const BenchResult& result) {
  nlohmann::ordered_json stages = nlohmann::ordered_json::object();
  for (std::size_t stage = 0; stage < kBenchStageNames.size(); ++stage) {
    nlohmann::ordered_json member = times_to_json(result.stages[stage].seconds);
    member["flops"] = result.stages[stage].flops;
    stages[std::string(kBenchStageNames[stage])] = std::move(member);
  }
  return {{"r", result.modes},
          {"s", result.elements},
          {"steps", result.steps},
          {"instances", result.instances},
          {"step", times_to_json(result.step_seconds)},
          {"stages", stages},
          {"flops", result.flops()},
          {"gflops", 1e-9 * result.flops_per_second()},
          {"dgemm_gflops", 1e-9 * result.dgemm_flops_per_second},
          {"limit_ratio", result.limit_ratio()},
          {"newton_iterations_mean", result.newton_iterations},
          {"real_time_factor", result.real_time_factor()},
          {"steps_per_second", result.steps_per_second()},
          {"limit_us", microseconds(result.limit_seconds())},
          {"dgemm_median_gflops", 1e-9 * result.dgemm_median_per_second},
          {"bytes", result.bytes},
          {"factorisations_mean", result.factorisations},
          {"line_search_evaluations_mean", result.line_search_evaluations},
          {"projections_mean", result.projections},
          {"target_iterations_mean", result.target_iterations},
          {"rounds", result.rounds},
          {"threads", result.threads},
          {"instruction_set", result.instruction_set},
          {"integrator", result.integrator},
          {"internal_force", result.internal_force},
          {"target", result.target},
          {"examples", result.examples},
          {"time_step", result.time_step},
          {"vertices", result.vertices},
          {"tets", result.tets},
          {"state_hash", fmt::format("{:016x}", result.state_hash)}};
}

}  // namespace exmat::runtime
