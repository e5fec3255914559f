#include <algorithm>
#include <fmt/format.h>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/loading.h"
#include "runtime/api/reading.h"
#include "runtime/api/world_handle.h"
#include "runtime/scene/world_loader.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

// Worlds and the bodies that are in them.

namespace {

const exmat_world::Member* member_of(const exmat_world& world, std::int64_t id) noexcept {
  const auto found = std::ranges::lower_bound(world.members, id, {}, &exmat_world::Member::id);
  return found != world.members.end() && found->id == id ? &*found : nullptr;
}

exmat_contact_law default_law() noexcept {
  const BodyContactConfig defaults;
  return {sizeof(exmat_contact_law), defaults.stiffness, defaults.damping, defaults.friction,
          defaults.self ? 1 : 0,     /*apart=*/0,        defaults.release};
}

exmat_contact_law own_law() noexcept {
  exmat_contact_law law = default_law();
  law.apart = 1;
  return law;
}

void require_law(const exmat_contact_law& given) {
  const auto is_positive = [](double number) { return number > 0 && std::isfinite(number); };
  contact_stiffness(given.stiffness, "law.stiffness");
  if (!is_positive(given.release))
    throw InvalidArgument(fmt::format("law.release = {:g}: expected a finite number above 0", given.release));
  for (const auto& [number, name] : {std::pair(given.damping, "damping"), std::pair(given.friction, "friction")})
    if (number != 0 && !is_positive(number))
      throw InvalidArgument(fmt::format("law.{} = {:g}: expected a finite number >= 0", name, number));
  for (const auto& [number, name] : {std::pair(given.self, "self"), std::pair(given.apart, "apart")})
    if (number != 0 && number != 1) throw InvalidArgument(fmt::format("law.{} = {}: expected 0 or 1", name, number));
  if (given.self == 1 && given.apart == 1)
    throw InvalidArgument("law.self = 1: expected 0 with law.apart = 1: bodies apart do not touch themselves");
}

}  // namespace

exmat_world::exmat_world(const exmat_contact_law& its_law) : law(its_law), world(contact_law_of(its_law)) {}

exmat_world::~exmat_world() {
  if (is_own) return;
  for (const Member& member : members) delete member.body;
}

namespace exmat::runtime {

double contact_stiffness(double number, const char* name) {
  constexpr double kStiffest = 1e15;  // [N/m^3]
  if (number > 0 && number <= kStiffest) return number;
  throw InvalidArgument(
      fmt::format("{} = {:g}: expected a number above 0, of at most {:g}; steel that is 1 mm thick has 2e14 N/m^3",
                  name, number, kStiffest));
}

ContactLaw contact_law_of(const exmat_contact_law& law) noexcept {
  return {law.stiffness, law.damping, law.friction, law.release};
}

int place_of(const exmat_body& body) noexcept {
  const auto& members = body.world->members;
  return static_cast<int>(std::ranges::lower_bound(members, body.id, {}, &exmat_world::Member::id) - members.begin());
}

double time_of(const exmat_world& world) noexcept {
  return world.members.empty() ? 0 : static_cast<double>(world.steps) * world.members.front().body->scene.time_step;
}

void was_put(exmat_body& body) noexcept {
  exmat_world& world = *body.world;
  world.world.forget(place_of(body));
  std::erase_if(world.contacts,
                [&](const exmat_body_contact& contact) { return contact.body == body.id || contact.other == body.id; });
  world.touches.forget(body.id);
}

void follow_times(exmat_world& world, double time_before) noexcept {
  for (const exmat_world::Member& member : world.members) world.steps = member.body->state.step;
  const double now = time_of(world);
  for (exmat_world::HostedObstacle& hosted : world.obstacles)
    if (hosted.hosted)
      hosted.obstacle->motion = RigidMotion::going_on(now, hosted.obstacle->motion.sample(time_before));
}

void follow_time(exmat_body& body, double time_before) noexcept {
  if (body.own) return follow_times(*body.own, time_before);
  body.state.step = body.world->steps;
  body.state.time = static_cast<double>(body.state.step) * body.scene.time_step;
}

void leave_world(exmat_body& body) noexcept {
  was_put(body);
  exmat_world& world = *body.world;
  const int place = place_of(body);
  world.world.remove(place);
  std::erase_if(body.start.attachments, [](const Attachment& own) { return own.other.has_value(); });
  for (const exmat_world::Member& member : world.members) forget_body(place, member.body->start.attachments);
  world.members.erase(world.members.begin() + place);
  body.world = nullptr;
}

}  // namespace exmat::runtime

namespace {

/// Adds a body that is in no world. Where it throws, it is in none, and the world is as it was.
void join(exmat_world& world, const std::shared_ptr<const TouchingSurface>& surface, std::string name,
          exmat_body& body) {
  world.members.reserve(world.members.size() + 1);
  world.world.add({&body.model(), &body.scene, surface, body.full()}, body.state);
  world.members.push_back({world.next_id, std::move(name), &body});
  body.world = &world;
  body.id = world.next_id++;
  if (world.members.size() == 1) {
    world.steps = body.state.step;
  } else {
    body.state.step = world.steps;
    body.state.time = time_of(world);
  }
  try {
    meet_obstacles(body);
  } catch (...) {
    leave_world(body);
    throw;
  }
}

/// The surface of a model's bodies, made once in a world. Reads the bundle. Null where bodies are apart.
std::shared_ptr<const TouchingSurface> surface_of(exmat_world& world, const std::shared_ptr<const Source>& source) {
  if (world.law.apart == 1) return nullptr;
  if (const auto known = world.surfaces.find(source); known != world.surfaces.end()) return known->second;
  const std::lock_guard lock(reading());
  auto surface = touching_surface(*source->loaded.model, read_rest(*source, /*basis=*/true), world.law.self == 1);
  return world.surfaces.emplace(source, std::move(surface)).first->second;
}

void check_joins(const exmat_world& world, const exmat_body& body) {
  if (world.is_own) throw InvalidArgument("world: expected one that was created, found a body's own");
  if (!body.own) throw InvalidArgument("the body is in a world already");
  if (world.law.apart == 0 && !body.model().contact)
    throw InvalidArgument("the model knows no contact: expected settings with use_contact, or a scene with obstacles");
  if (world.members.empty()) return;
  const double step = world.members.front().body->scene.time_step;
  if (body.scene.time_step != step)
    throw InvalidArgument(
        fmt::format("the body's time step is {:g} s: expected that of the world, {:g} s", body.scene.time_step, step));
}

}  // namespace

namespace exmat::runtime {

std::unique_ptr<exmat_world> load_world(const WorldConfig& config) {
  LoadedWorld loaded = load_world_run(config);
  const BodyContactConfig& contact = config.contact;
  auto world = std::make_unique<exmat_world>(exmat_contact_law{sizeof(exmat_contact_law), contact.stiffness,
                                                               contact.damping, contact.friction, contact.self ? 1 : 0,
                                                               config.is_list ? 0 : 1, contact.release});
  world->world.set_full_bodies(config.full_bodies);
  take_obstacles(loaded.obstacles, *world);
  std::vector<State> starts = starts_of(loaded);
  std::vector<std::shared_ptr<const Source>> sources;
  for (std::size_t i = 0; i < loaded.kinds.size(); ++i) {
    LoadedKind& kind = loaded.kinds[i];
    kind.loaded.data = {};
    sources.push_back(std::make_shared<Source>(Source{bundle_of(config.bodies[i].scene), std::move(kind.loaded)}));
    if (kind.surface) world->surfaces[sources.back()] = kind.surface;
  }
  for (std::size_t i = 0; i < loaded.bodies.size(); ++i) {
    LoadedBody& body = loaded.bodies[i];
    const std::shared_ptr<const Source>& source = sources[body.kind];
    auto made = std::make_unique<exmat_body>(source, std::move(starts[i]));
    join(*world, loaded.kinds[body.kind].surface, std::move(body.name), *made);
    hold_by_copies(loaded.obstacles, *made);
    static_cast<void>(made.release());
    world->members.back().kind = static_cast<std::int64_t>(body.kind);
  }
  return world;
}

void join_own(exmat_body& body) {
  auto world = std::make_unique<exmat_world>(own_law());
  world->is_own = true;
  take_obstacles(body.source->loaded.scene.obstacles, *world);
  join(*world, nullptr, "", body);
  hold_by_copies(body.source->loaded.scene.obstacles, body);
  body.own = std::move(world);
}

}  // namespace exmat::runtime

exmat_status exmat_contact_law_default(exmat_contact_law* law, std::size_t size) noexcept {
  EXMAT_REQUIRE(law);
  if (const exmat_status status = check_size(__func__, size, kContactLawSizes)) return status;
  give(default_law(), size, law);
  return EXMAT_OK;
}

exmat_status exmat_world_create(const exmat_contact_law* law, exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  if (law != nullptr)
    if (const exmat_status status = check_size(__func__, law->size, kContactLawSizes)) return status;
  return guarded(__func__, [&] {
    const exmat_contact_law given = law != nullptr ? completed(*law, default_law()) : default_law();
    require_law(given);
    *world = new exmat_world(given);
  });
}

void exmat_world_destroy(exmat_world* world) noexcept {
  if (world != nullptr && !world->is_own) delete world;
}

exmat_world* exmat_body_world(const exmat_body* body) noexcept { return body != nullptr ? body->world : nullptr; }

exmat_status exmat_world_reset(exmat_world* world) noexcept {
  EXMAT_REQUIRE(world);
  const double time = time_of(*world);
  for (const exmat_world::Member& member : world->members) put_to_start(*member.body);
  follow_times(*world, time);
  return EXMAT_OK;
}

double exmat_world_time(const exmat_world* world) noexcept { return world != nullptr ? time_of(*world) : -1; }

exmat_status exmat_world_set_contact_law(exmat_world* world, const exmat_contact_law* law) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(law);
  if (const exmat_status status = check_size(__func__, law->size, kContactLawSizes)) return status;
  return guarded(__func__, [&] {
    exmat_contact_law given = completed(*law, world->law);
    given.self = world->law.self;
    given.apart = world->law.apart;
    require_law(given);
    world->law = given;
    world->world.set_law(contact_law_of(given));
  });
}

exmat_status exmat_world_set_full_bodies(exmat_world* world, std::int32_t most) noexcept {
  EXMAT_REQUIRE(world);
  if (most < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: most: expected 0 or more, found %d", __func__, most);
  world->world.set_full_bodies(most);
  return EXMAT_OK;
}

exmat_status exmat_world_read_contact_law(const exmat_world* world, exmat_contact_law* law) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(law);
  if (const exmat_status status = check_size(__func__, law->size, kContactLawSizes)) return status;
  give(world->law, law->size, law);
  return EXMAT_OK;
}

exmat_status exmat_world_add_body(exmat_world* world, exmat_body* body, std::int64_t* id) noexcept {
  EXMAT_REQUIRE(id);
  *id = -1;
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(body);
  return guarded(__func__, [&] {
    check_joins(*world, *body);
    const auto surface = surface_of(*world, body->source);
    const std::unique_ptr<exmat_world> own = std::move(body->own);
    try {
      join(*world, surface, "", *body);
    } catch (...) {
      join_own(*body);
      throw;
    }
    *id = body->id;
  });
}

exmat_status exmat_world_remove_body(exmat_world* world, std::int64_t id, exmat_body** body) noexcept {
  EXMAT_REQUIRE(body);
  *body = nullptr;
  EXMAT_REQUIRE(world);
  return guarded(__func__, [&] {
    const exmat_world::Member* member = member_of(*world, id);
    if (member == nullptr || world->is_own)
      throw InvalidArgument(fmt::format("id = {}: expected that of a body that was added to the world", id));
    exmat_body& found = *member->body;
    leave_world(found);
    *body = &found;
    join_own(found);
  });
}

exmat_status exmat_body_set_group(exmat_body* body, std::uint32_t group, std::uint32_t mask) noexcept {
  EXMAT_REQUIRE(body);
  if (group == 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: group = 0: expected at least one bit", __func__);
  return guarded(__func__, [&] {
    const MeetingGroup before = std::exchange(body->scene.meeting, {group, mask});
    try {
      meet_obstacles(*body);
    } catch (...) {
      body->scene.meeting = before;
      throw;
    }
  });
}

exmat_status exmat_body_read_group(const exmat_body* body, std::uint32_t* group, std::uint32_t* mask) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(group);
  EXMAT_REQUIRE(mask);
  *group = body->scene.meeting.group;
  *mask = body->scene.meeting.mask;
  return EXMAT_OK;
}

std::int64_t exmat_world_bodies(const exmat_world* world) noexcept {
  return world != nullptr ? std::ssize(world->members) : -1;
}

exmat_status exmat_world_read_body_ids(const exmat_world* world, std::int64_t* ids, std::int64_t count) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE_LENGTH(count, world->members.size());
  if (count == 0) return EXMAT_OK;
  EXMAT_REQUIRE(ids);
  std::ranges::transform(world->members, ids, &exmat_world::Member::id);
  return EXMAT_OK;
}

exmat_body* exmat_world_body(const exmat_world* world, std::int64_t id) noexcept {
  const exmat_world::Member* member = world != nullptr ? member_of(*world, id) : nullptr;
  return member != nullptr ? member->body : nullptr;
}

const char* exmat_world_body_name(const exmat_world* world, std::int64_t id) noexcept {
  const exmat_world::Member* member = world != nullptr ? member_of(*world, id) : nullptr;
  return member != nullptr ? member->name.c_str() : nullptr;
}

std::int64_t exmat_world_body_kind(const exmat_world* world, std::int64_t id) noexcept {
  const exmat_world::Member* member = world != nullptr ? member_of(*world, id) : nullptr;
  return member != nullptr ? member->kind : -1;
}
