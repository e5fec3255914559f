#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/mesh/tet_mesh.h"
#include "precompute/training/training_loads.h"
#include "runtime/sim/contact/obstacle.h"

namespace exmat::precompute {

/// A run under constant loads.
struct Segment {
  std::string kind{};   ///< of its loads, LoadKind::name; empty: all of them
  double duration = 0;  ///< [s]
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  std::vector<VertexForceConfig> forces;
  std::vector<runtime::ExampleSettings> examples;
  runtime::FrameMotion motion;                ///< that a free body begins with
  std::optional<runtime::Obstacle> obstacle;  ///< that it is thrown at
};

/// Segments one after the other: the first begins at rest, each other one where the one before it ended.
using Chain = std::vector<Segment>;

struct SegmentOptions {
  int segments = 8;
  double duration = 0;  ///< length of one segment, about [s]
  std::uint64_t seed = 1;
  bool own_loads = true;  ///< begin with a chain of the very loads
  std::string kind{};     ///< Segment::kind of all
};

/// A body as far as forces on patches are drawn for it.
struct SegmentBody {
  const VertexArray& vertices;        ///< n x 3, at rest
  Eigen::RowVector3d centre;          ///< centre of mass
  std::vector<Eigen::Index> surface;  ///< vertices of it that may be pushed
  double size = 0;                    ///< L [m]
  double patch_force = 0;             ///< [N] that moves a patch by a share of L
};

/// Chains of segments in all, each with loads of its own: about those given, in size and direction, or in any direction
/// where the loads say so. The first chain is one of the very loads, if they say for how long. Six in ten begin at
/// rest. Those of a body that is thrown begin beside the obstacle, half of
/// them about the attitude given, half in any; they are half as many again. The same of the same seed.
std::vector<Chain> draw_segments(const TrainingLoads& loads, const SegmentBody& body, const SegmentOptions& options);

}  // namespace exmat::precompute
