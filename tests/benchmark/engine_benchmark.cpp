#include <exmat/exmat.hpp>

#include "common/bundle/bundle.h"
#include "runtime/sim/step/reach.h"
#include "runtime/sim/step/stepper.h"
#include "tests/benchmark/models.h"
#include "tests/benchmark/register.h"
#include "tests/support/temporary_folder.h"

namespace exmat::benchmarks {
namespace {

constexpr int kBodies = 100, kTouching = 8;

/// Bodies that fall side by side, r = 20, some of which have reached a floor.
struct Crowd {
  Crowd() {
    ReducedModel reduced = bar_model(20, 30, /*free=*/true);
    reduced.contact = test::surface_contact(reduced);
    write_bundle(reduced, folder / "bar.h5");
    exmat_settings settings = default_settings();
    settings.time_step = 1.0 / 240;
    settings.gravity[2] = -9.81;
    settings.use_contact = 1;
    settings.use_examples = 1;
    settings.example_stiffness = 100;
    const Model model(folder / "bar.h5", settings);
    exmat_contact_law law = default_contact_law();
    law.apart = 1;
    world = World(law);
    world.add_obstacle(default_obstacle());
    for (int i = 0; i < kBodies; ++i) {
      Body body(model);
      exmat_motion motion = body.motion();
      motion.position[2] += i < kTouching ? 0 : 10;
      body.set_motion(motion);
      world.add(std::move(body));
    }
    world.step(20, 1);
    world.save(snapshot);
  }

  test::TemporaryFolder folder;
  World world;
  std::vector<std::uint64_t> snapshot;
};

Crowd& crowd() {
  static Crowd crowd;
  return crowd;
}

/// Four examples that pull two points of a clamped bar, before each step of it.
void time_reach(::benchmark::State& state, int modes, Target target) {
  const auto model = prepare(bar_model(modes, 30), target, /*polynomial=*/false);
  runtime::StepScene scene = swing(*model, target);
  runtime::State body = runtime::make_state(*model);
  runtime::Workspace workspace(*model, scene);
  const Eigen::Index examples = model->example_count();
  runtime::ReachTargets targets;
  targets.rest = VertexArray::Random(2, 3);
  targets.basis_rows = RowMatrix::Random(6, model->modes());
  targets.places = Eigen::VectorXd::Random(6);
  targets.lowest = Eigen::VectorXd::Zero(examples);
  targets.highest = Eigen::VectorXd::Ones(examples);
  runtime::step(*model, scene, body, workspace);
  runtime::Reach reach(*model, scene, body, targets);
  for (auto _ : state) {
    reach.choose_weights(scene);
    state.PauseTiming();
    runtime::step(*model, scene, body, workspace);
    state.ResumeTiming();
  }
}

}  // namespace

void register_engines() {
  add("engine/step/100", [](::benchmark::State& state) {
    for (auto _ : state) crowd().world.step(1, 1);
  })->Iterations(200);
  add("engine/save/100", [](::benchmark::State& state) {
    Crowd& own = crowd();
    for (auto _ : state) own.world.save(own.snapshot);
    state.counters["bytes"] = static_cast<double>(exmat_world_snapshot_size(own.world.get()));
  });
  add("engine/restore/100", [](::benchmark::State& state) {
    Crowd& own = crowd();
    own.world.save(own.snapshot);
    for (auto _ : state) own.world.restore(own.snapshot);
  });
  for (const int modes : {20, 30})
    for (const Target target : {Target::kTable, Target::kSolve})
      add("engine/reach/r" + std::to_string(modes) + "/" + name_of(target), [=](::benchmark::State& state) {
        time_reach(state, modes, target);
      })->Iterations(2000);
}

}  // namespace exmat::benchmarks
