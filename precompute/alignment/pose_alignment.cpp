#include "precompute/alignment/pose_alignment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"
#include "common/mesh/nearest_point.h"
#include "precompute/alignment/landmark_check.h"
#include "precompute/alignment/rigid_fit.h"
#include "precompute/alignment/spectral_tree.h"
#include "precompute/shape_space/transfer.h"

namespace exmat::precompute {
namespace {

constexpr Eigen::Index kTreeFunctions = 20, kStartFunctions = 30;
constexpr std::size_t kTreeMaps = 24;
constexpr std::size_t kEntrants = 12, kPolished = 6;  // maps whose registration is begun; those that are gone on with
// Turns of the whole pose that it may begin with in a shared frame [rad].
constexpr double kLeastTurned = 0.15, kMostTurned = 1.4;
constexpr std::size_t kTurnedStarts = 2, kAnyTurns = 4;  // in a shared frame, in another one
constexpr double kCompeting = 1.4;                       // times the least F
constexpr double kCompetingFloor = 0.003;                // added to it: below, fits differ by their tessellation alone
constexpr double kSamePose = 0.25;                       // difference of displacements, relative to the larger
constexpr double kSameStart = 0.1;                       // difference of starts, relative to the body's size
constexpr double kNoPose = 0.03;             // a displacement from rest, relative to the body's size, that is none
constexpr double kClearlyFarther = 1.2;      // times the displacement of the pose that is taken
constexpr Eigen::Index kFewLandmarks = 100;  // more pairs than this are a dense map
constexpr int kTurningRounds = 4;            // of landmarks on a body of revolution
// Weights of doubt: docs/alignment.md, "What the user is told".
constexpr double kDoubtOfMap = 0.6, kDoubtOfResidual = 10, kDoubtOfLandmarks = 2, kDoubtOfVolume = 0.5;
constexpr double kVolumeOfPoses = 0.12;     // change of volume that a pose may have, as in example_scale.cpp
constexpr double kAmbiguous = 1.15;         // times the misfit that is taken, in a shared frame
constexpr double kMirrorMargin = 0.5;       // of the best F, from which on a mirror image is believed
constexpr double kMirrorWorthwhile = 0.03;  // F above which it is looked for
constexpr double kMirrorResidual = 0.05;    // of a mirror image that fits
constexpr double kSqueezed = 2;             // factor of a tet's volume that no pose has
constexpr double kUncovered = 0.15;         // distance from the other surface, over the body's size

// Start of a registration.
struct Start {
  std::string name;
  VertexArray positions;
  double J = 0;
  bool sure = false;  // gone on with, however it begins
};

// A registered pose, and the displacement of the rest example to it in the frame of the rest.
struct Fit {
  std::string start;
  Registered registered;
  VertexArray displacement;
  double size = 0;    // of the displacement
  double motion = 0;  // the same with the rotation of the whole pose
};

class PoseAligner {
 public:
  PoseAligner(const AlignedShape& rest, const Symmetry& symmetry, const AlignedShape& pose, const AlignmentHints& hints)
      : rest_(rest),
        symmetry_(symmetry),
        pose_(pose),
        hints_(hints),
        size_(rms_radius(rest.basis)),
        registration_(rest.mesh, pose.mesh, pairs()),
        zoom_out_(rest, pose, zoom_out_sizes(std::min(functions(rest), functions(pose)))) {}

  PoseAlignment align();

 private:
  static Eigen::Index functions(const AlignedShape& shape) { return shape.basis.eigenvalues.size(); }
  bool has_landmarks() const { return hints_.correspondences.count() > 0; }
  bool has_dense_map() const { return hints_.correspondences.count() > kFewLandmarks; }
  PointPairs pairs() const;
  VertexArray laid_over(const PointPairs& pairs, Eigen::Index functions) const;
  double norm(const VertexArray& field) const {
    return std::sqrt(std::max(0.0, (field.transpose() * (rest_.basis.mass * field)).trace()));
  }
  VertexArray centred(const VertexArray& field) const {
    return field.rowwise() - (rest_.basis.mass * field).colwise().sum();
  }

  std::vector<Start> mapped_starts();
  std::vector<Start> starts_in_space() const;
  void add_map(const std::string& name, const Eigen::MatrixXd& map, std::vector<Start>& starts);
  Eigen::MatrixXd spatial_map(const VertexArray& rest_positions) const;
  void add_landmark_starts(std::vector<Start>& starts) const;
  void add_turned_starts(std::vector<Start>& starts) const;
  std::vector<Start> distinct(std::vector<Start> starts) const;
  Fit fit(const std::string& start, Registered registered) const;
  std::vector<Fit> polish(const std::vector<Start>& starts) const;
  bool same_pose(const Fit& a, const Fit& b) const;
  std::vector<Fit> distinct_poses(std::vector<Fit> fits) const;
  std::vector<Fit> symmetric_copies(const Fit& taken) const;
  double limit(const std::vector<Fit>& fits) const;
  double way_from_rest(const Fit& pose) const { return hints_.frame_unsaid ? pose.motion : pose.size; }
  const Fit& choose(const std::vector<Fit>& poses) const;
  Registered turn_to_landmarks(VertexArray positions) const;
  Registered settle(const VertexArray& positions) const;
  double change_of_volume() const;
  std::optional<double> mirror_residual(double misfit) const;
  PoseAlignment result(const Fit& taken, const std::vector<Fit>& poses) const;

  const AlignedShape& rest_;
  const Symmetry& symmetry_;
  const AlignedShape& pose_;
  const AlignmentHints& hints_;
  double size_;
  Registration registration_;
  ZoomOut zoom_out_;
  // The best map of the starts that turn the body inside out: a mirror image would begin with it.
  VertexArray reflected_start_;
  double reflected_score_ = std::numeric_limits<double>::infinity();
};

// Values of the pose at its point nearest to each vertex of the rest example, as a map of functions.
Eigen::MatrixXd PoseAligner::spatial_map(const VertexArray& rest_positions) const {
  const auto nearest = nearest_points(pose_.mesh, rest_positions);
  return map_of_points(rest_, pose_, nearest.interpolation(pose_.mesh),
                       std::min({kTreeFunctions, functions(rest_), functions(pose_)}));
}

void PoseAligner::add_map(const std::string& name, const Eigen::MatrixXd& map, std::vector<Start>& starts) {
  const Eigen::Index size = std::min(kStartFunctions, map.rows());
  const VertexArray carried = carried_positions(rest_, pose_, map.topLeftCorner(size, size));
  const MapScore score = score_map(registration_.arap(), map, carried);
#pragma omp critical(exmat_pose_starts)
  {
    starts.push_back({name, carried, score.total()});
    if (score.inverted > 0.5 && score.orthogonality < reflected_score_) {
      reflected_score_ = score.orthogonality;
      reflected_start_ = carried;
    }
  }
}

std::vector<Start> PoseAligner::mapped_starts() {
  struct Named {
    std::string name;
    Eigen::MatrixXd map;
    bool zoom;
  };
  std::vector<Named> maps;
  const Eigen::Index available = std::min({kTreeFunctions, functions(rest_), functions(pose_)});
  if (!hints_.landmarks_alone) {
    if (hints_.free_frame) {
      const Eigen::Matrix3d ours = principal_axes(rest_.basis), theirs = principal_axes(pose_.basis);
      for (const Eigen::Vector3d& signs : {Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(1, -1, -1),
                                           Eigen::Vector3d(-1, 1, -1), Eigen::Vector3d(-1, -1, 1)}) {
        const Eigen::Matrix3d R = theirs * signs.asDiagonal() * ours.transpose();
        maps.push_back({"principal axes", spatial_map(rest_.mesh.vertices * R.transpose()), true});
      }
    } else {
      maps.push_back({"spatial", spatial_map(rest_.mesh.vertices), false});
      maps.push_back({"spatial, ZoomOut", maps.back().map, true});
    }
    for (auto& map : spectral_maps(rest_, pose_, available, kTreeMaps))
      maps.push_back({"spectral", std::move(map), true});
  }
  if (has_landmarks() && !has_dense_map())
    maps.push_back(
        {"landmark map",
         landmark_map(rest_, hints_.correspondences.on_rest, pose_, hints_.correspondences.on_pose, available), true});
  std::vector<Start> starts;
  // In order, so that ties do not depend on threads.
  std::vector<Eigen::MatrixXd> refined(maps.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t k = 0; k < maps.size(); ++k) refined[k] = maps[k].zoom ? zoom_out_.refine(maps[k].map) : maps[k].map;
  for (std::size_t k = 0; k < maps.size(); ++k) add_map(maps[k].name, refined[k], starts);
  std::ranges::stable_sort(starts, {}, &Start::J);
  return starts;
}

// [n_0 x 3] the rest example laid over the pairs rigidly, and as its first `functions` functions fit them best.
VertexArray PoseAligner::laid_over(const PointPairs& pairs, Eigen::Index functions) const {
  const VertexArray at_rest = pairs.points * rest_.mesh.vertices;
  const Eigen::RowVector3d from = at_rest.colwise().mean(), to = pairs.targets.colwise().mean();
  const Eigen::Matrix3d R =
      procrustes_rotation((pairs.targets.rowwise() - to).transpose() * (at_rest.rowwise() - from));
  VertexArray positions = (rest_.mesh.vertices.rowwise() - from) * R.transpose();
  positions.rowwise() += to;
  if (functions == 0) return positions;
  Eigen::MatrixXd values(pairs.count(), functions + 1);
  values << pairs.points * rest_.basis.eigenfunctions.leftCols(functions), Eigen::VectorXd::Ones(pairs.count());
  const Eigen::MatrixXd misses = pairs.targets - pairs.points * positions;
  const Eigen::MatrixXd fitted = values.colPivHouseholderQr().solve(misses);
  positions += rest_.basis.eigenfunctions.leftCols(functions) * fitted.topRows(functions);
  positions.rowwise() += fitted.row(functions);
  return positions;
}

PointPairs PoseAligner::pairs() const {
  if (!has_landmarks()) return {};
  return {hints_.correspondences.on_rest, hints_.correspondences.on_pose * pose_.mesh.vertices};
}

void PoseAligner::add_landmark_starts(std::vector<Start>& starts) const {
  const Eigen::Index functions = has_dense_map() ? kStartFunctions : 0;
  starts.push_back({"correspondences", laid_over(pairs(), std::min(functions, this->functions(rest_))), 0, true});
}

// Starts that need no map.
std::vector<Start> PoseAligner::starts_in_space() const {
  std::vector<Start> starts;
  if (has_landmarks()) add_landmark_starts(starts);
  if (!hints_.landmarks_alone) {
    starts.push_back({"rest", rest_.mesh.vertices, 0, true});
    add_turned_starts(starts);
  }
  return starts;
}

// A pose that is held at one end is turned as a whole, though its frame is the object's. In another frame any turn may
// be right.
void PoseAligner::add_turned_starts(std::vector<Start>& starts) const {
  const RigidFitter fitter(body_surface(rest_.basis, rest_.mesh.tets), body_surface(pose_.basis, pose_.mesh.tets));
  const bool any = hints_.free_frame;
  std::size_t added = 0;
  for (const RigidFit& fit : fitter.fits(false)) {
    const double turn = Eigen::AngleAxisd(fit.rotation).angle();
    if ((!any && turn > kMostTurned) || turn < kLeastTurned || added == (any ? kAnyTurns : kTurnedStarts)) continue;
    starts.push_back({"turned", rest_.mesh.vertices * fit.rotation.transpose(), 0});
    ++added;
  }
}

// The first of each.
std::vector<Start> PoseAligner::distinct(std::vector<Start> starts) const {
  std::vector<Start> best;
  for (Start& start : starts) {
    const bool is_new = std::ranges::none_of(best, [&](const Start& other) {
      return norm(centred(start.positions - other.positions)) < kSameStart * size_;
    });
    if (is_new) best.push_back(std::move(start));
  }
  return best;
}

Fit PoseAligner::fit(const std::string& start, Registered registered) const {
  VertexArray positions = centred(registered.positions);
  const double motion = norm(positions - rest_.mesh.vertices);
  if (hints_.free_frame)
    positions *= procrustes_rotation(rest_.mesh.vertices.transpose() * (rest_.basis.mass * positions)).transpose();
  VertexArray displacement = positions - rest_.mesh.vertices;
  const double size = norm(displacement);
  return {start, std::move(registered), std::move(displacement), size, motion};
}

// All are begun. Those that are sure and the best of the others are gone on with.
std::vector<Fit> PoseAligner::polish(const std::vector<Start>& starts) const {
  std::vector<Registered> begun(starts.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t k = 0; k < starts.size(); ++k) begun[k] = registration_.begin(starts[k].positions);
  std::vector<std::size_t> order(starts.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t k) { return begun[k].objective(); });
  std::vector<std::size_t> kept;
  std::size_t others = 0;
  for (const std::size_t k : order)
    if (starts[k].sure || others++ < kPolished) kept.push_back(k);
  std::vector<Fit> fits(kept.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < kept.size(); ++i)
    fits[i] = fit(starts[kept[i]].name, registration_.finish(begun[kept[i]].positions));
  return fits;
}

bool PoseAligner::same_pose(const Fit& a, const Fit& b) const {
  return norm(a.displacement - b.displacement) < std::max(kSamePose * std::max(a.size, b.size), kNoPose * size_);
}

// The best fit of each pose, best first.
std::vector<Fit> PoseAligner::distinct_poses(std::vector<Fit> fits) const {
  std::stable_sort(fits.begin(), fits.end(),
                   [](const Fit& a, const Fit& b) { return a.registered.objective() < b.registered.objective(); });
  std::vector<Fit> poses;
  for (Fit& candidate : fits)
    if (std::ranges::none_of(poses, [&](const Fit& pose) { return same_pose(pose, candidate); }))
      poses.push_back(std::move(candidate));
  return poses;
}

double PoseAligner::limit(const std::vector<Fit>& poses) const {
  const double least = poses.front().registered.objective();
  return std::max(kCompeting * least, least + kCompetingFloor);
}

// Landmarks take the pose that fits best. Without, the one nearest to rest is taken of those that fit, as it stands if
// the frame is not said.
const Fit& PoseAligner::choose(const std::vector<Fit>& poses) const {
  if (has_landmarks()) return poses.front();
  const double most = limit(poses);
  const Fit* taken = &poses.front();
  for (const Fit& pose : poses)
    if (pose.registered.objective() <= most && way_from_rest(pose) < way_from_rest(*taken)) taken = &pose;
  return *taken;
}

// The same surface reached from the rest example turned upon itself.
std::vector<Fit> PoseAligner::symmetric_copies(const Fit& taken) const {
  std::vector<Fit> copies(symmetry_.rotations.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t k = 0; k < copies.size(); ++k) {
    const VertexArray turned = rest_.mesh.vertices * symmetry_.rotations[k].transpose();
    const auto nearest = nearest_points(rest_.mesh, turned);
    const VertexArray start = nearest.interpolation(rest_.mesh) * taken.registered.positions;
    copies[k] = fit(taken.start + ", turned", registration_.refine(start));
  }
  return copies;
}

// Distance of the pose's surface from that of the rest example's mirror image, bent over it, where that fits and the
// rest example does not. A body that is its own mirror image fits by either, if at all.
std::optional<double> PoseAligner::mirror_residual(double misfit) const {
  if (misfit < kMirrorWorthwhile || symmetry_.mirrored || reflected_start_.rows() == 0) return std::nullopt;
  TetMesh mirrored = rest_.mesh;
  mirrored.vertices.col(0) *= -1;
  mirrored.tets.col(0).swap(mirrored.tets.col(1));
  const Registered registered = Registration(mirrored, pose_.mesh).run(reflected_start_);
  const double residual = std::sqrt(registered.chamfer) / size_;
  if (residual > kMirrorResidual || registered.misfit() > kMirrorMargin * misfit) return std::nullopt;
  return residual;
}

PoseAlignment PoseAligner::result(const Fit& taken, const std::vector<Fit>& poses) const {
  PoseAlignment alignment;
  const Registered& registered = taken.registered;
  const SparseMatrix points = nearest_points(pose_.mesh, registered.positions).interpolation(pose_.mesh);
  const Eigen::Index size = std::min({kTreeFunctions, functions(rest_), functions(pose_)});
  alignment.positions = registered.positions;
  alignment.start = taken.start;
  alignment.residual = std::sqrt(registered.chamfer) / size_;
  alignment.missed_landmarks = registered.landmark_rms / size_;
  const double J = MapScore{orthogonality_defect(map_of_points(rest_, pose_, points, size)), registered.distortion,
                            registered.inverted}
                       .total();
  const double grown = change_of_volume();
  alignment.doubt = kDoubtOfMap * (J + kDoubtOfResidual * alignment.residual) +
                    kDoubtOfLandmarks * alignment.missed_landmarks +
                    kDoubtOfVolume * std::max(0.0, grown - std::log1p(kVolumeOfPoses));
  alignment.inverted_fraction = registered.inverted;
  alignment.displacement = taken.size / size_;
  const Eigen::Matrix3d turn =
      procrustes_rotation(registered.positions.transpose() * (rest_.basis.mass * rest_.mesh.vertices));
  alignment.turn = Eigen::AngleAxisd(turn).angle();
  const double most = limit(poses);
  // Turns of a body of revolution about its axis are many and near; the least of them is what is meant.
  const double farther = symmetry_.of_revolution ? 1 : kClearlyFarther;
  for (const Fit& pose : poses) {
    if (same_pose(pose, taken) || pose.registered.objective() > most) continue;
    ++alignment.competing_maps;
    const bool as_good = pose.registered.objective() <= kAmbiguous * taken.registered.objective() + kCompetingFloor;
    if (!has_landmarks() && (hints_.free_frame || (as_good && pose.size < farther * taken.size)))
      alignment.ambiguous = true;
  }
  alignment.hides_twist = symmetry_.of_revolution && !has_landmarks();
  const auto mirror = mirror_residual(registered.misfit());
  alignment.mirrored = mirror.has_value();
  alignment.mirror_residual = mirror.value_or(0);
  const SurfaceTree found = registration_.moved_surface(registered.positions);
  alignment.uncovered = std::max(uncovered_share(found, registration_.fixed_surface(), kUncovered * size_),
                                 uncovered_share(registration_.fixed_surface(), found, kUncovered * size_));
  alignment.squeezed_fraction = registration_.arap().squeezed_fraction(registered.positions, kSqueezed);
  return alignment;
}

// A landmark pulls at one point, which gives way by itself: the body's turn lags behind. What the landmarks are off by
// is therefore asked of the body's first functions, round after round.
Registered PoseAligner::turn_to_landmarks(VertexArray positions) const {
  const PointPairs exact = pairs();
  const auto smooth = rest_.basis.eigenfunctions.leftCols(std::min(kTreeFunctions, functions(rest_)));
  Eigen::MatrixXd low_pass = (exact.points * smooth) * (smooth.transpose() * rest_.basis.mass);
  low_pass.rowwise() += Eigen::RowVectorXd(Eigen::RowVectorXd::Ones(low_pass.cols()) * rest_.basis.mass);
  for (int round = 0; round < kTurningRounds; ++round) {
    const VertexArray misses = exact.targets - exact.points * positions;
    const Registration registration(rest_.mesh, pose_.mesh, {low_pass.sparseView(), low_pass * positions + misses});
    positions = registration.refine(positions).positions;
  }
  return registration_.assess(positions);
}

// Landmarks and maps name vertices, near which a point belongs: they decide which pose it is, the surface where it
// lies. A body of revolution slips, so there they stay.
Registered PoseAligner::settle(const VertexArray& positions) const {
  if (has_landmarks() && !symmetry_.of_revolution)
    return registration_.assess(Registration(rest_.mesh, pose_.mesh).run(positions).positions);
  if (has_landmarks() && !has_dense_map()) return turn_to_landmarks(positions);
  return registration_.refine(positions);
}

double PoseAligner::change_of_volume() const {
  return std::abs(std::log(tet_volumes(pose_.mesh).sum() / tet_volumes(rest_.mesh).sum()));
}

PoseAlignment PoseAligner::align() {
  std::vector<Start> starts = distinct(mapped_starts());
  if (starts.size() > kEntrants) starts.resize(kEntrants);
  for (Start& start : starts_in_space()) starts.push_back(std::move(start));
  std::vector<Fit> poses = distinct_poses(polish(starts));
  if (!has_landmarks()) {
    for (Fit& copy : symmetric_copies(choose(poses))) poses.push_back(std::move(copy));
    poses = distinct_poses(std::move(poses));
  }
  const Fit& chosen = choose(poses);
  const Registered settled = settle(chosen.registered.positions);
  PoseAlignment alignment = result(fit(chosen.start, settled), poses);
  // A body of revolution slips, and would turn back; one that grows would shrink.
  if (!symmetry_.of_revolution && change_of_volume() <= std::log1p(kVolumeOfPoses))
    alignment.positions = Registration(rest_.mesh, pose_.mesh).relaxed(settled);
  return alignment;
}

// The vertex that weighs most in each row.
std::vector<std::int32_t> vertices_of(const SparseMatrix& points) {
  std::vector<std::int32_t> vertices;
  for (Eigen::Index row = 0; row < points.rows(); ++row) {
    double most = -1;
    std::int32_t vertex = 0;
    for (SparseMatrix::InnerIterator entry(points, row); entry; ++entry)
      if (entry.value() > most) {
        most = entry.value();
        vertex = static_cast<std::int32_t>(entry.col());
      }
    vertices.push_back(vertex);
  }
  return vertices;
}

// Landmarks that contradict the others; none of a dense map.
std::vector<std::size_t> wrong_landmarks(const AlignedShape& rest, const AlignedShape& pose,
                                         const Correspondences& landmarks) {
  if (landmarks.count() > kFewLandmarks) return {};
  return contradicting_landmarks(rest.mesh, vertices_of(landmarks.on_rest), pose.mesh, vertices_of(landmarks.on_pose));
}

Correspondences without_rows(const Correspondences& all, const std::vector<std::size_t>& left_out) {
  SparseMatrix kept(all.count() - std::ssize(left_out), all.count());
  Eigen::Index row = 0;
  for (Eigen::Index k = 0; k < all.count(); ++k)
    if (std::ranges::find(left_out, static_cast<std::size_t>(k)) == left_out.end()) kept.insert(row++, k) = 1;
  return {kept * all.on_rest, kept * all.on_pose};
}

}  // namespace

PoseAlignment align_pose(const AlignedShape& rest, const Symmetry& symmetry, const AlignedShape& pose,
                         const AlignmentHints& hints) {
  const std::vector<std::size_t> wrong = wrong_landmarks(rest, pose, hints.correspondences);
  if (wrong.empty()) return PoseAligner(rest, symmetry, pose, hints).align();
  AlignmentHints others = hints;
  others.correspondences = without_rows(hints.correspondences, wrong);
  PoseAlignment alignment = PoseAligner(rest, symmetry, pose, others).align();
  const VertexArray misses = hints.correspondences.on_rest * alignment.positions -
                             hints.correspondences.on_pose * VertexArray(pose.mesh.vertices);
  for (const std::size_t k : wrong)
    alignment.left_out.push_back({k, misses.row(static_cast<Eigen::Index>(k)).norm() / rms_radius(rest.basis)});
  return alignment;
}

}  // namespace exmat::precompute
