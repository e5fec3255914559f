#pragma once

#include <cstddef>
#include <filesystem>

#include "common/config/scene_config.h"
#include "exmat/exmat.h"

namespace exmat::runtime {

/// Sizes of a struct of the API that begins with its size: in the first version, and in this one.
struct StructSizes {
  std::size_t first = 0, now = 0;
};
inline constexpr StructSizes kSettingsSizes{120, sizeof(exmat_settings)};
inline constexpr StructSizes kReportSizes{80, sizeof(exmat_report)};
inline constexpr StructSizes kMotionSizes{112, sizeof(exmat_motion)};
inline constexpr StructSizes kEnergiesSizes{32, sizeof(exmat_energies)};
inline constexpr StructSizes kObstacleSizes{152, sizeof(exmat_obstacle)};
inline constexpr StructSizes kContactSizes{96, sizeof(exmat_contact)};
inline constexpr StructSizes kContactLawSizes{40, sizeof(exmat_contact_law)};
inline constexpr StructSizes kWorldReportSizes{72, sizeof(exmat_world_report)};
inline constexpr StructSizes kBodyContactSizes{104, sizeof(exmat_body_contact)};
inline constexpr StructSizes kTouchSizes{32, sizeof(exmat_touch)};
inline constexpr StructSizes kBundleInfoSizes{72, sizeof(exmat_bundle_info)};
inline constexpr StructSizes kProfileSizes{48, sizeof(exmat_profile)};
inline constexpr StructSizes kAttachmentSizes{offsetof(exmat_attachment, break_force) + sizeof(double),
                                              sizeof(exmat_attachment)};
inline constexpr StructSizes kReachSizes{56, sizeof(exmat_reach)};
inline constexpr StructSizes kRayHitSizes{88, sizeof(exmat_ray_hit)};
inline constexpr std::size_t kMostStructBytes = 4096;  ///< limit on the size of any version

/// The defaults of a scene file.
exmat_settings default_settings();

/// The scene that steps `bundle` with these settings; null: the defaults. Throws InvalidArgument: a size that no
/// version of exmat_settings has, a member out of the range that schemas/scene.json gives it.
SceneConfig scene_of(const std::filesystem::path& bundle, const exmat_settings* settings);

}  // namespace exmat::runtime
