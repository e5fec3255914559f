#pragma once

#include <string>

namespace exmat::precompute {

/// In which unit of length a pose is read, and how large it is. docs/alignment.md, "Scale".
struct PoseScale {
  double unit = 1;          ///< lengths of the pose's file for one of the rest example's
  double size = 1;          ///< pose over rest example in the same unit: (V_pose / V_rest)^(1/3), its own change
  std::string note{};       ///< worth a line of the log
  std::string warning{};    ///< worth a warning
  std::string objection{};  ///< worth a refusal
};

/// From the volumes of a pose's file and of the rest example's. `same_mesh`: the pose is one of the rest example's own
/// mesh, whose unit it keeps.
PoseScale scale_of_pose(double pose_volume, double rest_volume, bool same_mesh);

/// Why the size of a rest example beside the object's is worth a warning; empty where it is not. Both files' volumes.
std::string remark_on_rest_scale(double rest_volume, double object_volume);

}  // namespace exmat::precompute
