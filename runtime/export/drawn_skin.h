#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "common/core/arrays.h"
#include "common/model/reduced_model.h"

namespace exmat::runtime {

/// The skin of a drawn surface on a skeleton of b bones, as glTF has it: with bones at B_k a vertex is at
/// sum_k w_k B_k A_k^-1 x, x where it is in the bind pose.
struct DrawnSkin {
  std::vector<std::string> names;       ///< b
  IndexVector parents;                  ///< b, of a bone one before it, -1 of a root
  std::vector<Eigen::Isometry3d> bind;  ///< A: axes and joint of each bone in the bind pose, world
  IndexMatrix bones;                    ///< v x h
  RowMatrix weights;                    ///< v x h, numbers of single precision, rows add up to 1
};

/// The largest h: programs that draw seldom blend more bones at a vertex.
inline constexpr Eigen::Index kMostInfluences = 4;

/// The skin of a render mesh that hangs on bones, by the largest kMostInfluences weights of each vertex.
DrawnSkin read_drawn_skin(const RenderData& render, const SkeletonData& skeleton);

/// The bones [7b: joint and turn from the bind pose, w first] as DrawnSkin::bind has them.
std::vector<Eigen::Isometry3d> placed(const DrawnSkin& skin, const Eigen::VectorXd& bones);

/// The transform that a vertex gets from bones that have moved by these, B A^-1.
Eigen::Affine3d blended(const DrawnSkin& skin, const std::vector<Eigen::Isometry3d>& moves, Eigen::Index vertex);

}  // namespace exmat::runtime
