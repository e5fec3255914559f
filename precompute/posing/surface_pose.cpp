#include "precompute/posing/surface_pose.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numeric>
#include <optional>
#include <vector>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/progress.h"
#include "common/mesh/geometry.h"
#include "precompute/full_space/mesh_elasticity.h"
#include "precompute/full_space/sparse_direction.h"
#include "precompute/posing/surface_springs.h"
#include "precompute/posing/volume_guard.h"

namespace exmat::precompute {
namespace {

// Stiffness of the springs over Young's modulus, at diagonal 1, first and last: each stage takes kStiffen times that of
// the one before. At the first the surface misses a pose by some percent, at the last by what the cage cannot hold.
constexpr double kFirstStiffness = 1, kLastStiffness = 1e5, kStiffen = 10;
// From rest, poses are reached by softer springs first.
constexpr double kFirstFromRest = 1e-3;
// Strength of the guard over the root of the springs' stiffness: tets that these squeeze keep some percent of their
// volume.
constexpr double kGuard = 1;
// A stage that brings the surface less than this share nearer is the last, and so is one that brings it so near (RMS
// over the diagonal): a tenth of what is asked of a pose.
constexpr double kGain = 0.3, kNear = 1e-4;
// A pose that is missed by more (RMS over the diagonal) is sought from rest, too.
constexpr double kMissed = 5e-3;
// Newton's method ends where an iteration lowers the energy by less than this share of it, between stages and at last.
constexpr double kBetween = 1e-3, kLast = 1e-8;
constexpr int kMostIterations = 100;
constexpr double kArmijo = 1e-4;
constexpr int kHalvings = 30;

// The cage and its surface at diagonal 1, about the origin.
struct UnitBody {
  TetMesh cage;
  SurfaceMesh surface;
  double diagonal = 1;
  Eigen::RowVector3d centre;
};

UnitBody unit_body(const TetMesh& cage, const SurfaceMesh& surface) {
  UnitBody body;
  body.diagonal = bounding_box_diagonal(surface.vertices);
  body.centre = surface.vertices.colwise().mean();
  body.cage = {(cage.vertices.rowwise() - body.centre) / body.diagonal, cage.tets};
  body.surface = {(surface.vertices.rowwise() - body.centre) / body.diagonal, surface.triangles};
  return body;
}

MeshElasticity elasticity_of(const TetMesh& cage) {
  const auto all = [&](double value) { return Eigen::VectorXd::Constant(cage.tet_count(), value); };
  std::vector<std::int32_t> dofs(static_cast<std::size_t>(3 * cage.vertex_count()));
  std::iota(dofs.begin(), dofs.end(), 0);
  return {cage, {all(1), all(1), all(kPosePoisson), MaterialModel::kStableNeoHookean}, dofs};
}

class PoseSolver {
 public:
  PoseSolver(const UnitBody& body, const Embedding& embedding, const VertexArray& places)
      : body_(body),
        springs_(body.cage, body.surface, embedding, places),
        elasticity_(elasticity_of(body.cage)),
        guard_(body.cage, elasticity_),
        spring_values_(elasticity_.values_of(springs_.hessian())),
        direction_(elasticity_.pattern()) {}

  /// From positions x, by springs from `first` on. Nothing where the springs of the first stage leave tets inside out.
  std::optional<SurfacePose> solve(VertexArray x, double first);
  int iterations() const { return iterations_; }

 private:
  void minimise(VertexArray& x, double stiffness, double end);
  double energy(const VertexArray& x, double stiffness) const;
  bool is_sound(const VertexArray& x) const { return tet_volumes({x, body_.cage.tets}).minCoeff() > 0; }
  Eigen::VectorXd displacements(const VertexArray& x) const {
    const VertexArray moved = x - body_.cage.vertices;
    return moved.reshaped<Eigen::RowMajor>();
  }

  const UnitBody& body_;
  SurfaceSprings springs_;
  MeshElasticity elasticity_;
  VolumeGuard guard_;
  Eigen::VectorXd spring_values_;
  SparseDirection direction_;
  int iterations_ = 0;
};

double PoseSolver::energy(const VertexArray& x, double stiffness) const {
  return elasticity_.energy(displacements(x)) + stiffness * springs_.energy(x);
}

// No tet is inside out at the end where none is at x.
void PoseSolver::minimise(VertexArray& x, double stiffness, double end) {
  const double guard = is_sound(x) ? kGuard * std::sqrt(stiffness) : 0;
  Eigen::VectorXd force, step;
  LowerTriangle hessian;
  const double rounding = 1e-14;
  // Exact tangents where they serve: far from the minimum they do not, as a rule.
  runtime::Tangent tangent = runtime::Tangent::kPositiveSemidefinite;
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    double here =
        elasticity_.force_and_stiffness(displacements(x), tangent, force, hessian) + stiffness * springs_.energy(x);
    if (guard > 0) here += guard_.add(x, guard, force, hessian);
    hessian.coeffs() += stiffness * spring_values_.array();
    const VertexArray pull = stiffness * springs_.gradient(x);
    const Eigen::VectorXd gradient = force + pull.reshaped<Eigen::RowMajor>();
    const auto product = [&](const Eigen::VectorXd& v) -> Eigen::VectorXd {
      return hessian.selfadjointView<Eigen::Lower>() * v;
    };
    if (!direction_.solve(hessian, product, -gradient, step)) {
      if (tangent == runtime::Tangent::kExact) {
        tangent = runtime::Tangent::kPositiveSemidefinite;
        continue;
      }
      if (!direction_.solve_shifted(hessian, product, -gradient, step)) return;
    }
    const double slope = gradient.dot(step);
    double length = 1, there = here;
    VertexArray trial;
    for (int halving = 0; halving <= kHalvings; ++halving, length /= 2) {
      trial = x + length * step.reshaped<Eigen::RowMajor>(x.rows(), 3);
      there = energy(trial, stiffness) + (guard > 0 ? guard * guard_.energy(trial) : 0);
      if (there <= here + kArmijo * length * slope) break;
    }
    ++iterations_;
    if (!(there < here)) return;
    x = trial;
    // A step that the guard shortens says little; the whole one would gain half the slope.
    if (std::max(here - there, length < 1 ? -slope / 2 : 0) <= std::max(end, rounding) * here) return;
    tangent =
        length == 1 && here - there < 0.05 * here ? runtime::Tangent::kExact : runtime::Tangent::kPositiveSemidefinite;
  }
}

std::optional<SurfacePose> PoseSolver::solve(VertexArray x, double first) {
  SurfacePose pose;
  double last_rms = INFINITY;
  for (double stiffness = first; stiffness <= 1.001 * kLastStiffness; stiffness *= kStiffen) {
    VertexArray moved = x;
    minimise(moved, stiffness, kBetween);
    const double rms = springs_.rms(moved);
    log::debug(fmt::format("springs of {:.0e}: missed by {:.3g} of the diagonal, energy {:.4g}", stiffness, rms,
                           elasticity_.energy(displacements(moved))));
    if (!is_sound(moved)) return std::nullopt;
    const bool gained = rms < (1 - kGain) * last_rms;
    if (!gained && stiffness > kFirstStiffness) break;
    x = moved;
    pose.stiffness = stiffness;
    if (rms <= kNear) break;
    last_rms = rms;
  }
  minimise(x, pose.stiffness, kLast);
  pose.rms = springs_.rms(x);
  pose.farthest = springs_.farthest(x, pose.worst);
  pose.energy = elasticity_.energy(displacements(x));
  pose.positions = x;
  return pose;
}

}  // namespace

VertexArray nearest_cage(std::span<const KnownPose> known, const VertexArray& posed) {
  double least = INFINITY;
  VertexArray nearest;
  for (const KnownPose& own : known) {
    const Eigen::Matrix4d motion = Eigen::umeyama(own.surface.transpose(), posed.transpose(), false);
    const auto moved = [&](const VertexArray& points) -> VertexArray {
      return (points * motion.topLeftCorner<3, 3>().transpose()).rowwise() + motion.topRightCorner<3, 1>().transpose();
    };
    const double gap = (moved(own.surface) - posed).squaredNorm();
    if (!(gap < least)) continue;
    least = gap;
    nearest = moved(own.cage);
  }
  return nearest;
}

SurfacePose pose_by_surface(const TetMesh& cage, const SurfaceMesh& surface, const Embedding& embedding,
                            const VertexArray& posed, const VertexArray& near, const std::string& name) {
  if (!posed.allFinite())
    throw InputError({name, "vertices", "finite numbers", "NaN or infinity", "export the pose again"});
  const UnitBody body = unit_body(cage, surface);
  const auto at_unit = [&](const VertexArray& points) -> VertexArray {
    return (points.rowwise() - body.centre) / body.diagonal;
  };
  const VertexArray places = at_unit(posed);
  PoseSolver solver(body, embedding, places);
  std::optional<SurfacePose> found = solver.solve(rigid_start(body.cage, body.surface, places), kFirstStiffness);
  if (!found) {
    found = solver.solve(at_unit(near), kFirstStiffness);
    std::optional<SurfacePose> other;
    if (!found || found->rms > kMissed) other = solver.solve(body.cage.vertices, kFirstFromRest);
    if (!found || (other && other->rms < found->rms)) found = std::move(other);
  }
  SurfacePose& pose = *found;
  pose.iterations = solver.iterations();
  pose.positions = (pose.positions * body.diagonal).rowwise() + body.centre;
  pose.energy *= body.diagonal * body.diagonal * body.diagonal;
  log::info(fmt::format(
      "{}: the cage misses the posed surface by {:.2g} % of the diagonal (RMS), {:.2g} % at most; {} iterations", name,
      100 * pose.rms, 100 * pose.farthest, pose.iterations));
  return pose;
}

}  // namespace exmat::precompute
