#include "precompute/study/measure/nearest_phase.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/core/decompositions.h"
#include "precompute/shape_space/transfer.h"

namespace exmat::precompute {
namespace {

constexpr int kSearchSteps = 40;           // of a golden section: the time to 1e-8 of a frame
constexpr double kGolden = 0.61803398875;  // (sqrt(5) - 1) / 2
constexpr double kSameTime = 1e-9;         // of the reach: rounding of times

// The largest sum of products of two bodies with moments H = b^T M a, over all turns of a: the sum of the singular
// values, the last negative where a reflection would be nearer.
double best_product(const Eigen::Matrix3d& moments) {
  Eigen::Vector3d values = moments.jacobiSvd().singularValues();
  if (moments.determinant() < 0) values[2] = -values[2];
  return values.sum();
}

// The motion of the reference, prepared for distances from it.
class Motion {
 public:
  Motion(const BodyFrames& reference, const SparseMatrix& mass, bool turned)
      : times_(reference.times), mass_(mass), turned_(turned), origin_(reference.positions.front()) {
    weights_ = mass * Eigen::VectorXd::Ones(mass.cols());
    for (const VertexArray& positions : reference.positions) {
      fields_.push_back(prepared(positions));
      weighted_.emplace_back(mass * fields_.back());
      squares_.push_back(fields_.back().cwiseProduct(weighted_.back()).sum());
    }
    for (std::size_t j = 0; j + 1 < fields_.size(); ++j) prepare_way(j);
  }

  // Least distance of the positions of one frame, which are to be at `time`.
  double nearest(const VertexArray& positions, double time, double reach) const;

 private:
  // From frame j to j + 1: how the latter is turned to come nearest to the former, and their product then.
  struct Way {
    Eigen::Matrix3d turn;
    double product = 0;
  };
  struct Body {
    VertexArray field;
    double square = 0;
  };

  // Positions to compare: without the centre of mass where the body may turn, else near zero, where squares are exact.
  VertexArray prepared(const VertexArray& positions) const {
    if (!turned_) return positions - origin_;
    const Eigen::RowVector3d centre = weights_.transpose() * positions / weights_.sum();
    return positions.rowwise() - centre;
  }
  double product(const Eigen::Matrix3d& moments) const { return turned_ ? best_product(moments) : moments.trace(); }
  void prepare_way(std::size_t j) {
    const Eigen::Matrix3d moments = weighted_[j].transpose() * fields_[j + 1];
    const Eigen::Matrix3d turn = turned_ ? procrustes_rotation(moments) : Eigen::Matrix3d::Identity();
    ways_.push_back({turn, (turn.transpose() * moments).trace()});
  }
  Eigen::Matrix3d moments(std::size_t j, const Body& body) const { return weighted_[j].transpose() * body.field; }
  double distance(std::size_t j, const Body& body) const {
    return std::sqrt(std::max(0.0, body.square + squares_[j] - 2 * product(moments(j, body))));
  }
  double distance_on_way(std::size_t j, const Body& body, double from, double to) const;

  const std::vector<double>& times_;
  const SparseMatrix& mass_;
  bool turned_;
  VertexArray origin_;
  Eigen::VectorXd weights_;
  std::vector<VertexArray> fields_, weighted_;
  std::vector<double> squares_;
  std::vector<Way> ways_;
};

// Least over the shares [from, to] of the way from frame j to the next, by golden section.
double Motion::distance_on_way(std::size_t j, const Body& body, double from, double to) const {
  const Eigen::Matrix3d start = moments(j, body), end = ways_[j].turn * moments(j + 1, body);
  const auto square = [&](double s) {
    const double length =
        (1 - s) * (1 - s) * squares_[j] + 2 * s * (1 - s) * ways_[j].product + s * s * squares_[j + 1];
    return body.square + length - 2 * product((1 - s) * start + s * end);
  };
  double least = std::min(square(from), square(to));
  double left = to - kGolden * (to - from), right = from + kGolden * (to - from);
  double at_left = square(left), at_right = square(right);
  for (int i = 0; i < kSearchSteps; ++i) {
    least = std::min({least, at_left, at_right});
    if (at_left < at_right) {
      to = right;
      right = left;
      at_right = at_left;
      at_left = square(left = to - kGolden * (to - from));
    } else {
      from = left;
      left = right;
      at_left = at_right;
      at_right = square(right = from + kGolden * (to - from));
    }
  }
  return std::sqrt(std::max(0.0, least));
}

double Motion::nearest(const VertexArray& positions, double time, double reach) const {
  Body body{prepared(positions), 0};
  body.square = body.field.cwiseProduct(mass_ * body.field).sum();
  const double first = time - reach * (1 + kSameTime), last = time + reach * (1 + kSameTime);
  std::size_t best = times_.size();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t j = 0; j < times_.size(); ++j) {
    if (times_[j] < first || times_[j] > last) continue;
    const double here = distance(j, body);
    if (best < times_.size() && here >= least) continue;
    best = j;
    least = here;
  }
  const auto share = [&](std::size_t j, double at) {
    return std::clamp((at - times_[j]) / (times_[j + 1] - times_[j]), 0.0, 1.0);
  };
  for (std::size_t j = best == 0 ? 0 : best - 1; j < ways_.size() && j <= best; ++j)
    least = std::min(least, distance_on_way(j, body, share(j, first), share(j, last)));
  return least;
}

}  // namespace

std::vector<double> nearest_distances(const BodyFrames& frames, const BodyFrames& reference, const SparseMatrix& mass,
                                      double reach, bool turned) {
  const Motion motion(reference, mass, turned);
  std::vector<double> distances;
  for (std::size_t i = 0; i < frames.times.size(); ++i)
    distances.push_back(motion.nearest(frames.positions[i], frames.times[i], reach));
  return distances;
}

}  // namespace exmat::precompute
