#include <algorithm>
#include <fmt/format.h>

#include "common/config/config.h"
#include "common/config/json_file.h"
#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/body_obstacles.h"
#include "runtime/api/reading.h"
#include "runtime/api/world_handle.h"
#include "runtime/scene/world_loader.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

// Worlds and the bodies that are in them.

namespace {

/// Its place in its world.
int place_of(const exmat_body& body) noexcept {
  const auto is_it = [&](const exmat_world::Member& member) { return member.body.get() == &body; };
  return static_cast<int>(std::ranges::find_if(body.world->members, is_it) - body.world->members.begin());
}

const exmat_world::Member* member_of(const exmat_world& world, std::int64_t id) noexcept {
  const auto found = std::ranges::lower_bound(world.members, id, {}, &exmat_world::Member::id);
  return found != world.members.end() && found->id == id ? &*found : nullptr;
}

}  // namespace

namespace exmat::runtime {

void was_put(exmat_body& body) noexcept {
  if (body.world == nullptr) return;
  exmat_world& world = *body.world;
  const int place = place_of(body);
  world.world.forget(place);
  const std::int64_t id = world.members[static_cast<std::size_t>(place)].id;
  std::erase_if(world.contacts,
                [=](const exmat_body_contact& contact) { return contact.body == id || contact.other == id; });
}

void leave_world(exmat_body& body) noexcept {
  was_put(body);
  exmat_world& world = *body.world;
  const int place = place_of(body);
  world.world.remove(place);
  const auto member = world.members.begin() + place;
  static_cast<void>(member->body.release());
  world.members.erase(member);
  body.world = nullptr;
  body.scene.meets_bodies = false;
}

std::int64_t join(exmat_world& world, const std::shared_ptr<const TouchingSurface>& surface, std::string name,
                  exmat_body& body) {
  world.members.reserve(world.members.size() + 1);
  body.scene.meets_bodies = true;
  try {
    size_for_contact(body);
    world.world.add({&body.model(), &body.scene, surface}, body.state, body.workspace);
  } catch (...) {
    body.scene.meets_bodies = false;
    throw;
  }
  body.world = &world;
  world.members.push_back({world.next_id, std::move(name), std::unique_ptr<exmat_body>(&body)});
  return world.next_id++;
}

}  // namespace exmat::runtime

namespace {

ContactLaw law_of(const exmat_contact_law& given) {
  const auto is_positive = [](double number) { return number > 0 && std::isfinite(number); };
  if (!is_positive(given.stiffness))
    throw InvalidArgument(fmt::format("law.stiffness = {:g}: expected a finite number above 0", given.stiffness));
  for (const auto& [number, name] : {std::pair(given.damping, "damping"), std::pair(given.friction, "friction")})
    if (number != 0 && !is_positive(number))
      throw InvalidArgument(fmt::format("law.{} = {:g}: expected a finite number >= 0", name, number));
  if (given.self != 0 && given.self != 1)
    throw InvalidArgument(fmt::format("law.self = {}: expected 0 or 1", given.self));
  return {given.stiffness, given.damping, given.friction};
}

exmat_contact_law describe(const ContactLaw& law, bool self) noexcept {
  return {sizeof(exmat_contact_law), law.stiffness, law.damping, law.friction, self ? 1 : 0, 0};
}

exmat_contact_law default_law() noexcept {
  const BodyContactConfig defaults;
  return describe({defaults.stiffness, defaults.damping, defaults.friction}, defaults.self);
}

/// The surface of a model's bodies, made once in a world. Reads the bundle.
std::shared_ptr<const TouchingSurface> surface_of(exmat_world& world, const std::shared_ptr<const Source>& source) {
  if (const auto known = world.surfaces.find(source); known != world.surfaces.end()) return known->second;
  const std::lock_guard lock(reading());
  auto surface = touching_surface(*source->loaded.model, read_rest(*source, /*basis=*/true), world.self);
  return world.surfaces.emplace(source, std::move(surface)).first->second;
}

void check_joins(const exmat_world& world, const exmat_body& body) {
  if (body.world != nullptr) throw InvalidArgument("the body is in a world already");
  if (!body.model().contact)
    throw InvalidArgument("the model knows no contact: expected settings with use_contact, or a scene with obstacles");
  if (body.scene.sleep.energy > 0)
    throw InvalidArgument(
        fmt::format("the body's model has sleep_energy = {:g}: expected 0, bodies of a world do not sleep",
                    body.scene.sleep.energy));
  if (world.members.empty()) return;
  const double step = world.members.front().body->scene.time_step;
  if (body.scene.time_step != step)
    throw InvalidArgument(
        fmt::format("the body's time step is {:g} s: expected that of the world, {:g} s", body.scene.time_step, step));
}

std::unique_ptr<exmat_world> load(const std::optional<WorldConfig>& config, const char* path) {
  if (!config)
    throw InputError({path, "/", "a scene of several \"bodies\"", "one of a single \"bundle\"",
                      "exmat_model_create_from_scene() takes it"});
  LoadedWorld loaded = load_world_run(*config);
  const BodyContactConfig& contact = config->contact;
  auto world =
      std::make_unique<exmat_world>(ContactLaw{contact.stiffness, contact.damping, contact.friction}, contact.self);
  std::vector<std::shared_ptr<const Source>> sources;
  for (std::size_t i = 0; i < loaded.kinds.size(); ++i) {
    LoadedKind& kind = loaded.kinds[i];
    kind.loaded.data = {};
    sources.push_back(std::make_shared<Source>(Source{config->bodies[i].scene.bundle, std::move(kind.loaded)}));
    world->surfaces[sources.back()] = kind.surface;
  }
  for (LoadedBody& body : loaded.bodies) {
    auto made = std::make_unique<exmat_body>(sources[body.kind], std::move(body.start));
    join(*world, loaded.kinds[body.kind].surface, std::move(body.name), *made);
    static_cast<void>(made.release());
    world->members.back().kind = static_cast<std::int64_t>(body.kind);
  }
  return world;
}

}  // namespace

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
    const exmat_contact_law given = law != nullptr ? *law : default_law();
    *world = new exmat_world(law_of(given), given.self == 1);
  });
}

exmat_status exmat_world_create_from_scene(const char* scene_path, exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  EXMAT_REQUIRE(scene_path);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *world = load(load_world(scene_path), scene_path).release();
  });
}

exmat_status exmat_world_create_from_text(const char* scene, const char* path, exmat_world** world) noexcept {
  EXMAT_REQUIRE(world);
  *world = nullptr;
  EXMAT_REQUIRE(scene);
  EXMAT_REQUIRE(path);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    *world = load(world_of(parse_json(scene, path), path), path).release();
  });
}

void exmat_world_destroy(exmat_world* world) noexcept { delete world; }

exmat_status exmat_world_set_contact_law(exmat_world* world, const exmat_contact_law* law) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(law);
  if (const exmat_status status = check_size(__func__, law->size, kContactLawSizes)) return status;
  return guarded(__func__, [&] {
    world->law = law_of(*law);
    world->world.set_law(world->law);
  });
}

exmat_status exmat_world_read_contact_law(const exmat_world* world, exmat_contact_law* law) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(law);
  if (const exmat_status status = check_size(__func__, law->size, kContactLawSizes)) return status;
  give(describe(world->law, world->self), law->size, law);
  return EXMAT_OK;
}

exmat_status exmat_world_add_body(exmat_world* world, exmat_body* body, std::int64_t* id) noexcept {
  EXMAT_REQUIRE(id);
  *id = -1;
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(body);
  return guarded(__func__, [&] {
    check_joins(*world, *body);
    *id = join(*world, surface_of(*world, body->source), "", *body);
  });
}

exmat_status exmat_world_remove_body(exmat_world* world, std::int64_t id, exmat_body** body) noexcept {
  EXMAT_REQUIRE(body);
  *body = nullptr;
  EXMAT_REQUIRE(world);
  return guarded(__func__, [&] {
    const exmat_world::Member* member = member_of(*world, id);
    if (member == nullptr) throw InvalidArgument(fmt::format("id = {}: expected that of a body of the world", id));
    exmat_body& found = *member->body;
    leave_world(found);
    *body = &found;
    size_for_contact(found);
  });
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
  return member != nullptr ? member->body.get() : nullptr;
}

const char* exmat_world_body_name(const exmat_world* world, std::int64_t id) noexcept {
  const exmat_world::Member* member = world != nullptr ? member_of(*world, id) : nullptr;
  return member != nullptr ? member->name.c_str() : nullptr;
}

std::int64_t exmat_world_body_kind(const exmat_world* world, std::int64_t id) noexcept {
  const exmat_world::Member* member = world != nullptr ? member_of(*world, id) : nullptr;
  return member != nullptr ? member->kind : -1;
}
