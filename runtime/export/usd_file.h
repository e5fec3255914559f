#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "runtime/export/gltf_file.h"

namespace exmat::runtime {

struct UsdOptions {
  bool mesh = false;       ///< the tet mesh's surface also where the trajectory holds a render mesh
  double frame_rate = 24;  ///< time codes a second, > 0
  UpAxis up = UpAxis::kY;
  std::optional<std::string> body{};  ///< alone, of a trajectory of several
};

/// Summary of a written file.
struct UsdSummary {
  std::string dataset;  ///< that the points are of
  std::int64_t bodies = 1, points = 0, samples = 0, bytes = 0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< origin of the trajectory: the translation of each Mesh [m]
};

/// Writes the positions of a trajectory as Universal Scene Description in text (.usda): a Mesh with points at each
/// frame, in metres, for each body. Bodies with the same triangles inherit them from one class. Throws InputError (no
/// trajectory, damaged) and WorkError; `target` is then as it was.
UsdSummary write_usd(const std::filesystem::path& trajectory, const std::filesystem::path& target,
                     const UsdOptions& options = {});

}  // namespace exmat::runtime
