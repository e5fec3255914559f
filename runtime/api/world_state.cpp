#include <algorithm>
#include <array>
#include <bit>
#include <cinttypes>
#include <cstring>
#include <fmt/format.h>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/body_state.h"
#include "runtime/api/state_numbers.h"
#include "runtime/api/world_handle.h"
#include "runtime/sim/step/state.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

// A state of a world is the motion of its bodies and the memory of their contacts, for a world like this one. A
// snapshot is that and all else that a host or a step changes, for this world: settings, attachments, obstacles that
// move.

namespace {

// ---- what both hold

/// A bound that may be infinite, which no number of a state is.
void visit_bound(StateWriter& archive, double bound) { archive.load(std::isfinite(bound) ? bound : -1); }

void visit_bound(StateReader& archive, double& bound) {
  archive.load(bound);
  if (!archive.checks() && bound < 0) bound = std::numeric_limits<double>::infinity();
}

template <typename Archive, typename Contacts>
void visit_contacts(Archive& archive, Contacts& contacts, std::size_t count, const exmat_body& body) {
  HeldBodyContact unused;
  std::size_t end = 0;
  for (std::size_t i = 0; i < count; ++i) {
    auto& held = *(archive.checks() ? &unused : &contacts[i]);
    const std::size_t vertex =
        archive.whole("vertex", held.vertex, static_cast<double>(body.model().contact->vertices()));
    if (archive.checks() && vertex < end)
      throw InvalidArgument("numbers: expected vertices of a contact in ascending order");
    end = vertex + 1;
    archive.number(held.gap);
    archive.load(held.normal_force);
    archive.not_negative("overlaps of contacts", held.overlap);
    archive.array(held.stretch);
    archive.array(held.normal);
  }
}

template <typename Archive, typename Body>
void visit_body(Archive& archive, Body& body) try {
  visit_state(archive, body);
} catch (const InvalidArgument& error) {
  throw InvalidArgument(fmt::format("body {}: {}", body.id, error.what()));
}

template <typename Archive, typename World, typename Pairs>
void visit_pairs(Archive& archive, World& world, Pairs& pairs) {
  const auto bodies = static_cast<double>(world.members.size());
  const std::size_t count = archive.size("pairs", pairs);
  HeldPair unused;
  std::pair<std::size_t, std::size_t> last(0, 0);
  for (std::size_t i = 0; i < count; ++i) {
    auto& pair = *(archive.checks() ? &unused : &pairs[i]);
    std::pair<std::size_t, std::size_t> own;
    own.first = archive.whole("body", pair.first, bodies);
    own.second = archive.whole("body", pair.second, bodies);
    if (archive.checks() && (own.second < own.first || (i > 0 && own <= last)))
      throw InvalidArgument("numbers: expected pairs of bodies, and the bodies of each, in ascending order");
    if (archive.checks() &&
        !(world.world.may_touch(static_cast<int>(own.first)) && world.world.may_touch(static_cast<int>(own.second))))
      throw InvalidArgument("numbers: expected pairs of bodies that may touch");
    last = own;
    archive.not_negative("energies of a pair", pair.energy);
    visit_bound(archive, pair.account);
    for (const std::size_t side : {0U, 1U}) {
      auto& contacts = pair.held[side];
      const exmat_body& body = *world.members[side == 0 ? own.first : own.second].body;
      visit_contacts(archive, contacts, archive.size("contacts", contacts), body);
    }
  }
}

/// Number of bodies; the state of each; number of pairs; of each its bodies, its energy and its account, the number of
/// vertices of either that touch, and ten numbers for each of these.
template <typename Archive, typename World>
void visit_motion(Archive& archive, World& world) {
  archive.same("bodies", static_cast<double>(world.members.size()), "", ", those of the world");
  for (std::size_t i = 0; i < world.members.size(); ++i) visit_body(archive, *world.members[i].body);
  visit_pairs(archive, world, world.world.held());
}

// ---- what snapshots hold beside

template <typename Archive, typename Patch>
void visit_patch(Archive& archive, Patch& patch, const exmat_body& body) {
  archive.number(patch.square);
  Eigen::Index rows = patch.rows.rows(), axes = patch.axes.cols();
  rows = static_cast<Eigen::Index>(archive.whole("rows", rows, 13));
  axes = static_cast<Eigen::Index>(archive.whole("axes", axes, 4));
  archive.array(patch.rows, rows, body.model().modes());
  archive.array(patch.rest, rows, 1);
  archive.array(patch.axes, 3, axes);
}

/// The end at another body, if there is one.
template <typename Archive, typename Held>
void visit_other_end(Archive& archive, Held& held, const exmat_body& body) {
  bool has_other = held.other.has_value();
  has_other = archive.flag("other", has_other);
  OtherEnd unused;
  if constexpr (!std::is_const_v<Held>) {
    if (!archive.checks() && !has_other) held.other.reset();
    if (!archive.checks() && has_other && !held.other) held.other.emplace();
  }
  if (!has_other) return;
  auto& other = *(archive.checks() ? &unused : &*held.other);
  const auto& members = body.world->members;
  const auto number = archive.whole("other body", other.body, static_cast<double>(members.size()));
  const exmat_body& holding = *members[number].body;
  const std::size_t count = archive.size("other vertices", other.vertices);
  std::int32_t none = 0;
  for (std::size_t k = 0; k < count; ++k)
    archive.whole("vertex", *(archive.checks() ? &none : &other.vertices[k]),
                  static_cast<double>(holding.source->loaded.summary.vertices));
  visit_patch(archive, other.patch, holding);
  archive.array(other.offset);
}

template <typename Archive, typename Held>
void visit_attachment(Archive& archive, Held& held, const exmat_body& body) {
  archive.whole("id", held.id, kMostSteps);
  archive.whole("kind", held.kind, 3);
  const std::size_t count = archive.size("vertices", held.vertices);
  std::int32_t unused = 0;
  for (std::size_t k = 0; k < count; ++k) {
    auto& vertex = *(archive.checks() ? &unused : &held.vertices[k]);
    const std::size_t own = archive.whole("vertex", vertex, static_cast<double>(body.source->loaded.summary.vertices));
    if (archive.checks() && body.full() != nullptr && body.full()->space.number(static_cast<Eigen::Index>(own)) < 0)
      throw InvalidArgument("numbers: expected attachments of vertices that move");
  }
  const auto points = static_cast<Eigen::Index>(count);
  archive.array(held.shares, points, 1);
  archive.array(held.places, 3, points);
  for (auto* number : {&held.stiffness, &held.damping}) archive.number(*number);
  visit_bound(archive, held.break_force);
  visit_patch(archive, held.patch, body);
  for (auto* rotation : {&held.rotation, &held.rotation_before}) archive.array(*rotation);
  for (auto* place : {&held.position, &held.position_before, &held.mean, &held.mean_before, &held.force, &held.torque})
    archive.array(*place);
  archive.flag("broken", held.broken);
  visit_other_end(archive, held, body);
}

/// The attachment follows its motion, which its scene has given it, or its host moves it.
bool visit_motion_of(StateWriter& archive, const Attachment& held, const exmat_body& /*body*/) {
  return archive.flag("motion", held.motion != nullptr);
}

void visit_motion_of(StateReader& archive, Attachment& held, const exmat_body& body) {
  bool follows = false;
  follows = archive.flag("motion", follows);
  if (archive.checks()) return;
  held.motion.reset();
  const auto& of_scene = body.start.attachments;
  const auto own = std::ranges::find(of_scene, held.id, &Attachment::id);
  if (follows && own != of_scene.end()) held.motion = own->motion;
}

/// Attachments, and what steps of a held body know of the last one.
template <typename Archive, typename Body>
void visit_attachments(Archive& archive, Body& body) {
  archive.whole("attachments", body.next_attachment, kMostSteps);
  auto& all = body.state.attachments;
  bool fits = true;  // the scratch of steps, which is for those that are there
  const std::size_t before = all.size(), count = archive.size("attachments", all);
  Attachment unused;
  for (std::size_t i = 0; i < count; ++i) {
    auto& held = *(archive.checks() ? &unused : &all[i]);
    const std::int64_t id = held.id;
    visit_attachment(archive, held, body);
    visit_motion_of(archive, held, body);
    fits &= i < before && held.id == id;
  }
  if (auto* free = std::get_if<FreeState>(&body.state.frame); free != nullptr && count > 0) {
    archive.array(free->before.position);
    archive.array(free->before.orientation.coeffs());
    archive.array(free->before.linear_momentum);
    archive.array(free->before.angular_momentum);
  }
  if constexpr (!std::is_const_v<Body>)
    if (!archive.checks() && (!fits || before != count)) body.world->world.fit_attachments(place_of(body));
}

/// The host's forces by id, and the sum of those without one; nothing where no force has an id.
template <typename Archive, typename Body>
void visit_forces(Archive& archive, Body& body) {
  archive.whole("forces", body.next_forces, kMostSteps);
  auto& all = body.forces;
  const std::size_t count = archive.size("forces", all);
  AppliedForces unused;
  for (std::size_t i = 0; i < count; ++i) {
    auto& forces = *(archive.checks() ? &unused : &all[i]);
    if (i > 0) archive.whole("id", forces.id, kMostSteps);
    archive.array(forces.modes, body.modes(), 1);
    archive.array(forces.vertices, body.state.vertex_force.size(), 1);
    archive.array(forces.force);
    archive.array(forces.torque);
    if constexpr (std::is_same_v<Archive, StateReader>) {  // no snapshot holds loads: what is measured stays
      if (archive.checks()) continue;
      forces.load = body.load;
      if (i > 0) forces.load.setZero();
    }
  }
}

/// Targets that the body reaches for, with its points.
template <typename Archive, typename Body>
void visit_reach(Archive& archive, Body& body) {
  bool reaches = body.reach != nullptr;
  reaches = archive.flag("reach", reaches);
  ReachTargets unused;
  ReachTargets& targets = body.reach ? body.reach->targets() : unused;
  const std::size_t force = targets.force;
  Eigen::Index points = targets.rest.rows(), examples = targets.lowest.size();
  const Eigen::Index before = points;
  archive.flag("reach of the scene", body.reaches_by_scene);
  if (reaches) {
    archive.whole("force", targets.force, static_cast<double>(body.scene.examples.size()));
    points = static_cast<Eigen::Index>(archive.whole("points", points, kMostSteps));
    examples = static_cast<Eigen::Index>(archive.whole("weights", examples, kMostSteps));
    archive.array(targets.rest, points, 3);
    archive.array(targets.basis_rows, 3 * points, body.model().modes());
    archive.array(targets.places, 3 * points, 1);
    archive.array(targets.lowest, examples, 1);
    archive.array(targets.highest, examples, 1);
    archive.number(targets.change);
    archive.number(targets.horizon);
  }
  if constexpr (!std::is_const_v<Body>) {
    if (archive.checks()) return;
    const auto& of_scene = body.source->loaded.reach;
    body.reaches_by_scene &= reaches && of_scene && std::ssize(of_scene->places) == points;
    if (!reaches)
      body.reach.reset();
    else if (!body.reach || force != targets.force || before != points)
      body.reach = std::make_unique<Reach>(body.model(), body.scene, body.state, std::move(targets));
  }
}

/// Settings that a host may change.
template <typename Archive, typename Body>
void visit_settings(Archive& archive, Body& body) {
  auto& scene = body.scene;
  const Eigen::Vector3d gravity = scene.gravity;
  archive.array(scene.gravity);
  if constexpr (!std::is_const_v<Body>)
    if (scene.gravity != gravity) scene.gravity_force.noalias() = body.model().gravity_load.transpose() * scene.gravity;
  archive.number(scene.mass_damping);
  archive.number(scene.stiffness_damping);
  archive.whole("integrator", scene.integrator, 3);
  archive.whole("space", scene.space.space, body.full() != nullptr ? 3 : 1);
  for (std::size_t i = 0; i < scene.examples.size(); ++i) {
    auto& force = scene.examples[i];
    archive.number(force.stiffness);
    archive.number(force.damping);
    archive.number(force.bias);
    bool given = force.given_weights.size() > 0;
    given = archive.flag("given weights", given);
    archive.array(force.given_weights, given ? body.model().examples[i].weights.examples() : 0, 1);
  }
}

template <typename Archive, typename World>
void visit_contact_law(Archive& archive, World& world) {
  for (auto* number : {&world.law.stiffness, &world.law.damping, &world.law.friction, &world.law.release})
    archive.number(*number);
}

template <typename Archive, typename Hosted>
void visit_obstacle(Archive& archive, Hosted& hosted) {
  auto& obstacle = *hosted.obstacle;
  archive.number(obstacle.stiffness);
  archive.number(obstacle.damping);
  archive.number(obstacle.friction);
  const bool was_hosted = hosted.hosted;
  archive.flag("hosted", hosted.hosted);
  double start = obstacle.motion.start();
  MotionSample first = obstacle.motion.first();
  archive.number(start);
  archive.array(first.position);
  archive.array(first.rotation);
  archive.array(first.linear_velocity);
  archive.array(first.angular_velocity);
  if constexpr (!std::is_const_v<Hosted>) {
    if (archive.checks()) return;
    if (hosted.hosted)
      obstacle.motion = RigidMotion::going_on(start, first);
    else if (was_hosted)
      obstacle.motion = hosted.scene_motion;
  }
}

template <typename Archive, typename World>
void visit_snapshot(Archive& archive, World& world) {
  archive.whole("steps", world.steps, kMostSteps);
  visit_contact_law(archive, world);
  int most_full = world.world.full_bodies();
  archive.whole("bodies in full space", most_full, 1 + static_cast<double>(std::numeric_limits<int>::max()));
  for (auto& hosted : world.obstacles) visit_obstacle(archive, hosted);
  for (std::size_t i = 0; i < world.members.size(); ++i) {
    auto& body = *world.members[i].body;
    visit_settings(archive, body);
    visit_reach(archive, body);
    visit_attachments(archive, body);
    visit_forces(archive, body);
    int contacts = world.world.lone_contacts(static_cast<int>(i));
    archive.whole("contacts", contacts, kMostSteps);
    if constexpr (!std::is_const_v<World>)
      if (!archive.checks()) world.world.set_lone_contacts(static_cast<int>(i), contacts);
  }
  visit_motion(archive, world);
  if constexpr (!std::is_const_v<World>) {
    if (archive.checks()) return;
    world.world.set_law(contact_law_of(world.law));
    world.world.set_full_bodies(most_full);
    world.world.take_states();
    world.contacts.clear();
    world.touches.clear();
  }
}

// ---- snapshots as bytes

/// A snapshot begins with this; its numbers follow.
struct Header {
  char format[8] = {'e', 'x', 'm', 'a', 't', 's', 'n', 'p'};
  std::uint64_t version = 3;
  std::uint64_t world = 0;    ///< fingerprint of the world
  std::uint64_t numbers = 0;  ///< that follow
  std::uint64_t sum = 0;      ///< of their bits
};
static_assert(sizeof(Header) == 5 * sizeof(double));

/// Tells worlds apart, word by word: models, ids and groups of bodies, ids and groups of obstacles.
std::uint64_t fingerprint(const exmat_world& world) noexcept {
  std::uint64_t hash = 0x243f6a8885a308d3;
  const auto add = [&](std::uint64_t word) {
    hash = (hash ^ word) * 0x9e3779b97f4a7c15;
    hash ^= hash >> 32U;
  };
  for (const exmat_world::Member& member : world.members) {
    const exmat_body& body = *member.body;
    const std::string& sha = body.source->loaded.summary.input_sha256;
    std::array<std::uint64_t, 2> words{};  // 16 of the 64 digits: enough to tell bundles apart
    std::memcpy(words.data(), sha.data(), std::min(sha.size(), sizeof words));
    for (const std::uint64_t word : words) add(word);
    add(static_cast<std::uint64_t>(member.id));
    add(static_cast<std::uint64_t>(body.modes()));
    add(std::uint64_t{body.scene.meeting.group} << 32U | body.scene.meeting.mask);
  }
  for (const exmat_world::HostedObstacle& hosted : world.obstacles) {
    add(static_cast<std::uint64_t>(hosted.id));
    add(std::uint64_t{hosted.obstacle->meeting.group} << 32U | hosted.obstacle->meeting.mask);
    add(hosted.obstacle->shape.index());
  }
  return hash;
}

std::uint64_t sum_of(std::span<const double> numbers) noexcept {
  std::uint64_t sum = 0;
  for (const double number : numbers) sum += std::bit_cast<std::uint64_t>(number);
  return sum;
}

std::size_t snapshot_numbers(const exmat_world& world) {
  StateWriter counter;
  visit_snapshot(counter, world);
  return counter.count();
}

bool is_aligned(const void* buffer) noexcept { return reinterpret_cast<std::uintptr_t>(buffer) % alignof(double) == 0; }

/// The numbers of a snapshot of this world. Throws where it is none.
std::span<const double> numbers_of(const void* buffer, std::size_t size, const exmat_world& world) {
  Header header;
  const Header own;
  if (size >= sizeof header) std::memcpy(&header, buffer, sizeof header);
  if (size < sizeof header || std::memcmp(header.format, own.format, sizeof header.format) != 0)
    throw InvalidArgument("buffer: expected a snapshot, as the world saves it");
  if (header.version != own.version)
    throw InvalidArgument(fmt::format("buffer: version {}: expected {}: it was saved by another version of the library",
                                      header.version, own.version));
  if (header.world != fingerprint(world))
    throw InvalidArgument(
        "buffer: the snapshot is of a world of other bodies or obstacles, or of other groups: expected this one as it "
        "was");
  if (header.numbers > (size - sizeof header) / sizeof(double))
    throw InvalidArgument(fmt::format("buffer: {} bytes: expected {}: it ends early", size,
                                      sizeof header + header.numbers * sizeof(double)));
  const std::span numbers(reinterpret_cast<const double*>(static_cast<const char*>(buffer) + sizeof header),
                          header.numbers);
  if (sum_of(numbers) != header.sum) throw InvalidArgument("buffer: the snapshot was changed: its sum is another one");
  return numbers;
}

/// Throws where the archive does not fit the world.
template <typename Visit>
void check(StateReader reader, const Visit& visit) {
  const std::size_t count = reader.left();
  visit(reader);
  if (reader.left() > 0) throw InvalidArgument(fmt::format("numbers: {}: expected {}", count, count - reader.left()));
}

void set_world(std::span<const double> numbers, exmat_world& world) {
  check({numbers, StateReader::Use::kCheck, kFarthest}, [&](StateReader& reader) { visit_motion(reader, world); });
  const double time = time_of(world);
  StateReader reader(numbers, StateReader::Use::kTake);
  visit_motion(reader, world);
  for (const auto& member : world.members) {
    member.body->state.begins_anew |= holds_modes(member.body->state.attachments);  // whose past it does not hold
    member.body->forces.clear();                                                    // the state has their sum
  }
  world.world.take_states();
  world.contacts.clear();
  world.touches.clear();
  follow_times(world, time);
}

}  // namespace

std::int64_t exmat_world_state_size(const exmat_world* world) noexcept {
  if (world == nullptr) return -1;
  StateWriter counter;
  visit_motion(counter, *world);
  return static_cast<std::int64_t>(counter.count());
}

exmat_status exmat_world_read_state(const exmat_world* world, double* numbers, std::int64_t count) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(numbers);
  EXMAT_REQUIRE_LENGTH(count, exmat_world_state_size(world));
  StateWriter writer(numbers);
  visit_motion(writer, *world);
  return EXMAT_OK;
}

exmat_status exmat_world_set_state(exmat_world* world, const double* numbers, std::int64_t count) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(numbers);
  if (count < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 0", __func__, count);
  return guarded(__func__, [&] { set_world({numbers, static_cast<std::size_t>(count)}, *world); });
}

std::size_t exmat_world_snapshot_size(const exmat_world* world) noexcept {
  return world != nullptr ? sizeof(Header) + sizeof(double) * snapshot_numbers(*world) : 0;
}

exmat_status exmat_world_save(const exmat_world* world, void* buffer, std::size_t size) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(buffer);
  if (!is_aligned(buffer)) return fail(EXMAT_INVALID_ARGUMENT, "%s: buffer: expected one aligned to 8 bytes", __func__);
  auto* const to = reinterpret_cast<double*>(static_cast<char*>(buffer) + sizeof(Header));
  StateWriter writer(size > sizeof(Header) ? to : nullptr,
                     (std::max(size, sizeof(Header)) - sizeof(Header)) / sizeof(double));
  visit_snapshot(writer, *world);
  if (const std::size_t needed = sizeof(Header) + sizeof(double) * writer.count(); size < needed)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: size = %zu: expected at least %zu", __func__, size, needed);
  Header header;
  header.world = fingerprint(*world);
  header.numbers = writer.count();
  header.sum = sum_of({to, writer.count()});
  std::memcpy(buffer, &header, sizeof header);
  return EXMAT_OK;
}

exmat_status exmat_world_restore(exmat_world* world, const void* buffer, std::size_t size) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(buffer);
  if (!is_aligned(buffer)) return fail(EXMAT_INVALID_ARGUMENT, "%s: buffer: expected one aligned to 8 bytes", __func__);
  return guarded(__func__, [&] {
    const auto numbers = numbers_of(buffer, size, *world);
    check({numbers, StateReader::Use::kCheck}, [&](StateReader& reader) { visit_snapshot(reader, *world); });
    StateReader reader(numbers, StateReader::Use::kTake);
    visit_snapshot(reader, *world);
  });
}
