#pragma once

#include <vector>

#include "common/bundle/bundle.h"
#include "common/config/scene_config.h"
#include "runtime/sim/contact/obstacle.h"

namespace exmat::runtime {

RigidMotion make_motion(const std::vector<KeyframeConfig>& keys);

/// Reads the files of meshes and height fields. Throws InputError where one is not what it is to be: a mesh without
/// thickness has to be closed. `release` [m/s], see Obstacle.
Obstacles make_obstacles(const std::vector<ObstacleConfig>& configs, double release = kRelease);
/// Those of them that a body meets.
Obstacles obstacles_of(const MeetingGroup& body, const Obstacles& all);
/// Those that the body of the scene meets.
Obstacles make_obstacles(const SceneConfig& config);

/// Throws InputError where the scene gives a constrained body a rigid state or a free one a motion.
void check_body(const SceneConfig& config, bool constrained);

/// q at the beginning [r], for `modes` of them: that of body.reduced or body.pose, else 0. A pose needs /examples.
/// Throws InputError: another number of coordinates, no example of that name.
Eigen::VectorXd start_coordinates(const SceneConfig& config, const ReducedModel& data, Eigen::Index modes);

}  // namespace exmat::runtime
