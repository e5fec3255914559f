#include <algorithm>
#include <cinttypes>
#include <new>

#include "common/core/fnv_hash.h"
#include "common/core/thread_team.h"
#include "common/core/timer.h"
#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/body_steps.h"
#include "runtime/api/world_handle.h"
#include "runtime/scene/state_hash.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

void add(const WorldReport& step, exmat_world_report& sum) noexcept {
  ++sum.steps;
  sum.newton_iterations += step.newton_iterations;
  sum.unconverged_islands += step.unconverged_islands;
  sum.pairs = step.pairs;
  sum.touching_pairs = step.touching_pairs;
  sum.islands = step.islands;
  sum.largest_island = std::max<std::int64_t>(sum.largest_island, step.largest_island);
  sum.asleep = step.asleep;
  sum.divided_islands += step.divided_islands;
}

/// A body that the last step left because of a number that is not finite; null: none.
const exmat_world::Member* failed_of(const exmat_world& world) noexcept {
  const auto failed = std::ranges::find_if(world.members, [](const auto& member) { return non_finite(*member.body); });
  return failed != world.members.end() ? &*failed : nullptr;
}

void keep_contacts(exmat_world& world) {
  std::vector<BodyTouch> touches;
  world.world.read_touches(touches);
  world.contacts.clear();
  for (const BodyTouch& touch : touches) {
    exmat_body_contact& contact = world.contacts.emplace_back();
    contact.body = world.members[static_cast<std::size_t>(touch.body)].id;
    contact.other = world.members[static_cast<std::size_t>(touch.other)].id;
    contact.vertex = touch.vertex;
    std::copy_n(touch.position.data(), 3, contact.position);
    std::copy_n(touch.normal.data(), 3, contact.normal);
    std::copy_n(touch.force.data(), 3, contact.force);
    contact.depth = touch.depth;
  }
}

/// All bodies of a world for one caller, or none of them.
class Held {
 public:
  explicit Held(exmat_world& world) noexcept : world_(world) {
    while (count_ < world.members.size() && acquire(*world.members[count_].body)) ++count_;
  }
  ~Held() {
    for (std::size_t i = 0; i < count_; ++i) release(*world_.members[i].body);
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  bool all() const noexcept { return count_ == world_.members.size(); }

 private:
  exmat_world& world_;
  std::size_t count_ = 0;
};

/// Records the contacts of each body.
class ContactRecorder final : public StepObserver {
 public:
  explicit ContactRecorder(exmat_world& world) noexcept : world_(world) {}

  void after_step(int place, const StepReport& report, const Workspace& scratch) noexcept override {
    exmat_body& body = *world_.members[static_cast<std::size_t>(place)].body;
    if ((report.status & kStepNonFinite) == 0) body.contacts.add(report, body.model(), body.state, scratch);
  }

 private:
  exmat_world& world_;
};

exmat_world_report advance(exmat_world& world, std::int64_t steps, int threads) {
  const Timer timer;
  exmat_world_report report{};
  ContactRecorder recorder(world);
  world.profile = {};
  world.world.set_profile(world.profiled ? &world.profile : nullptr);
  for (const auto& member : world.members) begin_steps(*member.body);
  world.touches.begin(world);
  while (report.steps < steps && failed_of(world) == nullptr) {
    for (const auto& member : world.members) {
      apply_keys(*member.body);
      choose_weights(*member.body);
    }
    add(world.world.step(threads, &recorder), report);
    for (int i = 0; i < world.world.count(); ++i)
      add_step(world.world.report(i), *world.members[static_cast<std::size_t>(i)].body);
  }
  if (failed_of(world) != nullptr) --report.steps;
  for (const auto& member : world.members) world.steps = std::max(world.steps, member.body->state.step);
  keep_contacts(world);
  world.touches.end(world);
  for (const auto& member : world.members) measure_lost_work(*member.body);
  report.seconds = timer.seconds();
  for (const auto& member : world.members) member.body->report.seconds = report.seconds;
  return report;
}

}  // namespace

exmat_status exmat_body_step(exmat_body* body, std::int64_t steps, exmat_report* report) noexcept {
  EXMAT_REQUIRE(body);
  if (steps < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: steps = %" PRId64 ": expected >= 0", __func__, steps);
  if (report != nullptr)
    if (const exmat_status status = check_size(__func__, report->size, kReportSizes)) return status;
  if (!body->own)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: the body is in a world, whose step() takes it along", __func__);
  if (!acquire(*body)) return fail(EXMAT_INVALID_ARGUMENT, "%s: another thread steps this body", __func__);
  const exmat_status stepped = guarded(__func__, [&] { advance(*body->own, steps, 1); });
  if (report != nullptr) give(body->report, report->size, report);
  const exmat_status status = non_finite(*body) ? fail_non_finite(__func__, "body", *body) : stepped;
  release(*body);
  return status;
}

exmat_status exmat_world_set_profiled(exmat_world* world, std::int32_t profiled) noexcept {
  EXMAT_REQUIRE(world);
  world->profiled = profiled != 0;
  return EXMAT_OK;
}

exmat_status exmat_world_read_profile(const exmat_world* world, exmat_profile* profile) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(profile);
  if (const exmat_status status = check_size(__func__, profile->size, kProfileSizes)) return status;
  const auto of_bodies = [&](Stage stage) { return world->profile.bodies.seconds[static_cast<std::size_t>(stage)]; };
  const auto of_world = [&](WorldStage stage) { return world->profile.seconds[static_cast<std::size_t>(stage)]; };
  give(exmat_profile{0, of_bodies(Stage::kWeights), of_bodies(Stage::kTarget), of_bodies(Stage::kInternalForce),
                     of_bodies(Stage::kSolve), of_bodies(Stage::kContact), of_world(WorldStage::kBroadPhase),
                     of_world(WorldStage::kCandidates), of_world(WorldStage::kSingleBodies),
                     of_world(WorldStage::kIslands)},
       profile->size, profile);
  return EXMAT_OK;
}

void exmat_set_scheduler(exmat_run_tasks run, void* user) noexcept { set_scheduler({run, user}); }

exmat_status exmat_world_step(exmat_world* world, std::int64_t steps, std::int32_t threads,
                              exmat_world_report* report) noexcept {
  EXMAT_REQUIRE(world);
  if (steps < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: steps = %" PRId64 ": expected >= 0", __func__, steps);
  if (threads < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: threads = %" PRId32 ": expected >= 0", __func__, threads);
  if (report != nullptr)
    if (const exmat_status status = check_size(__func__, report->size, kWorldReportSizes)) return status;
  const Held held(*world);
  if (!held.all()) return fail(EXMAT_INVALID_ARGUMENT, "%s: another thread steps a body of the world", __func__);
  const std::int64_t most = std::max<std::int64_t>(1, std::ssize(world->members));
  const std::int64_t processors = processor_count();
  int used = static_cast<int>(std::min({threads > 0 ? threads : processors, processors, most}));
  try {
    world->world.prepare(used);
  } catch (const std::bad_alloc&) {
    used = 1;  // for which there is scratch since the bodies were added
  }
  const exmat_status status = guarded(__func__, [&] {
    const exmat_world_report did = advance(*world, steps, used);
    if (report != nullptr) give(did, report->size, report);
  });
  if (status != EXMAT_OK) return status;
  const exmat_world::Member* const failed = failed_of(*world);
  if (failed == nullptr) return EXMAT_OK;
  char which[40];
  std::snprintf(which, sizeof which, "body %" PRId64, failed->id);
  return fail_non_finite(__func__, which, *failed->body);
}

std::int64_t exmat_world_contacts(const exmat_world* world) noexcept {
  return world != nullptr ? std::ssize(world->contacts) : -1;
}

exmat_status exmat_world_read_contacts(const exmat_world* world, exmat_body_contact* contacts, std::int64_t count,
                                       std::size_t size) noexcept {
  EXMAT_REQUIRE(world);
  if (count > 0) EXMAT_REQUIRE(contacts);
  return give_list(__func__, world->contacts, kBodyContactSizes, contacts, count, size);
}

std::int64_t exmat_world_touches(const exmat_world* world) noexcept {
  return world != nullptr ? std::ssize(world->touches.changes()) : -1;
}

exmat_status exmat_world_read_touches(const exmat_world* world, exmat_touch* touches, std::int64_t count,
                                      std::size_t size) noexcept {
  EXMAT_REQUIRE(world);
  if (count > 0) EXMAT_REQUIRE(touches);
  return give_list(__func__, world->touches.changes(), kTouchSizes, touches, count, size);
}

exmat_status exmat_world_read_energies(const exmat_world* world, exmat_energies* result) noexcept {
  EXMAT_REQUIRE(world);
  if (result == nullptr) return null_argument(__func__, "energies");
  if (const exmat_status status = check_size(__func__, result->size, kEnergiesSizes)) return status;
  const Energies now = world->world.energies();
  give(exmat_energies{0, now.kinetic, now.elastic, now.potential, now.contact}, result->size, result);
  return EXMAT_OK;
}

exmat_status exmat_world_hash(const exmat_world* world, std::uint64_t* hash) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(hash);
  FnvHash sum;
  for (const auto& member : world->members) add_to_hash(member.body->model(), member.body->state, sum);
  *hash = sum.value();
  return EXMAT_OK;
}
