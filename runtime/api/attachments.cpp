#include <algorithm>
#include <cinttypes>
#include <limits>
#include <mutex>

#include "common/elastic/polar_rotation.h"
#include "exmat/exmat.h"
#include "runtime/api/frames.h"
#include "runtime/api/handles.h"
#include "runtime/api/reading.h"
#include "runtime/api/world_handle.h"
#include "runtime/scene/attachment_loader.h"
#include "runtime/sim/step/sleep.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

void set_frame(const double* numbers, Attachment& attachment) {
  attachment.rotation = nearest_rotation(frame_at(numbers).leftCols<3>());
  attachment.position = frame_at(numbers).col(3);
}

/// Null where there is none, which is the error then.
template <typename Body>
auto* find(const char* function, Body& body, std::int64_t id) noexcept {
  const auto found = std::ranges::find(body.state.attachments, id, &Attachment::id);
  if (found != body.state.attachments.end()) return &*found;
  fail(EXMAT_INVALID_ARGUMENT, "%s: id = %" PRId64 ": the body has no such attachment", function, id);
  return static_cast<decltype(&*found)>(nullptr);
}

exmat_attachment default_attachment() noexcept {
  return {sizeof(exmat_attachment), EXMAT_ATTACHMENT_FIXED, 1e4, 0, std::numeric_limits<double>::infinity()};
}

bool steps_in_modes(const exmat_body& body) noexcept { return runtime::steps_in_modes(body.full(), body.scene); }

Patch read_patch(const std::vector<std::int32_t>& vertices, const exmat_body& body) {
  if (!steps_in_modes(body)) return {vertices, {}, {}, {}};
  const std::vector<std::int64_t> ids(vertices.begin(), vertices.end());
  const std::lock_guard lock(reading());
  RowMatrix rows = read_vertices(*body.source, ids).basis_rows;
  return make_patch(*read_groups(*body.source, {"object"}).object, vertices, std::move(rows));
}

/// With the next id of the body.
Attachment attachment_of(const exmat_attachment& settings, const exmat_body& body) {
  Attachment attachment;
  attachment.kind = static_cast<AttachmentKind>(settings.kind);
  attachment.stiffness = settings.stiffness;
  attachment.damping = settings.damping;
  attachment.break_force = settings.break_force;
  attachment.id = body.next_attachment;
  return attachment;
}

std::vector<std::int32_t> vertices_of(const char* name, std::span<const std::int64_t> vertices,
                                      const exmat_body& body) {
  const std::int64_t count = body.source->loaded.summary.vertices;
  std::vector<std::int32_t> ids;
  for (const std::int64_t vertex : vertices) {
    if (vertex < 0 || vertex >= count)
      throw InvalidArgument(std::string(name) + ": " + std::to_string(vertex) + ": there is no such vertex");
    if (std::ranges::count(ids, vertex) > 0)
      throw InvalidArgument(std::string(name) + ": " + std::to_string(vertex) + " is there twice");
    ids.push_back(static_cast<std::int32_t>(vertex));
  }
  return ids;
}

void attach(std::span<const std::int64_t> vertices, const exmat_attachment& settings, const double* frame,
            exmat_body& body, std::int64_t& id) {
  Attachment attachment = attachment_of(settings, body);
  set_frame(frame, attachment);
  const std::vector<std::int32_t> ids = vertices_of("vertices", vertices, body);
  if (const auto fault =
          hold(body.model(), body.full(), body.scene, read_patch(ids, body), std::move(attachment), body.state))
    throw InvalidArgument(std::string(fault->member) + ": " + fault->found + ": expected " + fault->expected);
  id = body.next_attachment++;
  if (steps_in_modes(body)) body.world->world.fit_attachments(place_of(body));
  was_put(body);
}

void attach_to(std::span<const std::int64_t> vertices, exmat_body& other, std::span<const std::int64_t> other_vertices,
               const exmat_attachment& settings, exmat_body& body, std::int64_t& id) {
  if (&other == &body || other.world != body.world)
    throw InvalidArgument("other: expected another body of the same world");
  const Patch own = read_patch(vertices_of("vertices", vertices, body), body);
  const Patch holding = read_patch(vertices_of("other_vertices", other_vertices, other), other);
  const auto end_of = [](const exmat_body& end, const Patch& patch) {
    return End{end.model(), end.full(), end.scene, end.world->world.may_touch(place_of(end)), patch, end.state};
  };
  if (const auto fault = hold_together(end_of(body, own), end_of(other, holding), place_of(other),
                                       attachment_of(settings, body), body.state))
    throw InvalidArgument(std::string(fault->member) + ": " + fault->found + ": expected " + fault->expected);
  id = body.next_attachment++;
  body.world->world.fit_attachments(place_of(body));
  wake(body.state);
  wake(other.state);
}

/// Says what is wrong with the settings of an attachment; EXMAT_OK where nothing is, and `given` is complete then.
exmat_status check_attachment(const char* function, const exmat_attachment& attachment, exmat_attachment& given) {
  if (const exmat_status status = check_size(function, attachment.size, kAttachmentSizes)) return status;
  given = completed(attachment, default_attachment());
  if (given.kind < EXMAT_ATTACHMENT_FIXED || given.kind > EXMAT_ATTACHMENT_SPRING)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: kind = %" PRId32 ": expected 0 to 2", function, given.kind);
  const bool is_far = given.stiffness > kFarthest || given.damping > kFarthest;
  if (given.kind == EXMAT_ATTACHMENT_SPRING && !(given.stiffness > 0 && given.damping >= 0 && !is_far))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: stiffness = %g, damping = %g: expected > 0 and >= 0, up to %g", function,
                given.stiffness, given.damping, kFarthest);
  if (!(given.break_force > 0))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: break_force = %g: expected > 0", function, given.break_force);
  return EXMAT_OK;
}

}  // namespace

exmat_status exmat_attachment_default(exmat_attachment* attachment, std::size_t size) noexcept {
  EXMAT_REQUIRE(attachment);
  if (const exmat_status status = check_size(__func__, size, kAttachmentSizes)) return status;
  give(default_attachment(), size, attachment);
  return EXMAT_OK;
}

exmat_status exmat_body_attach(exmat_body* body, const std::int64_t* vertices, std::int64_t count,
                               const exmat_attachment* attachment, const double* frame, std::int64_t* id) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(vertices);
  EXMAT_REQUIRE(attachment);
  EXMAT_REQUIRE(frame);
  EXMAT_REQUIRE(id);
  if (count < 1) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 1", __func__, count);
  exmat_attachment given;
  if (const exmat_status status = check_attachment(__func__, *attachment, given)) return status;
  if (const exmat_status status = check_frames(__func__, "frame", frame, 1)) return status;
  return guarded(__func__, [&] { attach({vertices, static_cast<std::size_t>(count)}, given, frame, *body, *id); });
}

exmat_status exmat_body_attach_to(exmat_body* body, const std::int64_t* vertices, std::int64_t count, exmat_body* other,
                                  const std::int64_t* other_vertices, std::int64_t other_count,
                                  const exmat_attachment* attachment, std::int64_t* id) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(vertices);
  EXMAT_REQUIRE(other);
  EXMAT_REQUIRE(other_vertices);
  EXMAT_REQUIRE(attachment);
  EXMAT_REQUIRE(id);
  if (count < 1) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 1", __func__, count);
  if (other_count < 1)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: other_count = %" PRId64 ": expected >= 1", __func__, other_count);
  exmat_attachment given;
  if (const exmat_status status = check_attachment(__func__, *attachment, given)) return status;
  return guarded(__func__, [&] {
    attach_to({vertices, static_cast<std::size_t>(count)}, *other,
              {other_vertices, static_cast<std::size_t>(other_count)}, given, *body, *id);
  });
}

exmat_status exmat_body_move_attachment(exmat_body* body, std::int64_t id, const double* frame) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(frame);
  if (const exmat_status status = check_frames(__func__, "frame", frame, 1)) return status;
  Attachment* const attachment = find(__func__, *body, id);
  if (attachment == nullptr) return EXMAT_INVALID_ARGUMENT;
  if (attachment->other)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: id = %" PRId64 ": another body holds it: there is no frame to move",
                __func__, id);
  attachment->motion.reset();
  set_frame(frame, *attachment);
  return EXMAT_OK;
}

exmat_status exmat_body_detach(exmat_body* body, std::int64_t id) noexcept {
  EXMAT_REQUIRE(body);
  Attachment* const attachment = find(__func__, *body, id);
  if (attachment == nullptr) return EXMAT_INVALID_ARGUMENT;
  if (attachment->other) {
    wake(body->state);
    wake(body->world->world.state(attachment->other->body));
  }
  auto& all = body->state.attachments;
  all.erase(all.begin() + (attachment - all.data()));
  body->state.begins_anew = true;
  if (!steps_in_modes(*body)) return EXMAT_OK;
  return guarded(__func__, [&] { body->world->world.fit_attachments(place_of(*body)); });
}

exmat_status exmat_body_read_attachment_load(const exmat_body* body, std::int64_t id, double* force, double* torque,
                                             std::int32_t* broken) noexcept {
  EXMAT_REQUIRE(body);
  const Attachment* const found = find(__func__, *body, id);
  if (found == nullptr) return EXMAT_INVALID_ARGUMENT;
  if (force != nullptr) std::ranges::copy(found->force, force);
  if (torque != nullptr) std::ranges::copy(found->torque, torque);
  if (broken != nullptr) *broken = found->broken ? 1 : 0;
  return EXMAT_OK;
}
