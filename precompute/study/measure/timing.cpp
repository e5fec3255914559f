#include "precompute/study/measure/timing.h"

#include <algorithm>
#include <optional>

#include "common/core/progress.h"
#include "common/core/timer.h"
#include "runtime/scene/samples.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/world/world.h"

namespace exmat::precompute {
namespace {

constexpr double kRoundSeconds = 0.25;     // of one point in one round, twice: with and without clocks inside
constexpr std::int64_t kFewestSteps = 20;  // in any case
constexpr std::int64_t kWarmUpSteps = 50;

using runtime::Samples;

double of_stage(const runtime::Profile& profile, runtime::Stage stage) {
  return profile.seconds[static_cast<std::size_t>(stage)];
}

// Times of whole steps, and of weights and targets within.
class StepSamples {
 public:
  void add_step(double seconds) {
    whole_.add(seconds);
    ++count_;
  }
  void add_interpolation(double seconds) { interpolation_.add(seconds); }
  /// Without stages.
  StepTimes times() const {
    StepTimes times;
    times.median = whole_.quantile(0.5);
    times.p95 = whole_.quantile(0.95);
    times.interpolation = interpolation_.quantile(0.5);
    times.steps = count_;
    return times;
  }

 private:
  Samples whole_, interpolation_;
  std::int64_t count_ = 0;
};

class TimedScene {
 public:
  TimedScene(SceneConfig config, std::int64_t steps)
      : loaded_(load(std::move(config))), steps_(steps), workspace_(*loaded_.model, loaded_.scene) {}

  void warm_up() {
    round(std::min(steps_, kWarmUpSteps), [](double) {});
  }

  void measure() {
    round(steps_, [this](double seconds) { samples_.add_step(seconds); });
    runtime::Profile profile;
    workspace_.profile = &profile;
    round(steps_, [&](double) {
      for (std::size_t i = 0; i < kTimedStages.size(); ++i) stages_[i].add(profile.seconds[i]);
      samples_.add_interpolation(of_stage(profile, runtime::Stage::kWeights) +
                                 of_stage(profile, runtime::Stage::kTarget));
      profile = {};
    });
    workspace_.profile = nullptr;
  }

  StepTimes times() const {
    StepTimes times = samples_.times();
    for (std::size_t i = 0; i < kTimedStages.size(); ++i) times.stages[i] = stages_[i].quantile(0.5);
    return times;
  }

 private:
  // Positions are not needed, and so neither read nor kept.
  static runtime::LoadedScene load(SceneConfig config) {
    config.trajectory.reset();
    return runtime::load_run(config);
  }

  template <typename Add>
  void round(std::int64_t most, Add add) {
    runtime::State state = loaded_.start;
    std::optional<runtime::World> world;
    if (loaded_.full) {
      world.emplace(runtime::ContactLaw{});
      world->add({loaded_.model.get(), &loaded_.scene, nullptr, loaded_.full.get()}, state);
    }
    const Timer total;
    for (std::int64_t i = 0; i < most && (i < kFewestSteps || total.seconds() < kRoundSeconds); ++i) {
      const Timer timer;
      if (world)
        world->step(1);
      else
        runtime::step(*loaded_.model, loaded_.scene, state, workspace_);
      add(timer.seconds());
    }
  }

  runtime::LoadedScene loaded_;
  std::int64_t steps_;
  runtime::Workspace workspace_;
  StepSamples samples_;
  std::array<Samples, kTimedStages.size()> stages_;
};

}  // namespace

std::vector<StepTimes> time_steps(const std::vector<SceneConfig>& scenes, const TimingConfig& config) {
  std::vector<TimedScene> timed;
  timed.reserve(scenes.size());
  for (const SceneConfig& scene : scenes) timed.emplace_back(scene, std::min(config.steps, scene.steps));
  for (TimedScene& scene : timed) scene.warm_up();
  Progress progress("timing", config.rounds * std::ssize(timed));
  for (int round = 0; round < config.rounds; ++round)
    for (std::size_t i = 0; i < timed.size(); ++i) {
      timed[(i + static_cast<std::size_t>(round)) % timed.size()].measure();  // none is always the first
      progress.advance();
    }
  std::vector<StepTimes> times;
  for (const TimedScene& scene : timed) times.push_back(scene.times());
  return times;
}

}  // namespace exmat::precompute
