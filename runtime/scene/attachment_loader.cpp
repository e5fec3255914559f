#include "runtime/scene/attachment_loader.h"

#include <algorithm>
#include <fmt/format.h>
#include <utility>

#include "common/bundle/scene_places.h"
#include "common/core/error.h"
#include "common/mesh/assembly.h"
#include "runtime/scene/obstacle_loader.h"
#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/attachment_terms.h"
#include "runtime/sim/step/contact_step.h"

namespace exmat::runtime {
namespace {

constexpr std::size_t kListed = 6;  // vertices in a message
constexpr double kStiffest = 1e9;   // of springs, times the mass that they hold over the square of the time step

/// The first few of them.
std::string list_of(const std::vector<std::int32_t>& vertices) {
  const auto shown = std::min<std::size_t>(vertices.size(), kListed);
  return fmt::format("{}{}", fmt::join(vertices.begin(), vertices.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
                     shown < vertices.size() ? ", ..." : "");
}

/// None where the spring and the damper of an attachment keep their digits beside the inertia of a mass that they hold.
std::optional<HoldFault> too_stiff(double mass, const StepScene& scene, const Attachment& attachment) {
  if (attachment.kind != AttachmentKind::kSpring) return std::nullopt;
  const double per_step = kStiffest * mass / scene.time_step, stiffest = per_step / scene.time_step;
  const auto expected = [](double most, const char* unit, const char* what) {
    return fmt::format("<= {:.3g} {}, {:g} times the mass of the vertices over {}: kind ball holds exactly", most, unit,
                       kStiffest, what);
  };
  if (attachment.stiffness > stiffest)
    return HoldFault{"stiffness", expected(stiffest, "N/m", "time_step^2"), fmt::format("{:g}", attachment.stiffness)};
  if (attachment.damping > per_step)
    return HoldFault{"damping", expected(per_step, "N s/m", "time_step"), fmt::format("{:g}", attachment.damping)};
  return std::nullopt;
}

/// Reason why the k-th vertex cannot be held; none where it can.
std::optional<HoldFault> fault_of(const FullModel* full, bool in_modes, const Patch& patch, std::size_t k,
                                  const State& state) {
  const std::int32_t vertex = patch.vertices[k];
  const bool is_fixed = in_modes ? patch.basis_rows.middleRows<3>(3 * static_cast<Eigen::Index>(k)).isZero(0)
                                 : full->space.number(vertex) < 0;
  if (is_fixed) return HoldFault{"vertices", "vertices that move", fmt::format("{}, which is fixed", vertex)};
  for (const Attachment& other : state.attachments)
    if (other.holds() && std::ranges::count(other.vertices, vertex) > 0)
      return HoldFault{"vertices", "vertices that nothing holds", fmt::format("{}, which is held already", vertex)};
  return std::nullopt;
}

/// Takes hold of a patch in the modes, where it is. Returns its patch with the rotation, if `turns`.
ReducedPatch take_hold_in_modes(const Model& model, const Patch& patch, const State& state, bool turns,
                                Attachment& attachment) {
  const Placement placement = model.frame->placement(state.frame);
  Eigen::Matrix3Xd here(3, patch.masses.size());
  for (Eigen::Index k = 0; k < here.cols(); ++k)
    here.col(k) = placement.to_world(patch.rest.row(k).transpose() + patch.basis_rows.middleRows<3>(3 * k) * state.q);
  take_hold(patch.masses, here, attachment);
  VertexArray rest = patch.rest;
  rest.rowwise() -= placement.origin.transpose();
  return reduce_patch(rest, patch.basis_rows, attachment.shares, attachment.places, turns);
}

/// Takes hold of a body in its modes.
std::optional<HoldFault> hold_in_modes(const Model& model, const Patch& patch, Attachment& attachment, State& state) {
  const BodyPose pose = pose_of(model, state);
  attachment.patch = take_hold_in_modes(model, patch, state, attachment.kind == AttachmentKind::kFixed, attachment);
  attachment.mean = attachment.mean_before = mean_of(attachment, pose);
  std::vector<Attachment> all = state.attachments;
  all.push_back(attachment);
  if (can_hold(all, *model.frame, pose)) return std::nullopt;
  return HoldFault{"vertices",
                   "ones that the modes can hold beside what is held or fixed: a ball or a spring, other vertices, or "
                   "space full or auto",
                   "ones that the modes of the body cannot hold"};
}

void hold_in_full(const Model& model, const FullModel& full, const Patch& patch, Attachment& attachment, State& state) {
  enter_full_space(full, model, state);
  const Placement placement = model.frame->placement(state.frame);
  const Eigen::VectorXd masses = full.space.masses();
  Eigen::VectorXd own(std::ssize(patch.vertices));
  Eigen::Matrix3Xd here(3, own.size());
  for (Eigen::Index k = 0; k < own.size(); ++k) {
    const Eigen::Index vertex = patch.vertices[static_cast<std::size_t>(k)];
    own[k] = masses[full.space.place(vertex)];
    here.col(k) = full.rest.row(vertex).transpose() + full_displacement(full, placement, *state.full, vertex);
  }
  take_hold(own, here, attachment);
}

}  // namespace

bool steps_in_modes(const FullModel* full, const StepScene& scene) noexcept {
  return full == nullptr || scene.space.space == Space::kReduced;
}

Patch make_patch(const ObjectData& object, std::vector<std::int32_t> vertices, RowMatrix basis_rows) {
  Patch patch{std::move(vertices), {}, std::move(basis_rows), {}};
  const Eigen::VectorXd masses =
      scalar_mass(object.mesh, object.materials.density) * Eigen::VectorXd::Ones(object.mesh.vertex_count());
  patch.masses = masses(patch.vertices);
  patch.rest = object.mesh.vertices(patch.vertices, Eigen::all);
  return patch;
}

Patch load_patch(const SceneConfig& config, const ObjectData& object, const VertexSelection& selection,
                 const std::string& place, bool in_modes, LoadedScene& loaded) {
  std::vector<std::int32_t> vertices = select_vertices(config, object, selection, place);
  RowMatrix rows;
  if (in_modes) {
    const std::vector<std::int64_t> ids(vertices.begin(), vertices.end());
    rows = read_basis_rows(bundle_of(config), ids, &loaded.records);
  }
  return make_patch(object, std::move(vertices), std::move(rows));
}

std::optional<HoldFault> hold(const Model& model, const FullModel* full, const StepScene& scene, const Patch& patch,
                              Attachment attachment, State& state) {
  const bool in_modes = steps_in_modes(full, scene);
  double mass = in_modes ? patch.masses.sum() : 0;
  for (std::size_t k = 0; k < patch.vertices.size(); ++k) {
    if (auto fault = fault_of(full, in_modes, patch, k, state)) return fault;
    if (!in_modes) mass += full->space.masses()[full->space.place(patch.vertices[k])];
  }
  if (auto fault = too_stiff(mass, scene, attachment)) return fault;
  attachment.vertices = patch.vertices;
  if (!in_modes)
    hold_in_full(model, *full, patch, attachment, state);
  else if (auto fault = hold_in_modes(model, patch, attachment, state))
    return fault;
  state.attachments.push_back(std::move(attachment));
  state.begins_anew = true;
  return std::nullopt;
}

std::optional<HoldFault> hold_together(const End& own, const End& other, int body, Attachment attachment,
                                       State& state) {
  for (const End* const end : {&own, &other}) {
    if (!steps_in_modes(end->full, end->scene))
      return HoldFault{"to", "two bodies of space reduced", "one that may step in all vertices"};
    if (!end->may_touch)
      return HoldFault{"to", "two bodies that may touch others: bodies of one world or of a scene's \"bodies\"",
                       "one that touches obstacles alone"};
  }
  for (const End* const end : {&own, &other})
    if (auto fault = too_stiff(end->patch.masses.sum(), end->scene, attachment)) return fault;
  OtherEnd held{body, other.patch.vertices, {}, {}};
  Attachment others;
  held.patch = take_hold_in_modes(other.model, other.patch, other.state, true, others);
  const bool is_fixed = attachment.kind == AttachmentKind::kFixed;
  attachment.vertices = own.patch.vertices;
  attachment.rotation.setIdentity();
  attachment.position.setZero();
  attachment.patch = take_hold_in_modes(own.model, own.patch, own.state, is_fixed, attachment);
  for (const End* const end : {&own, &other}) {
    const bool is_own = end == &own;
    if (is_fixed && (is_own ? attachment.patch : held.patch).axes.cols() < 3)
      return HoldFault{is_own ? "vertices" : "to/vertices",
                       "three vertices or more that are not in a line, or kind ball or spring",
                       fmt::format("{} in a line: {}", end->patch.vertices.size(), list_of(end->patch.vertices))};
  }
  const BodyPose own_pose = pose_of(own.model, own.state), other_pose = pose_of(other.model, other.state);
  PatchPlace there;
  place_patch(held.patch, other_pose, there);
  held.offset = there.rotation.transpose() * (mean_of(attachment, own_pose) - other_pose.position - there.arm);
  attachment.other = std::move(held);
  if (!can_hold_together(attachment, *own.model.frame, own_pose, *other.model.frame, other_pose))
    return HoldFault{"vertices", "ones that the modes of one of the two bodies can move",
                     "ones that no mode moves: a spring holds none of them"};
  state.attachments.push_back(std::move(attachment));
  return std::nullopt;
}

std::vector<LoadedAttachment> load_attachments(const SceneConfig& config, const ObjectData& object,
                                               const Obstacles& obstacles, LoadedScene& loaded) {
  std::vector<LoadedAttachment> attachments;
  const bool in_modes = steps_in_modes(loaded.full.get(), loaded.scene);
  for (const AttachmentConfig& own : config.attachments) {
    LoadedAttachment& made = attachments.emplace_back(LoadedAttachment{config.file.string(), own.place, own.only});
    made.patch =
        std::make_shared<Patch>(load_patch(config, object, own.vertices, own.place + "/vertices", in_modes, loaded));
    Attachment& attachment = made.attachment;
    attachment.kind = own.kind;
    attachment.stiffness = own.stiffness;
    attachment.damping = own.damping;
    attachment.break_force = own.break_force;
    if (own.body) {
      made.other = LoadedOtherEnd{own.body->kind, own.body->number};
    } else if (own.obstacle) {
      const SharedObstacle& obstacle = obstacles[*own.obstacle];
      attachment.motion = obstacle.motion();
    } else {
      attachment.motion = std::make_shared<RigidMotion>(make_motion(own.motion));
    }
  }
  return attachments;
}

std::vector<const LoadedAttachment*> attachments_of(const LoadedScene& kind, std::size_t number) {
  std::vector<const LoadedAttachment*> found;
  for (const LoadedAttachment& own : kind.attachments)
    if (!own.only || *own.only == number) found.push_back(&own);
  std::stable_partition(found.begin(), found.end(), [](const LoadedAttachment* own) { return !own->other; });
  return found;
}

void hold_body(const LoadedScene& kind, std::size_t number, State& state) {
  for (const LoadedAttachment* const own : attachments_of(kind, number)) {
    if (own->other) return;
    Attachment attachment = own->attachment;
    attachment.id = std::ssize(state.attachments);
    attachment.follow(state.time, state.time);
    if (const auto fault = hold(*kind.model, kind.full.get(), kind.scene, *own->patch, std::move(attachment), state))
      throw InputError({own->file, fmt::format("{}/{}", own->place, fault->member), fault->expected, fault->found, ""});
  }
}

}  // namespace exmat::runtime
