#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace exmat::runtime {

struct PointCacheOptions {
  bool mesh = false;                   ///< the tet mesh's vertices also where the trajectory holds a render mesh
  std::optional<double> frame_rate{};  ///< rate of the animation [1/s], > 0; absent: one sample a frame
  std::optional<std::string> body{};   ///< name in a trajectory of several
};

/// Summary of a written cache.
struct PointCacheSummary {
  std::string dataset;  ///< that the points are of
  std::int64_t points = 0, samples = 0;
  double sample_rate = 1;                            ///< frames from sample to sample
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< origin of the trajectory, which the points are about [m]
};

/// Writes the positions of a trajectory as a point cache that Blender's and 3ds Max's mesh caches read (.pc2): of the
/// render mesh, in the order of its file, or of the tet mesh where there is none. Little-endian; the header
/// "POINTCACHE2\0", int32 version 1, int32 points, float32 first frame 0, float32 sample_rate, int32 samples, then xyz
/// of each point, float32, sample by sample. Throws InputError (no trajectory, damaged, of several bodies
/// none of which is named, too large for the format) and
/// WorkError; `target` is then as it was.
PointCacheSummary write_point_cache(const std::filesystem::path& trajectory, const std::filesystem::path& target,
                                    const PointCacheOptions& options = {});

}  // namespace exmat::runtime
