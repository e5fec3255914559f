#include "precompute/training/roll_out.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "precompute/training/reduced_runs.h"

namespace exmat::precompute {
namespace {

constexpr double kUnmoved = 1e-3;  // of the largest size of a kind: one below it does not move the body

// Sums of squares of distances, and of sizes.
struct Sums {
  double distance = 0, size = 0;
  std::int64_t frames = 0;

  void add(double squared_distance, double squared_size) {
    distance += squared_distance;
    size += squared_size;
    ++frames;
  }
};

// Sums over the runs of one kind of load.
struct KindSums {
  Sums positions, shapes, ends, settled;

  // Mean of the squared sizes of the shapes.
  double size() const { return shapes.frames > 0 ? shapes.size / static_cast<double>(shapes.frames) : 0; }
};

double square(const SparseMatrix& mass, const Eigen::VectorXd& u) { return u.dot(mass * u); }

// Root mean square of the distances over that of the sizes of all frames.
double relative(const Sums& part, const Sums& all) {
  if (part.frames == 0 || all.size == 0) return 0;
  return std::sqrt(part.distance / static_cast<double>(part.frames) / (all.size / static_cast<double>(all.frames)));
}

void note_worst(const Eigen::VectorXd& difference, RollOut& result) {
  for (Eigen::Index v = 0; v < difference.size() / 3; ++v) {
    const double distance = difference.segment<3>(3 * v).norm();
    if (distance <= result.worst_distance) continue;
    result.worst_distance = distance;
    result.worst_vertex = v;
  }
}

RollOut not_finite() {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  return {{}, kInfinite, kInfinite, kInfinite, kInfinite, 0, kInfinite};
}

}  // namespace

RollOut roll_out(const ReducedModel& model, EnergyReference reference, const std::vector<Chain>& chains,
                 const TrainingRuns& full, const SparseMatrix& mass, const TrainingRunOptions& options) {
  const std::vector<ChainFrames> runs = run_reduced_chains(model, reference, chains, options);

  RollOut result;
  std::map<std::string, KindSums> kinds;
  Eigen::Index begin = 0;
  for (std::size_t i = 0; i < chains.size(); ++i) {
    const Eigen::Index end = full.chain_ends[i], count = end - begin;
    if (!runs[i].finite || std::ssize(runs[i].deformations) < count) return not_finite();
    KindSums& sums = kinds[chains[i].front().kind];
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto frame = static_cast<std::size_t>(k);
      const auto u = full.deformations.col(begin + k), x = full.displacements.col(begin + k);
      const Eigen::VectorXd difference = runs[i].deformations[frame] - u;
      const double distance = square(mass, difference), size = square(mass, u);
      sums.positions.add(square(mass, runs[i].displacements[frame] - x), square(mass, x));
      sums.shapes.add(distance, size);
      if (k == count - 1) sums.ends.add(distance, size);
      if (k >= count - std::max<Eigen::Index>(1, count / 10)) sums.settled.add(distance, size);
      note_worst(difference, result);
    }
    begin = end;
  }
  double largest = 0;
  for (const auto& [kind, sums] : kinds) largest = std::max(largest, sums.size());
  for (const auto& [kind, sums] : kinds) {
    const double shape = relative(sums.shapes, sums.shapes);
    if (sums.size() < kUnmoved * kUnmoved * largest || shape < result.shape) continue;
    result.kind = kind;
    result.position = relative(sums.positions, sums.positions);
    result.shape = shape;
    result.end = relative(sums.ends, sums.shapes);
    result.settled = relative(sums.settled, sums.shapes);
  }
  return result;
}

}  // namespace exmat::precompute
