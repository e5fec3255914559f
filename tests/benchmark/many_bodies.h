#pragma once

#include <numeric>
#include <vector>

#include "runtime/scene/step_work.h"
#include "runtime/sim/world/world.h"

namespace exmat::benchmarks {

/// Bodies of one model that touch nothing.
class ManyBodies {
 public:
  ManyBodies(const runtime::Model& model, const runtime::StepScene& scene, const runtime::State& start, int count)
      : model_(model),
        scene_(scene),
        start_(start),
        world_(std::vector(static_cast<std::size_t>(count), runtime::WorldBodyStart{{&model, &scene, nullptr}, start}),
               {1, 0, 0}) {}

  runtime::World& world() { return world_; }
  void restart() {
    for (int i = 0; i < world_.count(); ++i) world_.state(i) = start_;
  }

  /// Means of a step of a body over so many steps from here on.
  struct Work {
    double flops = 0, newton_iterations = 0;
  };
  Work work_of(int steps) {
    runtime::WorldProfile profile;
    runtime::StepWork work;
    Work mean;
    world_.set_profile(&profile);
    for (int step = 0; step < steps; ++step) {
      world_.step(1);
      for (int i = 0; i < world_.count(); ++i) {
        work += runtime::step_work(model_, scene_, world_.report(i));
        mean.newton_iterations += world_.report(i).newton_iterations;
      }
    }
    world_.set_profile(nullptr);
    const auto& stages = profile.bodies.flops;
    const double steps_of_bodies = static_cast<double>(steps) * world_.count();
    mean.newton_iterations /= steps_of_bodies;
    mean.flops = (std::accumulate(stages.begin(), stages.end(), 0.0) + work.weights_flops + work.target_flops +
                  work.other_flops) /
                 steps_of_bodies;
    return mean;
  }

 private:
  const runtime::Model& model_;
  const runtime::StepScene& scene_;
  runtime::State start_;
  runtime::World world_;
};

}  // namespace exmat::benchmarks
