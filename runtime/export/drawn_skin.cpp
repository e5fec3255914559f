#include "runtime/export/drawn_skin.h"

#include <algorithm>
#include <numeric>

#include "common/elastic/polar_rotation.h"

namespace exmat::runtime {

DrawnSkin read_drawn_skin(const RenderData& render, const SkeletonData& skeleton) {
  DrawnSkin skin{skeleton.bones, skeleton.parents, {}, {}, {}};
  for (Eigen::Index b = 0; b < skin.parents.size(); ++b) {
    const auto bind = skeleton.bind.middleRows<3>(3 * b);
    Eigen::Isometry3d& placed = skin.bind.emplace_back(Eigen::Isometry3d::Identity());
    placed.linear() = nearest_rotation(bind.leftCols<3>());
    placed.translation() = bind.col(3);
  }
  const Eigen::Index kept = std::min(kMostInfluences, render.bones.cols());
  skin.bones.setZero(render.bones.rows(), kept);
  skin.weights.setZero(render.bones.rows(), kept);
  std::vector<Eigen::Index> order(static_cast<std::size_t>(render.bones.cols()));
  for (Eigen::Index v = 0; v < render.bones.rows(); ++v) {
    const auto weights = render.bone_weights.row(v);
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    std::ranges::stable_sort(order, std::ranges::greater(), [&](Eigen::Index k) { return weights[k]; });
    double sum = 0;
    for (Eigen::Index k = 0; k < kept; ++k) sum += weights[order[static_cast<std::size_t>(k)]];
    float rest = 1;
    for (Eigen::Index k = kept - 1; k >= 0; --k) {
      const Eigen::Index from = order[static_cast<std::size_t>(k)];
      const float weight = k == 0 ? rest : static_cast<float>(weights[from] / sum);
      rest -= weight;
      skin.weights(v, k) = weight;
      if (weight > 0) skin.bones(v, k) = render.bones(v, from);
    }
  }
  return skin;
}

std::vector<Eigen::Isometry3d> placed(const DrawnSkin& skin, const Eigen::VectorXd& bones) {
  std::vector<Eigen::Isometry3d> all;
  for (std::size_t b = 0; b < skin.bind.size(); ++b) {
    const auto numbers = bones.segment<7>(7 * static_cast<Eigen::Index>(b));
    Eigen::Isometry3d& bone = all.emplace_back(skin.bind[b]);
    bone.prerotate(Eigen::Quaterniond(numbers[3], numbers[4], numbers[5], numbers[6]).normalized());
    bone.translation() = numbers.head<3>();
  }
  return all;
}

Eigen::Affine3d blended(const DrawnSkin& skin, const std::vector<Eigen::Isometry3d>& moves, Eigen::Index vertex) {
  Eigen::Affine3d sum;
  sum.matrix().setZero();
  for (Eigen::Index k = 0; k < skin.bones.cols(); ++k)
    if (const double weight = skin.weights(vertex, k); weight > 0)
      sum.affine() += weight * moves[static_cast<std::size_t>(skin.bones(vertex, k))].affine();
  sum.makeAffine();
  return sum;
}

}  // namespace exmat::runtime
