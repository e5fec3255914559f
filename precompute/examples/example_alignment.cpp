#include "precompute/examples/example_alignment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/geometry.h"
#include "common/mesh/nearest_point.h"
#include "precompute/alignment/coupled_bases.h"
#include "precompute/cache/stage_cache.h"

namespace exmat::precompute {
namespace {

constexpr double kGoodDoubt = 0.5;  // of a rest example that stands as the object does
constexpr double kSameMesh = 1e-6;  // a distance of vertices, over the body's size, that only the object's own mesh has
constexpr Eigen::Index kFewestLandmarks = 4;
constexpr double kMissedLandmarks = 0.25;  // share of their displacement, RMS, that coupled bases may miss unremarked

// [l x n] interpolation that takes the values at vertices.
SparseMatrix at_vertices(const std::vector<std::int32_t>& vertices, Eigen::Index n) {
  SparseMatrix points(std::ssize(vertices), n);
  for (std::size_t k = 0; k < vertices.size(); ++k) points.insert(static_cast<Eigen::Index>(k), vertices[k]) = 1;
  points.makeCompressed();
  return points;
}

SparseMatrix rows_of(const SparseMatrix& matrix, const std::vector<std::int32_t>& rows) {
  return at_vertices(rows, matrix.rows()) * matrix;
}

// [k x p] coefficients of the indicators of parts, of unit norm.
Eigen::MatrixXd part_coefficients(const LaplaceBasis& basis, const std::vector<const IndexVector*>& parts) {
  Eigen::MatrixXd indicators = Eigen::MatrixXd::Zero(basis.vertices.rows(), std::ssize(parts));
  for (std::size_t k = 0; k < parts.size(); ++k)
    for (const auto vertex : *parts[k]) indicators(vertex, static_cast<Eigen::Index>(k)) = 1;
  return (basis.eigenfunctions.transpose() * (basis.mass * indicators)).colwise().normalized();
}

}  // namespace

ExampleAligner::ExampleAligner(const AssetConfig& asset, const LaplaceBasis& object, const ObjectInput& object_input,
                               const ExampleInput& examples, StageCache& cache)
    : asset_(asset), object_(object), object_input_(object_input), examples_(examples), cache_(cache) {}

AlignedRest ExampleAligner::map_rest(const LaplaceBasis& basis, const Eigen::Matrix3d& rotation) const {
  AlignedRest rest;
  rest.basis = basis;
  rest.basis.vertices = basis.vertices * rotation.transpose();
  rest.rotation = rotation;
  rest.map = rest_map(object_, examples_.rest.mesh, rest.basis);
  rest.outcome.method = "rest_map";
  return rest;
}

// None if it is good as it stands, or a map of its vertices will say; else that of the object's own mesh, or of its
// landmarks, or the one that fits best.
RestTurn ExampleAligner::turn_of_rest(const LaplaceBasis& basis, RestPlacing& placing) const {
  if (asset_.alignment.frame == AlignmentFrame::kShared || examples_.rest.on_object.size() > 0) return {};
  const RestTurn none;
  if (placing.gap(none.rotation) <= kSameFrame && map_rest(basis, none.rotation).map.doubt <= kGoodDoubt) return none;
  const TetArray &our_tets = object_input_.mesh.tets, &their_tets = examples_.rest.mesh.tets;
  if (our_tets.rows() == their_tets.rows() && our_tets == their_tets) {
    const Eigen::Matrix3d R = procrustes_rotation(object_.vertices.transpose() * (object_.mass * basis.vertices));
    if ((basis.vertices * R.transpose() - object_.vertices).norm() < kSameMesh * object_.vertices.norm()) return {R};
  }
  std::vector<Eigen::Vector3d> ours, theirs;
  for (Eigen::Index k = 0; k < examples_.landmarks.rows(); ++k) {
    const auto on_object = examples_.landmarks(k, 0), on_rest = examples_.landmarks(k, examples_.rest.column);
    if (on_object < 0 || on_rest < 0) continue;
    ours.emplace_back(object_.vertices.row(on_object));
    theirs.emplace_back(basis.vertices.row(on_rest));
  }
  if (std::ssize(ours) < kFewestLandmarks) return placing.turn();
  const Eigen::Map<const Eigen::Matrix3Xd> a(ours.front().data(), 3, std::ssize(ours)),
      b(theirs.front().data(), 3, std::ssize(theirs));
  return {procrustes_rotation((a.colwise() - a.rowwise().mean()) * (b.colwise() - b.rowwise().mean()).transpose())};
}

// The map that the user gives instead of nearest points.
void ExampleAligner::use_vertex_map(AlignedRest& rest) const {
  const IndexVector& map = examples_.rest.on_object;
  if (map.size() == 0) return;
  SparseMatrix points(map.size(), rest.basis.vertices.rows());
  for (Eigen::Index v = 0; v < map.size(); ++v) {
    if (map[v] < 0)
      throw InputError({asset_.file.string(), "/alignment/map", "a vertex of the rest example for each of the object",
                        fmt::format("'-' for vertex {}", v + 1), "leave out vertices in maps of poses alone"});
    points.insert(v, map[v]) = 1;
  }
  const bool moves = asset_.alignment.frame != AlignmentFrame::kShared && !rest.map.same_frame;
  const VertexArray mapped = points * rest.basis.vertices;
  if (moves) {
    const Eigen::Matrix3d turn = procrustes_rotation(object_.vertices.transpose() * (object_.mass * mapped));
    rest.basis.vertices *= turn.transpose();
    rest.rotation = turn * rest.rotation;
  }
  rest.map.pull_back = points;
  rest.map.functional_map =
      polar_factor(object_.eigenfunctions.transpose() * (object_.mass * (points * rest.basis.eigenfunctions)));
  rest.outcome.method = "map";
}

AlignedRest ExampleAligner::align_rest() {
  const Eigen::Index m = functions();
  AlignedRest rest;
  if (examples_.object_is_rest) {
    rest.basis = object_;
    rest.map = identity_map(m, object_.vertices.rows());
    rest.outcome.method = "object";
  } else {
    const auto& mesh = examples_.rest.mesh;
    const Eigen::Index count = example_function_count(m, mesh.vertex_count());
    const auto basis = cache_.get(
        "eigenfunctions of the rest example", [&] { return laplace_basis(mesh, count, examples_.rest.name); }, mesh,
        count);
    RestPlacing placing(basis, mesh.tets, object_, object_input_.mesh.tets);
    const RestTurn turn = turn_of_rest(basis, placing);
    rest = map_rest(basis, turn.rotation);
    use_vertex_map(rest);
    if (asset_.alignment.method == AlignmentMethod::kCoupled) {
      rest.map.functional_map = coupled_map(examples_.rest, rest.basis);
      rest.map.by_functions = true;
      rest.outcome.method = "coupled";
    }
    rest.outcome.doubt = rest.map.doubt;
    rest.outcome.residual = placing.gap(rest.rotation);
    if (rest.outcome.method == "rest_map") placing.judge(turn, rest.outcome);
    log::info(fmt::format("rest example {}: {:.1f} % from the object, doubt {:.3f} (0 is certain)", examples_.rest.name,
                          100 * rest.outcome.residual, rest.map.doubt));
    if (!rest.rotation.isIdentity(kSameMesh))
      log::info(fmt::format("rest example {}: stands {} against the object; it and its poses are turned back",
                            examples_.rest.name, describe_turn(rest.rotation)));
  }
  rest.carried = {rest.map.functional_map * coefficients(rest.basis, rest.basis.vertices),
                  rest.map.pull_back * rest.basis.vertices};
  rest.outcome.name = examples_.rest.name;
  rest.free_poses = asset_.alignment.frame == AlignmentFrame::kFree ||
                    (asset_.alignment.frame == AlignmentFrame::kAuto && !rest.map.same_frame);
  if (asset_.alignment.frame == AlignmentFrame::kAuto)
    log::info(rest.free_poses ? "examples are rotated to the object's frame: the rest example does not coincide with it"
                              : "examples share the object's frame: the rest example coincides with it");
  return rest;
}

const AlignedShape& ExampleAligner::rest_shape(const AlignedRest& rest) {
  if (!rest_shape_) {
    rest_shape_ = aligned_shape(examples_.rest.mesh, 0, examples_.rest.name);
    rest_shape_->basis.vertices = rest.basis.vertices;
    rest_shape_->mesh.vertices = rest.basis.vertices;
    symmetry_ = rest_symmetry(*rest_shape_);
  }
  return *rest_shape_;
}

Correspondences ExampleAligner::correspondences(const AlignedRest& rest, const PoseInput& pose) const {
  const Eigen::Index rest_size = rest.basis.vertices.rows(), pose_size = pose.mesh.vertex_count();
  std::vector<std::int32_t> on_object, on_pose;
  if (pose.on_object.size() > 0) {
    for (Eigen::Index v = 0; v < pose.on_object.size(); ++v)
      if (pose.on_object[v] >= 0) {
        on_object.push_back(static_cast<std::int32_t>(v));
        on_pose.push_back(pose.on_object[v]);
      }
    return {rows_of(rest.map.pull_back, on_object), at_vertices(on_pose, pose_size)};
  }
  if (asset_.alignment.method == AlignmentMethod::kMap)
    throw InputError({asset_.file.string(), "/alignment/map", "a map for " + pose.name, "none",
                      "give one, or take another alignment.method"});
  std::vector<Eigen::Triplet<double>> entries;
  const auto& landmarks = examples_.landmarks;
  for (Eigen::Index k = 0; k < landmarks.rows(); ++k) {
    const auto at_rest = examples_.object_is_rest ? landmarks(k, 0) : landmarks(k, examples_.rest.column);
    if (landmarks(k, pose.column) < 0 || (at_rest < 0 && landmarks(k, 0) < 0)) continue;
    const int row = static_cast<int>(on_pose.size());
    if (at_rest >= 0)
      entries.emplace_back(row, at_rest, 1);
    else
      for (SparseMatrix::InnerIterator entry(rest.map.pull_back, landmarks(k, 0)); entry; ++entry)
        entries.emplace_back(row, static_cast<int>(entry.col()), entry.value());
    on_pose.push_back(landmarks(k, pose.column));
  }
  if (asset_.alignment.landmarks && std::ssize(on_pose) < kFewestLandmarks &&
      (asset_.alignment.method == AlignmentMethod::kLandmarks || !on_pose.empty()))
    throw InputError({asset_.alignment.landmarks->string(), "",
                      fmt::format("at least {} landmarks of example {}", kFewestLandmarks, pose.name),
                      std::to_string(on_pose.size()), "8 that do not lie in a plane are usual"});
  SparseMatrix on_rest(std::ssize(on_pose), rest_size);
  on_rest.setFromTriplets(entries.begin(), entries.end());
  return {on_rest, at_vertices(on_pose, pose_size)};
}

// The places in the list of landmarks of those that a pose has.
std::vector<Eigen::Index> ExampleAligner::landmark_numbers(const PoseInput& pose) const {
  std::vector<Eigen::Index> numbers;
  const auto& landmarks = examples_.landmarks;
  for (Eigen::Index k = 0; k < landmarks.rows(); ++k) {
    const auto at_rest = examples_.object_is_rest ? landmarks(k, 0) : landmarks(k, examples_.rest.column);
    if (landmarks(k, pose.column) >= 0 && (at_rest >= 0 || landmarks(k, 0) >= 0)) numbers.push_back(k + 1);
  }
  return numbers;
}

AlignedPose ExampleAligner::registered(const AlignedRest& rest, const PoseInput& pose, const Placing& placing) {
  AlignmentHints hints{rest.free_poses, correspondences(rest, pose), asset_.alignment.method != AlignmentMethod::kAuto,
                       rest.free_poses && asset_.alignment.frame == AlignmentFrame::kAuto};
  const bool is_mapped = pose.on_object.size() > 0;
  hints.landmarks_alone = hints.landmarks_alone || is_mapped;
  const AlignedShape shape = aligned_shape(pose.mesh, 0, pose.name, placing);
  const PoseAlignment alignment = precompute::align_pose(rest_shape(rest), symmetry_, shape, hints);
  AlignedPose aligned;
  aligned.positions = alignment.positions;
  aligned.outcome.name = pose.name;
  aligned.outcome.method = is_mapped ? "map" : hints.correspondences.count() > 0 ? "landmarks" : "registered";
  judge_pose(alignment, asset_.alignment.frame, rest.free_poses, aligned.outcome);
  judge_landmarks(alignment, landmark_numbers(pose), aligned.outcome);
  log::info(
      fmt::format("example {}: registered from {}, {:.2f} % from its surface, doubt {:.3f} (0 is certain), {} "
                  "competing poses",
                  pose.name, alignment.start, 100 * alignment.residual, alignment.doubt, alignment.competing_maps));
  return aligned;
}

Eigen::MatrixXd ExampleAligner::coupled_map(const PoseInput& example, const LaplaceBasis& basis) const {
  std::vector<std::int32_t> on_object, on_example;
  for (Eigen::Index k = 0; k < examples_.landmarks.rows(); ++k)
    if (examples_.landmarks(k, 0) >= 0 && examples_.landmarks(k, example.column) >= 0) {
      on_object.push_back(examples_.landmarks(k, 0));
      on_example.push_back(examples_.landmarks(k, example.column));
    }
  std::vector<const IndexVector*> object_parts, example_parts;
  for (std::size_t k = 0; k < example.parts.size(); ++k)
    if (example.parts[k].size() > 0) {
      object_parts.push_back(&examples_.parts[k]);
      example_parts.push_back(&example.parts[k]);
    }
  if (std::ssize(on_object) + std::ssize(object_parts) < kFewestLandmarks)
    throw InputError({asset_.file.string(), "/alignment",
                      fmt::format("at least {} landmarks or regions of example {}", kFewestLandmarks, example.name),
                      std::to_string(on_object.size() + object_parts.size()), "8 are usual"});
  const auto descriptors = [](const LaplaceBasis& functions, const std::vector<std::int32_t>& landmarks,
                              const std::vector<const IndexVector*>& parts) {
    const auto kernels = landmark_kernels(functions, at_vertices(landmarks, functions.vertices.rows()));
    Eigen::MatrixXd all(functions.eigenvalues.size(), kernels.cols() + std::ssize(parts));
    all << kernels, part_coefficients(functions, parts);
    return all;
  };
  CouplingProblem problem;
  problem.lambda_a = object_.eigenvalues;
  problem.lambda_b = basis.eigenvalues;
  problem.F = descriptors(object_, on_object, object_parts);
  problem.G = descriptors(basis, on_example, example_parts);
  return couple_bases(problem, descriptor_map(problem.lambda_a, problem.F, problem.lambda_b, problem.G))
      .functional_map();
}

// RMS by which the displacement carried to the object [n x 3] misses the example's landmarks' own, over the size of
// theirs; 0 without landmarks. `posed` are the pose's vertices in the rest example's frame.
double ExampleAligner::missed_landmarks(const AlignedRest& rest, const PoseInput& pose, const VertexArray& posed,
                                        const VertexArray& displacement) const {
  const VertexArray at_rest = rest.map.pull_back * rest.basis.vertices;
  double missed = 0, size = 0;
  for (Eigen::Index k = 0; k < examples_.landmarks.rows(); ++k) {
    const auto on_object = examples_.landmarks(k, 0), on_pose = examples_.landmarks(k, pose.column);
    if (on_object < 0 || on_pose < 0) continue;
    const Eigen::RowVector3d truth = posed.row(on_pose) - at_rest.row(on_object);
    missed += (displacement.row(on_object) - truth).squaredNorm();
    size += truth.squaredNorm();
  }
  return size > 0 ? std::sqrt(missed / size) : 0;
}

// [n x 3] positions of the pose at the object's vertices, in its own frame: registered from the displacement [n x 3] of
// the object that the coupled bases give, after which they are judged.
VertexArray ExampleAligner::registered_points(const AlignedRest& rest, const AlignedShape& pose,
                                              const VertexArray& displacement, const Eigen::Matrix3d& to_rest) {
  const TetMesh object{object_.vertices, object_input_.mesh.tets};
  const TetMesh& moving = rest_shape(rest).mesh;
  const SparseMatrix on_object = nearest_points(object, moving.vertices).interpolation(object);
  const VertexArray start = (moving.vertices + on_object * displacement) * to_rest;
  return rest.map.pull_back * Registration(moving, pose.mesh).run(start).positions;
}

AlignedPose ExampleAligner::coupled(const AlignedRest& rest, const PoseInput& pose, const Placing& placing) {
  AlignedPose aligned;
  const Eigen::Index size = example_function_count(functions(), pose.mesh.vertex_count());
  const AlignedShape shape = aligned_shape(pose.mesh, size, pose.name, placing);
  const LaplaceBasis basis = first_functions(shape.basis, size);
  const Eigen::MatrixXd map = coupled_map(pose, basis);
  const Eigen::MatrixXd &carried_rest = rest.carried.coefficients, carried = map * coefficients(basis, basis.vertices);
  Eigen::Matrix3d to_rest = Eigen::Matrix3d::Identity();
  if (rest.free_poses) to_rest = procrustes_rotation(carried_rest.transpose() * carried);
  const VertexArray displacement = object_.eigenfunctions * (carried * to_rest.transpose() - carried_rest);
  aligned.carried = CarriedShape{carried, registered_points(rest, shape, displacement, to_rest)};
  const MapScore score =
      score_map(ArapEnergy({object_.vertices, object_input_.mesh.tets}), map, object_.vertices + displacement);
  const VertexArray posed = shape.mesh.vertices * to_rest.transpose();
  const SurfaceTree found(object_.vertices + displacement, surface_triangles(object_input_.mesh.tets)),
      given(posed, surface_triangles(pose.mesh.tets));
  aligned.outcome.residual = std::sqrt(two_way_chamfer(found, given)) / rms_radius(object_);
  aligned.outcome.name = pose.name;
  aligned.outcome.method = "coupled";
  const double missed = missed_landmarks(rest, pose, posed, displacement);
  aligned.outcome.doubt = score.total() + missed;
  aligned.outcome.inverted_fraction = score.inverted;
  const std::string advice =
      "give landmarks or regions that tell the body's ends, sides and edges apart (slabs across a "
      "bar do not), or take alignment.method \"auto\"";
  judge_doubt(aligned.outcome, advice);
  judge_residual(aligned.outcome, advice);
  if (missed > kMissedLandmarks)
    object_to(aligned.outcome, AlignmentVerdict::kDoubtful,
              fmt::format("what was carried over misses the displacement of the landmarks by {:.0f} %; {}",
                          100 * missed, advice));
  object_to(aligned.outcome, AlignmentVerdict::kDoubtful,
            "nothing in coupled bases shows for certain that they are right; compare with alignment.method \"auto\"");
  return aligned;
}

AlignedPose ExampleAligner::align_pose(const AlignedRest& rest, const PoseInput& pose) {
  const PoseScale scale =
      scale_of_pose(tet_volumes(pose.mesh).sum(), tet_volumes(examples_.rest.mesh).sum(), pose.same_connectivity);
  const Placing placing{scale.size, rest.rotation};
  AlignedPose aligned;
  if (pose.same_connectivity) {
    aligned.positions = placed_positions(pose.mesh, placing);
    aligned.outcome = {pose.name, "same_connectivity", rest.outcome.residual, rest.outcome.doubt,
                       pose.inverted_fraction};
    if (!pose.fault.empty()) object_to(aligned.outcome, AlignmentVerdict::kDoubtful, pose.fault);
  } else {
    const AlignmentConfig& config = asset_.alignment;
    const bool couples = config.method == AlignmentMethod::kCoupled;
    aligned = cache_.get(
        "alignment of " + pose.name,
        [&] { return couples ? coupled(rest, pose, placing) : registered(rest, pose, placing); }, object_,
        object_input_.mesh.tets, rest, examples_.rest.mesh, examples_.object_is_rest, pose.mesh, pose.on_object,
        landmarks_of(pose), config.landmarks.has_value(), examples_.parts, pose.parts, config.method, config.frame);
  }
  aligned.scale = scale;
  if (!scale.objection.empty()) object_to(aligned.outcome, AlignmentVerdict::kRefused, scale.objection);
  return aligned;
}

// [l x 3] of the object, the rest example and the pose: what its alignment sees of them.
IndexMatrix ExampleAligner::landmarks_of(const PoseInput& pose) const {
  const Eigen::Index rows = examples_.landmarks.rows();
  IndexMatrix landmarks = IndexMatrix::Constant(rows, 3, -1);
  if (rows == 0) return landmarks;
  landmarks.col(0) = examples_.landmarks.col(0);
  if (examples_.rest.column >= 0) landmarks.col(1) = examples_.landmarks.col(examples_.rest.column);
  landmarks.col(2) = examples_.landmarks.col(pose.column);
  return landmarks;
}

}  // namespace exmat::precompute
