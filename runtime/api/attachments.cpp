#include <algorithm>
#include <cinttypes>
#include <limits>
#include <mutex>

#include "common/elastic/polar_rotation.h"
#include "common/mesh/assembly.h"
#include "exmat/exmat.h"
#include "runtime/api/frames.h"
#include "runtime/api/handles.h"
#include "runtime/api/reading.h"
#include "runtime/api/world_handle.h"
#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/attachment_terms.h"
#include "runtime/sim/step/contact_step.h"

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

bool steps_in_modes(const exmat_body& body) noexcept {
  return body.full() == nullptr || body.scene.space.space == Space::kReduced;
}

/// The vertices of a patch.
struct Patch {
  PointSet points{};  ///< with rows of the basis, of a body that steps in its modes alone
  Eigen::VectorXd masses{};
  Eigen::Matrix3Xd here{};  ///< world [m]
};

/// Null, or why the k-th vertex cannot be held.
const char* fault_of(const exmat_body& body, const Patch& patch, std::size_t k, std::int64_t vertex) {
  const bool fixed = steps_in_modes(body)
                         ? patch.points.basis_rows.middleRows<3>(3 * static_cast<Eigen::Index>(k)).isZero(0)
                         : body.full()->space.number(vertex) < 0;
  if (fixed) return "it is fixed";
  for (const Attachment& other : body.state.attachments)
    if (other.holds() && std::ranges::count(other.vertices, vertex) > 0) return "it is held already";
  return nullptr;
}

Patch patch_in_modes(std::span<const std::int64_t> vertices, const exmat_body& body) {
  Patch patch;
  const std::lock_guard lock(reading());
  patch.points = read_vertices(*body.source, vertices);
  const ReducedModel data = read_groups(*body.source, {"object"});
  const Eigen::VectorXd masses = scalar_mass(data.object->mesh, data.object->materials.density) *
                                 Eigen::VectorXd::Ones(data.object->mesh.vertex_count());
  const Placement placement = body.model().frame->placement(body.state.frame);
  patch.masses.resize(std::ssize(vertices));
  patch.here.resize(3, std::ssize(vertices));
  for (Eigen::Index k = 0; k < patch.masses.size(); ++k) {
    patch.masses[k] = masses[vertices[static_cast<std::size_t>(k)]];
    const Eigen::Vector3d rest = patch.points.rest.row(k);
    patch.here.col(k) = placement.to_world(rest + patch.points.basis_rows.middleRows<3>(3 * k) * body.state.q);
  }
  return patch;
}

Patch patch_in_full(std::span<const std::int64_t> vertices, exmat_body& body) {
  const FullModel& full = *body.full();
  Patch patch;
  enter_full_space(full, body.model(), body.state);
  const Placement placement = body.model().frame->placement(body.state.frame);
  const Eigen::VectorXd masses = full.space.masses();
  patch.masses.resize(std::ssize(vertices));
  patch.here.resize(3, std::ssize(vertices));
  for (Eigen::Index k = 0; k < patch.masses.size(); ++k) {
    const Eigen::Index vertex = vertices[static_cast<std::size_t>(k)];
    patch.masses[k] = masses[full.space.place(vertex)];
    patch.here.col(k) =
        full.rest.row(vertex).transpose() + full_displacement(full, placement, *body.state.full, vertex);
  }
  return patch;
}

/// Adds the data that steps in modes need to the attachment. Throws where modes cannot hold it beside the others.
void reduce(const Patch& patch, exmat_body& body, Attachment& attachment) {
  if (attachment.kind != AttachmentKind::kSpring && body.world->world.may_touch(place_of(body)))
    throw InvalidArgument(
        "kind: a body that may touch others is held by springs while it steps in its modes: expected a spring, a model "
        "of space full or auto, or a world with law.apart = 1");
  const BodyPose pose = pose_of(body.model(), body.state);
  VertexArray rest = patch.points.rest;
  rest.rowwise() -= pose.origin.transpose();
  reduce_patch(rest, patch.points.basis_rows, attachment);
  attachment.mean = attachment.mean_before = mean_of(attachment, pose);
  std::vector<Attachment> all = body.state.attachments;
  all.push_back(attachment);
  if (!can_hold(all, *body.model().frame, pose))
    throw InvalidArgument(
        "vertices: the modes of the body cannot hold them beside what is held or fixed: expected a ball or a spring, "
        "other vertices, or a model of space full or auto");
}

void attach(std::span<const std::int64_t> vertices, const exmat_attachment& settings, const double* frame,
            exmat_body& body, std::int64_t& id) {
  Attachment attachment;
  attachment.kind = static_cast<AttachmentKind>(settings.kind);
  attachment.stiffness = settings.stiffness;
  attachment.damping = settings.damping;
  attachment.break_force = settings.break_force;
  set_frame(frame, attachment);
  const std::int64_t count = body.source->loaded.summary.vertices;
  for (const std::int64_t vertex : vertices) {
    if (vertex < 0 || vertex >= count)
      throw InvalidArgument("vertices: " + std::to_string(vertex) + ": there is no such vertex");
    if (std::ranges::count(attachment.vertices, vertex) > 0)
      throw InvalidArgument("vertices: " + std::to_string(vertex) + " is there twice");
    attachment.vertices.push_back(static_cast<std::int32_t>(vertex));
  }
  const bool in_modes = steps_in_modes(body);
  Patch patch;
  if (in_modes) patch = patch_in_modes(vertices, body);
  for (std::size_t k = 0; k < vertices.size(); ++k)
    if (const char* fault = fault_of(body, patch, k, vertices[k]))
      throw InvalidArgument("vertices: " + std::to_string(vertices[k]) + ": " + fault);
  if (!in_modes) patch = patch_in_full(vertices, body);
  attachment.shares = patch.masses / patch.masses.sum();
  attachment.places = attachment.rotation.transpose() * (patch.here.colwise() - attachment.position);
  attachment.rotation_before = attachment.rotation;
  attachment.position_before = attachment.position;
  if (in_modes) reduce(patch, body, attachment);
  attachment.id = id = body.next_attachment++;
  body.state.attachments.push_back(std::move(attachment));
  if (in_modes) body.world->world.fit_attachments(place_of(body));
  body.state.begins_anew = true;
  was_put(body);
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
  if (const exmat_status status = check_size(__func__, attachment->size, kAttachmentSizes)) return status;
  const exmat_attachment given = completed(*attachment, default_attachment());
  if (given.kind < EXMAT_ATTACHMENT_FIXED || given.kind > EXMAT_ATTACHMENT_SPRING)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: kind = %" PRId32 ": expected 0 to 2", __func__, given.kind);
  const bool is_far = given.stiffness > kFarthest || given.damping > kFarthest;
  if (given.kind == EXMAT_ATTACHMENT_SPRING && !(given.stiffness > 0 && given.damping >= 0 && !is_far))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: stiffness = %g, damping = %g: expected > 0 and >= 0, up to %g", __func__,
                given.stiffness, given.damping, kFarthest);
  if (!(given.break_force > 0))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: break_force = %g: expected > 0", __func__, given.break_force);
  if (const exmat_status status = check_frames(__func__, "frame", frame, 1)) return status;
  return guarded(__func__, [&] { attach({vertices, static_cast<std::size_t>(count)}, given, frame, *body, *id); });
}

exmat_status exmat_body_move_attachment(exmat_body* body, std::int64_t id, const double* frame) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(frame);
  if (const exmat_status status = check_frames(__func__, "frame", frame, 1)) return status;
  Attachment* const attachment = find(__func__, *body, id);
  if (attachment == nullptr) return EXMAT_INVALID_ARGUMENT;
  set_frame(frame, *attachment);
  return EXMAT_OK;
}

exmat_status exmat_body_detach(exmat_body* body, std::int64_t id) noexcept {
  EXMAT_REQUIRE(body);
  Attachment* const attachment = find(__func__, *body, id);
  if (attachment == nullptr) return EXMAT_INVALID_ARGUMENT;
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
