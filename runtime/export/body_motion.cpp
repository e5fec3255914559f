#include "runtime/export/body_motion.h"

namespace exmat::runtime {

BodyMotion read_body_motion(TrajectoryReader& trajectory) {
  if (!trajectory.has("/reduced"))
    trajectory.refuse("/reduced", "reduced coordinates, which morph targets move by", "none",
                      "a run in full space has positions alone: export it as .usda or .pc2");
  BodyMotion motion;
  motion.times = trajectory.read("/time");
  motion.reduced = trajectory.read("/reduced");
  motion.positions = trajectory.read("/body/position");
  motion.orientations = trajectory.read("/body/orientation");
  if (trajectory.has("/bones")) motion.bones = trajectory.read("/bones");
  motion.full = trajectory.integer("full_frames") > 0;
  for (Eigen::Index frame = 0; frame < motion.frames(); ++frame) {
    motion.orientations.row(frame).normalize();
    if (frame > 0 && motion.orientations.row(frame).dot(motion.orientations.row(frame - 1)) < 0)
      motion.orientations.row(frame) *= -1;
  }
  return motion;
}

}  // namespace exmat::runtime
