#include "runtime/sim/frame/skeleton.h"

#include <cinttypes>
#include <cmath>

#include "exmat/exmat.h"
#include "runtime/api/frames.h"
#include "runtime/api/handles.h"
#include "runtime/api/world_handle.h"
#include "runtime/sim/space/full/full_body.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

const Skeleton* skeleton_of(const exmat_model* model) noexcept {
  return model != nullptr ? model->model().skeleton.get() : nullptr;
}

bool has_bone(const exmat_model* model, std::int64_t bone) noexcept {
  const Skeleton* skeleton = skeleton_of(model);
  return skeleton != nullptr && bone >= 0 && bone < std::ssize(skeleton->names());
}

const BoneAnimation* animation_of(const exmat_model* model, std::int64_t animation) noexcept {
  const Skeleton* skeleton = skeleton_of(model);
  if (skeleton == nullptr || animation < 0 || animation >= std::ssize(skeleton->animations())) return nullptr;
  return &skeleton->animations()[static_cast<std::size_t>(animation)];
}

void write_matrices(const Skeleton& skeleton, const BonePoses& poses, double* transforms) {
  for (std::size_t bone = 0; bone < skeleton.size(); ++bone)
    Eigen::Map<FrameMatrix>(transforms + kFrameNumbers * bone) = skeleton.matrix(bone, poses[bone]);
}

exmat_status no_skeleton(const char* function) noexcept {
  return fail(EXMAT_INVALID_ARGUMENT,
              "%s: the model has no bones: make its bundle of a surface with a skin, or of tets with object.skeleton",
              function);
}

}  // namespace

std::int64_t exmat_model_bones(const exmat_model* model) noexcept {
  if (model == nullptr) return -1;
  const Skeleton* skeleton = skeleton_of(model);
  return skeleton != nullptr ? std::ssize(skeleton->names()) : 0;
}

const char* exmat_model_bone_name(const exmat_model* model, std::int64_t bone) noexcept {
  return has_bone(model, bone) ? skeleton_of(model)->names()[static_cast<std::size_t>(bone)].c_str() : nullptr;
}

std::int64_t exmat_model_bone_parent(const exmat_model* model, std::int64_t bone) noexcept {
  return has_bone(model, bone) ? skeleton_of(model)->parent(static_cast<std::size_t>(bone)) : -1;
}

exmat_status exmat_model_read_bones(const exmat_model* model, double* transforms, std::int64_t count) noexcept {
  EXMAT_REQUIRE(model);
  const Skeleton* skeleton = skeleton_of(model);
  if (skeleton == nullptr) return no_skeleton(__func__);
  EXMAT_REQUIRE(transforms);
  EXMAT_REQUIRE_LENGTH(count, kFrameNumbers * std::ssize(skeleton->names()));
  write_matrices(*skeleton, skeleton->bound(), transforms);
  return EXMAT_OK;
}

std::int64_t exmat_model_animations(const exmat_model* model) noexcept {
  if (model == nullptr) return -1;
  const Skeleton* skeleton = skeleton_of(model);
  return skeleton != nullptr ? std::ssize(skeleton->animations()) : 0;
}

const char* exmat_model_animation_name(const exmat_model* model, std::int64_t animation) noexcept {
  const BoneAnimation* found = animation_of(model, animation);
  return found != nullptr ? found->name().c_str() : nullptr;
}

double exmat_model_animation_duration(const exmat_model* model, std::int64_t animation) noexcept {
  const BoneAnimation* found = animation_of(model, animation);
  return found != nullptr ? found->duration() : -1;
}

exmat_status exmat_model_read_animation(const exmat_model* model, std::int64_t animation, double time,
                                        double* transforms, std::int64_t count) noexcept {
  EXMAT_REQUIRE(model);
  const Skeleton* skeleton = skeleton_of(model);
  if (skeleton == nullptr) return no_skeleton(__func__);
  EXMAT_REQUIRE(transforms);
  const BoneAnimation* found = animation_of(model, animation);
  if (found == nullptr)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: animation = %" PRId64 ": expected 0 to %zu", __func__, animation,
                skeleton->animations().size() - 1);
  if (!std::isfinite(time)) return fail(EXMAT_INVALID_ARGUMENT, "%s: time: expected a finite number", __func__);
  EXMAT_REQUIRE_LENGTH(count, kFrameNumbers * std::ssize(skeleton->names()));
  return guarded(__func__, [&] {
    BonePoses poses = skeleton->bound();
    found->sample(time, poses);
    write_matrices(*skeleton, poses, transforms);
  });
}

exmat_status exmat_body_set_bones(exmat_body* body, const double* transforms, std::int64_t bones,
                                  std::int32_t teleport) noexcept {
  EXMAT_REQUIRE(body);
  const Skeleton* skeleton = body->model().skeleton.get();
  if (skeleton == nullptr) return no_skeleton(__func__);
  EXMAT_REQUIRE(transforms);
  EXMAT_REQUIRE_LENGTH(bones, std::ssize(skeleton->names()));
  if (const exmat_status status = check_frames(__func__, "transforms", transforms, bones)) return status;
  return guarded(__func__, [&] {
    SkeletonMotion& motion = *body->state.full->skeleton;
    body->scene.animation.reset();
    for (std::size_t bone = 0; bone < skeleton->size(); ++bone)
      motion.next[bone] = skeleton->pose(bone, frame_at(transforms + kFrameNumbers * bone));
    if (teleport == 0 && !motion.bound) return;
    motion.bound = false;
    put_on_bones(*body->full(), motion.next, body->state);
    was_put(*body);
  });
}

exmat_status exmat_body_read_bones(const exmat_body* body, double* transforms, std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  const Skeleton* skeleton = body->model().skeleton.get();
  if (skeleton == nullptr) return no_skeleton(__func__);
  EXMAT_REQUIRE(transforms);
  EXMAT_REQUIRE_LENGTH(count, kFrameNumbers * std::ssize(skeleton->names()));
  write_matrices(*skeleton, body->state.full->skeleton->bones, transforms);
  return EXMAT_OK;
}
