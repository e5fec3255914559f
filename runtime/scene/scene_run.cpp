#include "runtime/scene/scene_run.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <span>
#include <utility>

#include "common/core/command_files.h"
#include "common/core/progress.h"
#include "common/core/timer.h"
#include "runtime/output/trajectory.h"
#include "runtime/scene/attachment_loader.h"
#include "runtime/scene/contact_load.h"
#include "runtime/scene/state_file.h"
#include "runtime/sim/step/contact_step.h"

namespace exmat::runtime {
namespace {

TrajectoryInfo trajectory_info(const LoadedScene& kind, std::size_t number, const SceneConfig& scene,
                               const WorldConfig& config) {
  const auto absolute = [](const std::filesystem::path& file) {
    return file.is_absolute() ? file : current_folder() / file;
  };
  const std::filesystem::path folder = absolute(*config.trajectory).parent_path();
  const std::string bundle = std::filesystem::proximate(absolute(scene.bundle), folder).generic_string();
  TrajectoryInfo info{std::string(name_of(scene.integrator)), bundle, config.time_step,
                      1 + config.steps / config.every};
  for (std::size_t i = 0; i < kind.scene.examples.size(); ++i) {
    const ExampleModel& examples = kind.model->examples[i];
    if (acts(kind.scene.examples[i])) info.weights.push_back({i, examples.region, examples.weights.examples()});
  }
  info.attachments = std::ssize(attachments_of(kind, number));
  return info;
}

std::unique_ptr<TrajectoryWriter> open_trajectory(const LoadedWorld& loaded, const WorldConfig& config) {
  if (!config.trajectory) return nullptr;
  std::vector<NamedBody> bodies;
  for (const LoadedBody& body : loaded.bodies) {
    const LoadedScene& kind = loaded.kinds[body.kind].loaded;
    bodies.push_back({body.name, kind.data, *kind.model->frame,
                      trajectory_info(kind, body.number, config.bodies[body.kind].scene, config), kind.full.get()});
    if (!config.is_list) break;
  }
  return std::make_unique<TrajectoryWriter>(*config.trajectory, bodies);
}

/// Finds the contacts of each kind when they press a body most.
class ContactKeeper final : public StepObserver {
 public:
  explicit ContactKeeper(const Bodies& bodies) : bodies_(bodies), hardest_(bodies.loaded().kinds.size()) {}

  /// Whatever the order of bodies is, the first of those that are pressed alike is found.
  void after_step(int body, const StepReport& report, const Workspace& scratch) noexcept override {
    const double force = report.contact_force.norm();
    if (!(force > 0)) return;
    const LoadedWorld& loaded = bodies_.loaded();
    const std::size_t kind = loaded.bodies[static_cast<std::size_t>(body)].kind;
    const std::scoped_lock lock(mutex_);
    HardestContact& hardest = hardest_[kind];
    const bool is_first = is_new_ && force == hardest.force && body < hardest.body;
    if (!(force > hardest.force) && !is_first) return;
    is_new_ = true;
    hardest = {body, force, bodies_.world().state(body).time, std::move(hardest.load)};
    hardest.load.setZero(3 * loaded.kinds[kind].loaded.summary.vertices);
    add_contact_load(bodies_.world().model(body), bodies_.world().state(body), scratch, hardest.load);
    changed_.push_back(kind);
  }

  /// After each step of all bodies: what other bodies press by.
  void add_touches() {
    is_new_ = false;
    if (changed_.empty()) return;
    const World& world = bodies_.world();
    world.read_touches(touches_);
    std::ranges::sort(changed_);
    changed_.erase(std::unique(changed_.begin(), changed_.end()), changed_.end());
    for (const std::size_t kind : changed_) {
      HardestContact& hardest = hardest_[kind];
      const Eigen::Matrix3d to_own =
          world.model(hardest.body).frame->placement(world.state(hardest.body).frame).rotation.transpose();
      for (const BodyTouch& touch : touches_)
        if (touch.body == hardest.body)
          hardest.load.segment<3>(3 * static_cast<Eigen::Index>(touch.vertex)) += to_own * touch.force;
    }
    changed_.clear();
  }

  std::vector<HardestContact> hardest() && { return std::move(hardest_); }

 private:
  const Bodies& bodies_;
  std::mutex mutex_;
  std::vector<HardestContact> hardest_;
  std::vector<std::size_t> changed_;
  std::vector<BodyTouch> touches_;
  bool is_new_ = false;
};

/// Finds attachments that break, step by step.
class BreakFinder {
 public:
  explicit BreakFinder(const Bodies& bodies) : bodies_(bodies) {
    for (int i = 0; i < bodies.count(); ++i)
      for (const Attachment& attachment : bodies.world().state(i).attachments)
        if (attachment.holds()) holding_.push_back({i, attachment.id});
  }
  /// Those that broke in the last step.
  void find(std::vector<BrokenAttachment>& broken) {
    std::erase_if(holding_, [&](const std::pair<int, std::int64_t>& held) {
      const State& state = bodies_.world().state(held.first);
      const Attachment& attachment = state.attachments[static_cast<std::size_t>(held.second)];
      if (attachment.holds()) return false;
      const LoadedBody& body = bodies_.loaded().bodies[static_cast<std::size_t>(held.first)];
      const auto own = attachments_of(bodies_.loaded().kinds[body.kind].loaded, body.number);
      broken.push_back(
          {held.first, own[static_cast<std::size_t>(held.second)]->place, state.time, attachment.force.norm()});
      return true;
    });
  }

 private:
  const Bodies& bodies_;
  std::vector<std::pair<int, std::int64_t>> holding_;  // body and attachment
};

double deepest_of(const World& world) {
  double deepest = 0;
  for (const HeldPair& pair : world.held())
    for (const auto& side : pair.held)
      for (const HeldBodyContact& contact : side) deepest = std::max(deepest, -contact.gap);
  return deepest;
}

void add(const WorldReport& step, const World& world, double seconds, RunSummary& summary) {
  const auto bodies = static_cast<double>(world.count());
  std::int64_t newton = 0, target = 0;
  for (int i = 0; i < world.count(); ++i) {
    const StepReport& report = world.report(i);
    newton += report.newton_iterations;
    target += report.target_iterations;
    summary.projections += report.projections;
    if ((report.status & kStepUnconverged) != 0) ++summary.unconverged_steps;
    if ((report.status & kStepDivided) != 0) ++summary.divided_steps;
  }
  ++summary.steps;
  summary.slept_steps += step.asleep;
  summary.step_seconds.add(seconds / bodies);
  summary.newton_iterations.add(static_cast<double>(newton) / bodies);
  summary.target_iterations.add(static_cast<double>(target) / bodies);
  summary.touching_pairs.add(step.touching_pairs);
  summary.most_pairs = std::max(summary.most_pairs, step.touching_pairs);
  summary.largest_island = std::max(summary.largest_island, step.largest_island);
  summary.unconverged_islands += step.unconverged_islands;
}

/// `whole` and `output` [s]: of the step of all bodies and of the frame after it.
void add(const WorldProfile& profile, double whole, double output, int bodies, StageSamples& stages) {
  for (std::size_t stage = 0; stage < kStageNames.size(); ++stage) {
    const bool is_output = stage == static_cast<std::size_t>(Stage::kOutput);
    stages.of_bodies[stage].add(is_output ? output : profile.bodies.seconds[stage] / bodies);
  }
  double staged = 0;
  for (std::size_t stage = 0; stage < kWorldStageNames.size(); ++stage) {
    if (stage == static_cast<std::size_t>(WorldStage::kOther)) continue;
    staged += profile.seconds[stage];
    stages.of_world[stage].add(profile.seconds[stage] / bodies);
  }
  stages.of_world[static_cast<std::size_t>(WorldStage::kOther)].add(std::max(0.0, whole - staged) / bodies);
}

RunSummary empty_summary(const WorldConfig& config, const Bodies& bodies, bool profiled) {
  RunSummary summary;
  summary.bodies = bodies.count();
  summary.threads = bodies.threads();
  summary.step_seconds = summary.newton_iterations = summary.target_iterations = summary.touching_pairs =
      Samples(config.steps);
  summary.start = bodies.world().energies();
  if (!profiled) return summary;
  StageSamples& stages = summary.stage_seconds.emplace();
  stages.of_bodies.fill(Samples(config.steps));
  stages.of_world.fill(Samples(config.steps));
  return summary;
}

void keep_deeper(const StartOverlap& found, double least, std::optional<StartOverlap>& deepest) {
  if (found.depth > least && (!deepest || found.depth > deepest->depth)) deepest = found;
}

/// Before the first step: vertices deeper than `least` [m] in obstacles, where these begin.
void find_in_obstacles(World& world, double least, std::optional<StartOverlap>& deepest) {
  for (int body = 0; body < world.count(); ++body) {
    const StepScene& scene = world.scene(body);
    if (!touches(world.model(body), scene)) continue;
    const ContactSet& set = *world.model(body).contact;
    const BodyPose pose = pose_of(world.model(body), world.state(body));
    ContactWorkspace& found = world.scratch(body).near->contact;
    NearPlanes unknown(set.vertices(), set.modes(), scene.obstacles.size());
    set.gather(scene.obstacles, world.state(body).time, 0, pose, 0, unknown, found);
    for (const ContactCandidate& candidate : std::span(found.candidates).first(found.candidate_count)) {
      const Eigen::Vector3d point = pose.position + set.world_arm(candidate.vertex, pose);
      const double gap =
          found.obstacles[static_cast<std::size_t>(candidate.obstacle)].nearest_surface_point(point).distance;
      keep_deeper({body, candidate.obstacle, true, set.object_vertex(candidate.vertex), -gap}, least, deepest);
    }
  }
}

/// Vertices deeper than `least` [m] in other bodies: by a step of bodies of its own that lets out next to nothing.
void find_in_bodies(const LoadedWorld& loaded, WorldConfig config, double least, std::optional<StartOverlap>& deepest) {
  config.contact.release = 1e-6 * kRelease;
  Bodies bodies(loaded, config);
  bodies.step();
  const World& world = bodies.world();
  for (const HeldPair& pair : world.held())
    for (const int side : {0, 1})
      for (const HeldBodyContact& held : pair.held[static_cast<std::size_t>(side)]) {
        const int body = side == 0 ? pair.first : pair.second, other = side == 0 ? pair.second : pair.first;
        const int vertex = world.model(body).contact->object_vertex(held.vertex);
        keep_deeper({body, other, false, vertex, held.overlap}, least, deepest);
      }
}

}  // namespace

RunSummary run(const LoadedWorld& loaded, const WorldConfig& config, const RunOptions& options) {
  Bodies bodies(loaded, config);
  World& world = bodies.world();
  if (options.from_state) bodies.take_up(read_state(*options.from_state, loaded, config));
  RunSummary summary = empty_summary(config, bodies, options.profiled);
  const double one_step = config.time_step * std::min(config.contact.release, kRelease);  // such depths are contacts
  if (!options.from_state) find_in_obstacles(world, one_step, summary.overlap);
  const auto trajectory = open_trajectory(loaded, config);
  const auto append = [&](double seconds) {
    for (std::size_t i = 0; i < trajectory->bodies(); ++i) {
      const auto body = static_cast<int>(i);
      trajectory->append(i, world.state(body), world.energies(body), seconds);
    }
  };
  if (trajectory) append(0);
  ContactKeeper contacts(bodies);
  BreakFinder breaks(bodies);
  BodiesMemory before;  // the step, for the state file of one that fails
  Progress progress("steps", config.steps);
  while (summary.steps < config.steps) {
    if (options.dump_state) bodies.remember(before);
    WorldProfile profile;
    world.set_profile(options.profiled ? &profile : nullptr);
    const Timer timer;
    const WorldReport report = bodies.step(options.keeps_contacts ? &contacts : nullptr);
    const double seconds = timer.seconds();
    if (options.dump_state && !bodies.is_finite()) write_state(before, loaded, config, *options.dump_state);
    bodies.require_finite();
    if (options.keeps_contacts) contacts.add_touches();
    add(report, world, seconds, summary);
    breaks.find(summary.broken);
    // One that lets out faster may have left nothing.
    if (summary.steps == 1 && !options.from_state && (!world.held().empty() || config.contact.release > kRelease))
      find_in_bodies(loaded, config, one_step, summary.overlap);
    const Timer output;
    const bool written = trajectory && summary.steps % config.every == 0;
    if (written) append(seconds / world.count());
    if (options.profiled) add(profile, seconds, written ? output.seconds() : 0, world.count(), *summary.stage_seconds);
    progress.advance();
  }
  world.set_profile(nullptr);
  if (trajectory) {
    trajectory->finish();
    summary.largest_displacement = trajectory->largest_displacement();
    summary.origin = trajectory->origin();
  }
  if (options.dump_state) {
    bodies.remember(before);
    write_state(before, loaded, config, *options.dump_state);
  }
  summary.simulated_seconds = static_cast<double>(config.steps) * config.time_step;
  summary.end = world.energies();
  summary.deepest = deepest_of(world);
  summary.farthest_reach = bodies.farthest_reach();
  if (options.keeps_contacts) summary.hardest_contacts = std::move(contacts).hardest();
  summary.state_hash = bodies.hash();
  return summary;
}

}  // namespace exmat::runtime
