#include "runtime/sim/contact/contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

namespace exmat::runtime {
namespace {

constexpr int kLeafVertices = 16;
constexpr int kBatch = 48;  // vertices, or factors of the stiffness: they stay in the first-level cache

/// True if the distance that a candidate feels changes by no more than its vertex goes: not by a side plane, nor over
/// the border of ground.
bool has_steady_distance(const PlacedObstacle& placed, const ContactCandidate& candidate) {
  return candidate.passage.kind == Passage::Kind::kNearest &&
         !std::holds_alternative<HeightFieldShape>(placed.obstacle->shape);
}

void set_x(const Eigen::VectorXd& of, ContactWorkspace& workspace) {
  std::copy(of.begin(), of.end(), workspace.x.data());
}

}  // namespace

/// Some vertices at a time, as the kernels take them.
struct ContactSet::Batch {
  void add(int vertex, std::size_t candidate) {
    candidates[static_cast<std::size_t>(count)] = candidate;
    vertices[static_cast<std::size_t>(count++)] = vertex;
  }
  bool full() const { return count == kBatch; }

  int count = 0;
  std::array<int, kBatch> vertices;
  std::array<std::size_t, kBatch> candidates;
  Eigen::Matrix<double, 3, kBatch> products;  // with the rows of each vertex
  Eigen::Matrix<double, 3, kBatch> vectors;   // frame of the body, that its rows are summed by
  Eigen::Matrix<double, 6, kBatch> rigid;     // of the same, force and torque, world
};

double way_bound(double reach, const MovementBound& movement, const BodyPose& pose, const Placement& from,
                 const Eigen::VectorXd& from_q) noexcept {
  return (pose.position - from.position).norm() +
         (pose.rotation - from.rotation).norm() * (reach + movement.of(pose.q)) + movement.of(pose.q - from_q);
}

ContactWorkspace::ContactWorkspace(const ContactSet& set, std::size_t obstacle_count)
    : ContactWorkspace(set.vertices(), set.modes(), obstacle_count) {}

ContactWorkspace::ContactWorkspace(Eigen::Index vertices, Eigen::Index modes, std::size_t obstacle_count)
    : obstacles(obstacle_count),
      candidates(obstacle_count * static_cast<std::size_t>(vertices)),
      clearances(candidates.size()),
      is_left(candidates.size()),
      loaded(candidates.size()),
      planes(candidates.size()),
      first_q(modes),
      x(modes),
      loads(modes),
      factors(kBatch * padded(6 + modes)),
      squares(padded(6 + modes) * padded(6 + modes)) {
  set_zero(modes);
}

bool ContactWorkspace::add_candidate(std::size_t number, double own_potential) noexcept {
  const ContactCandidate& candidate = candidates[number];
  if (candidate.normal_force > 0) {
    ++touching;
    stiffness += candidate.normal_stiffness();
  }
  if (!candidate.is_loaded()) return false;
  loaded[loaded_count++] = number;
  force += candidate.force;
  torque += candidate.arm.cross(candidate.force);
  potential += own_potential;
  return true;
}

void ContactWorkspace::refresh_friction(FrictionChange& change) noexcept {
  for (const std::size_t number : std::span(loaded).first(loaded_count)) {
    ContactCandidate& candidate = candidates[number];
    change.refresh(obstacles[static_cast<std::size_t>(candidate.obstacle)].obstacle->friction, candidate);
  }
}

double ContactWorkspace::start_energy(const ContactState& state) const noexcept {
  double sum = 0, released = 0;
  for (const ContactCandidate& candidate : std::span(candidates).first(candidate_count)) {
    sum += stored_energy(candidate, candidate.start_gap, candidate.carried);
    released += candidate.released;
  }
  return state.first_step ? sum : std::min(sum, state.account + released);
}

double ContactWorkspace::end_energy(const Eigen::Vector3d& position) const noexcept {
  double sum = 0;
  for (const ContactCandidate& candidate : std::span(candidates).first(candidate_count))
    sum += stored_energy(candidate, candidate.gap, position + candidate.arm);
  return std::min(ContactState::kUnbounded, sum);
}

ContactSet::ContactSet(const ContactData& data, const Eigen::Vector3d& origin, double mass) {
  const auto count = static_cast<int>(data.areas.size());
  const VertexArray rest = data.positions.rowwise() - origin.transpose();
  tree_ = DeformationTree(IndexVector::LinSpaced(count, 0, count - 1), rest, data.basis, kLeafVertices);
  data_indices_ = tree_.order();
  const bool numbered = data.vertices.size() == count;
  for (const int index : data_indices_)
    object_vertices_.push_back(numbered ? static_cast<int>(data.vertices[index]) : index);
  rest_ = places_ = rest(data_indices_, Eigen::all);
  areas_ = data.areas(data_indices_);
  if (count > 0) load_ = mass / areas_.sum();
  rows_ = VertexRows(data.basis, data_indices_);
  if (count > 0) reach_ = rest.rowwise().norm().maxCoeff();
}

void ContactSet::move(const VertexArray& positions, const VertexArray& velocities) {
  places_ = positions;
  is_moved_ = true;
  rows_.set_one_mode(velocities);
  if (places_.rows() == 0) return;
  reach_ = places_.rowwise().norm().maxCoeff();
  tree_.fit(velocities.rowwise().norm().maxCoeff(),
            [this](int vertex, Eigen::AlignedBox3d& box) { box.extend(places_.row(vertex).transpose()); });
}

ContactState ContactSet::make_state(std::size_t obstacle_count) const {
  return {std::vector<HeldContact>(obstacle_count * static_cast<std::size_t>(vertices())), 0,
          NearPlanes(vertices(), modes(), obstacle_count)};
}

double ContactSet::travel_bound(const BodyPose& pose, const BodyVelocity& velocity, double time_step) const noexcept {
  const double reach = reach_ + tree_.movement().of(pose.q);
  return time_step * (velocity.linear.norm() + velocity.angular.norm() * reach + tree_.movement().of(velocity.v));
}

Eigen::Vector3d ContactSet::place(int vertex, const AlignedArray& q) const noexcept {
  Eigen::RowVector3d moved;
  rows_.products(&vertex, 1, q, moved.data());
  return (moved + places_.row(vertex)).transpose();
}

bool ContactSet::may_meet(const PlacedObstacle& obstacle, const BodyPose& pose) const noexcept {
  const DeformationTree::Ball all = tree_.ball(0, pose.q, pose.q.norm());
  return obstacle.may_meet(pose.position + pose.rotation * all.centre, all.radius, 0);
}

bool ContactSet::body_is_near(const BodyPose& pose, double margin, const ContactWorkspace& workspace) const noexcept {
  const DeformationTree::Node& all = tree_.nodes().front();
  const Eigen::Vector3d centre = pose.position + pose.rotation * all.centre;
  const double radius = all.radius + tree_.movement().of(pose.q);
  return std::any_of(workspace.obstacles.begin(), workspace.obstacles.end(),
                     [&](const PlacedObstacle& obstacle) { return obstacle.may_meet(centre, radius, margin); });
}

/// Obstacles that go through the body in the step rather than up to it.
void ContactSet::find_sweeping(const BodyPose& pose, ContactWorkspace& workspace) const noexcept {
  for (PlacedObstacle& placed : workspace.obstacles) {
    if (!placed.obstacle->motion.moves()) continue;
    const double reach = reach_ + tree_.movement().of(pose.q);
    placed.sweeps = placed.sweep(pose.position, reach) > kSweep * shortest_passage(placed.obstacle->shape);
  }
}

bool ContactSet::is_near(int node, const BodyPose& pose, double q_norm, double margin,
                         const ContactWorkspace& workspace) const noexcept {
  const DeformationTree::Ball ball = tree_.ball(node, pose.q, q_norm);
  const Eigen::Vector3d centre = pose.position + pose.rotation * ball.centre;
  const double radius = ball.radius;
  return std::any_of(workspace.obstacles.begin(), workspace.obstacles.end(),
                     [&](const PlacedObstacle& obstacle) { return obstacle.may_meet(centre, radius, margin); });
}

Eigen::Vector3d ContactSet::world_arm(int vertex, const BodyPose& pose) const noexcept {
  const Eigen::Vector3d moved = places_.row(vertex).transpose() + basis_rows(vertex).lazyProduct(pose.q);
  return pose.rotation * moved;
}

Eigen::Vector3d ContactSet::world_velocity(int vertex, const Eigen::Vector3d& arm, const BodyPose& pose,
                                           const BodyVelocity& velocity) const noexcept {
  const Eigen::Vector3d own = basis_rows(vertex).lazyProduct(velocity.v);
  return velocity.at(arm) + pose.rotation * own;
}

/// The rows of its vertices times x.
void ContactSet::set_products(const ContactWorkspace& workspace, Batch& batch) const noexcept {
  rows_.products(batch.vertices.data(), batch.count, workspace.x, batch.products.data());
}

/// world_arm() of one of a batch, x = q.
Eigen::Vector3d ContactSet::arm_in(const Batch& batch, int index, const BodyPose& pose) const noexcept {
  const int vertex = batch.vertices[static_cast<std::size_t>(index)];
  return pose.rotation * (places_.row(vertex).transpose() + batch.products.col(index));
}

/// The vertices of a batch that may meet obstacles; with q in workspace.x. Empties it.
void ContactSet::test_batch(const BodyPose& pose, double margin, Batch& batch, ContactWorkspace& workspace,
                            NearPlanes* found) const noexcept {
  set_products(workspace, batch);
  workspace.tested_vertices += batch.count;
  for (int index = 0; index < batch.count; ++index) {
    const int vertex = batch.vertices[static_cast<std::size_t>(index)];
    const Eigen::Vector3d arm = arm_in(batch, index, pose);
    const Eigen::Vector3d point = pose.position + arm;
    if (found != nullptr) found->add(vertex, workspace.obstacles, point);
    for (std::size_t i = 0; i < workspace.obstacles.size(); ++i) {
      if (!workspace.obstacles[i].may_meet(point, 0, margin)) continue;
      ContactCandidate& candidate = workspace.candidates[workspace.candidate_count++];
      candidate.vertex = vertex;
      candidate.obstacle = static_cast<int>(i);
      candidate.arm = arm;
    }
  }
  batch.count = 0;
}

/// Those of all branches within `radius`; all of these into `found`.
void ContactSet::search(const BodyPose& pose, double q_norm, double margin, double radius, ContactWorkspace& workspace,
                        NearPlanes* found) const noexcept {
  static_assert(kLeafVertices <= kBatch);
  Batch batch;
  const auto count = static_cast<int>(tree_.nodes().size());
  for (int node = 0; node < count;) {
    ++workspace.visited_nodes;
    const DeformationTree::Node& branch = tree_.node(node);
    const bool near = is_near(node, pose, q_norm, radius, workspace);
    if (near && branch.is_leaf) {
      for (int vertex = branch.first; vertex < branch.last; ++vertex) batch.add(vertex, 0);
      test_batch(pose, margin, batch, workspace, found);
    }
    node = near ? node + 1 : branch.next;
  }
}

void ContactSet::gather(const Obstacles& obstacles, double end_time, double time_step, const BodyPose& pose,
                        double margin, NearPlanes& near_planes, ContactWorkspace& workspace) const noexcept {
  workspace.candidate_count = 0;
  workspace.visited_nodes = workspace.tested_vertices = 0;
  if (tree_.empty()) return;
  workspace.obstacles.resize(obstacles.size());  // within what it was sized for
  for (std::size_t i = 0; i < obstacles.size(); ++i)
    workspace.obstacles[i] = PlacedObstacle(*obstacles[i], end_time, time_step);
  workspace.are_all_planes = NearPlanes::serve(workspace.obstacles);
  const double q_norm = pose.q.norm();
  find_sweeping(pose, workspace);
  if (!body_is_near(pose, margin, workspace)) return;
  set_x(pose.q, workspace);
  if (!workspace.are_all_planes) return search(pose, q_norm, margin, margin, workspace, nullptr);
  const NearPlanes::Pose now{pose, pose.q, reach_, tree_.movement()};
  if (!near_planes.knows(workspace.obstacles, now, margin)) {
    if (!near_planes.is_worthwhile()) return search(pose, q_norm, margin, margin, workspace, nullptr);
    near_planes.begin(workspace.obstacles, now, margin);
    return search(pose, q_norm, margin, near_planes.radius(), workspace, &near_planes);
  }
  Batch batch;
  for (std::size_t i = 0; i < near_planes.count(); ++i) {
    if (!near_planes.may_be_near(i, margin)) continue;
    batch.add(near_planes.vertex(i), 0);
    if (batch.full()) test_batch(pose, margin, batch, workspace, nullptr);
  }
  test_batch(pose, margin, batch, workspace, nullptr);
}

void ContactSet::freeze(const BodyPose& pose, const BodyVelocity& velocity, const FrameVelocity& expected,
                        double time_step, const ContactState& state, ContactWorkspace& workspace) const noexcept {
  std::size_t next = 0;
  workspace.has_first = false;
  workspace.loaded_count = 0;
  std::fill_n(workspace.clearances.begin(), workspace.candidate_count, -1.0);
  set_x(velocity.v, workspace);
  Batch batch;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    batch.add(workspace.candidates[i].vertex, i);
    if (batch.full()) freeze_batch(pose, velocity, expected, time_step, state, next, batch, workspace);
  }
  freeze_batch(pose, velocity, expected, time_step, state, next, batch, workspace);
  if (!workspace.are_all_planes) return;
  workspace.planes.end(workspace.candidate_count);
  // Side by side nothing is known of overlaps.
  const auto candidates = std::span(workspace.candidates).first(workspace.candidate_count);
  workspace.are_all_planes =
      std::ranges::none_of(candidates, [](const ContactCandidate& candidate) { return candidate.overlap > 0; });
}

/// With v in workspace.x; empties the batch.
void ContactSet::freeze_batch(const BodyPose& pose, const BodyVelocity& velocity, const FrameVelocity& expected,
                              double time_step, const ContactState& state, std::size_t& next, Batch& batch,
                              ContactWorkspace& workspace) const noexcept {
  set_products(workspace, batch);
  for (int index = 0; index < batch.count; ++index) {
    const std::size_t number = batch.candidates[static_cast<std::size_t>(index)];
    ContactCandidate& candidate = workspace.candidates[number];
    const PlacedObstacle& placed = workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)];
    const Eigen::Vector3d arm = candidate.arm;
    const Eigen::Vector3d point = pose.position + arm;
    const Eigen::Vector3d at = velocity.at(arm) + pose.rotation * batch.products.col(index);
    const Eigen::Vector3d predicted = point + time_step * at;
    const Eigen::Vector3d heading = predicted + time_step * (at + expected.at(arm) - velocity.at(arm));
    freeze_contact(placed, find_held(state, next, candidate),
                   {point, predicted, heading, pose.position, load_, state.first_step}, areas_[candidate.vertex],
                   time_step, candidate);
    if (workspace.are_all_planes)
      workspace.planes.set(number, places_.row(candidate.vertex), placed.plane->distance(candidate.carried),
                           placed.obstacle->friction, candidate);
  }
  batch.count = 0;
}

void ContactSet::evaluate(const BodyPose& pose, ContactWorkspace& workspace) const noexcept {
  workspace.set_zero(modes());
  const bool is_first = !workspace.has_first;
  if (is_first) {
    workspace.has_first = true;
    workspace.first = pose;
    workspace.first_q = pose.q;
  }
  const double way = is_first ? 0 : way_bound(reach_, tree_.movement(), pose, workspace.first, workspace.first_q);
  set_x(pose.q, workspace);
  std::fill_n(workspace.loads.data(), rows_.stride(), 0.0);
  workspace.loaded_count = 0;
  if (workspace.are_all_planes) {
    const PlaneContacts::Sums sums =
        workspace.planes.evaluate({rows_, pose, workspace.x}, way, is_first, workspace.loads);
    workspace.force = sums.force;
    workspace.torque = sums.torque;
    workspace.potential = sums.potential;
    workspace.stiffness = sums.stiffness;
    workspace.touching = sums.touching;
  } else {
    evaluate_each(pose, way, is_first, workspace);
  }
  workspace.generalised = Eigen::Map<const Eigen::VectorXd>(workspace.loads.data(), modes());
}

/// Candidates one by one; with q in workspace.x.
void ContactSet::evaluate_each(const BodyPose& pose, double way, bool is_first,
                               ContactWorkspace& workspace) const noexcept {
  Batch batch;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    if (workspace.clearances[i] > way) {
      if (!workspace.is_left[i]) leave_untouched(workspace.candidates[i]);
      workspace.is_left[i] = true;
      continue;
    }
    workspace.is_left[i] = false;
    batch.add(workspace.candidates[i].vertex, i);
    if (batch.full()) evaluate_batch(pose, is_first, batch, workspace);
  }
  evaluate_batch(pose, is_first, batch, workspace);
}

/// With q in workspace.x; empties the batch.
void ContactSet::evaluate_batch(const BodyPose& pose, bool is_first, Batch& batch,
                                ContactWorkspace& workspace) const noexcept {
  set_products(workspace, batch);
  int loaded = 0;  // those with a force move to the front
  for (int index = 0; index < batch.count; ++index) {
    ContactCandidate& candidate = workspace.candidates[batch.candidates[static_cast<std::size_t>(index)]];
    candidate.arm = arm_in(batch, index, pose);
    const Eigen::Vector3d point = pose.position + candidate.arm;
    const PlacedObstacle& placed = workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)];
    const double potential = evaluate_contact(placed, point, candidate);
    const std::size_t number = batch.candidates[static_cast<std::size_t>(index)];
    if (is_first && has_steady_distance(placed, candidate))
      workspace.clearances[number] = clearance_of(candidate, point);
    if (!workspace.add_candidate(number, potential)) continue;
    batch.vectors.col(loaded) = pose.rotation.transpose() * candidate.force;
    batch.vertices[static_cast<std::size_t>(loaded++)] = candidate.vertex;
  }
  kernels().add_vertex_loads(rows_.data(), rows_.stride(), batch.vertices.data(), loaded, batch.vectors.data(),
                             workspace.loads.data());
  batch.count = 0;
}

double ContactSet::potential(const BodyPose& pose, ContactWorkspace& workspace) const noexcept {
  double sum = 0;
  const double way =
      workspace.has_first ? way_bound(reach_, tree_.movement(), pose, workspace.first, workspace.first_q) : 0;
  set_x(pose.q, workspace);
  if (workspace.are_all_planes) return workspace.planes.potential({rows_, pose, workspace.x}, way);
  Batch batch;
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    if (workspace.clearances[i] > way) continue;
    batch.add(workspace.candidates[i].vertex, i);
    if (batch.full()) sum += potential_of(pose, batch, workspace);
  }
  return sum + potential_of(pose, batch, workspace);
}

/// With q in workspace.x; empties the batch.
double ContactSet::potential_of(const BodyPose& pose, Batch& batch, ContactWorkspace& workspace) const noexcept {
  double sum = 0;
  set_products(workspace, batch);
  for (int index = 0; index < batch.count; ++index) {
    const ContactCandidate& candidate = workspace.candidates[batch.candidates[static_cast<std::size_t>(index)]];
    const Eigen::Vector3d point = pose.position + arm_in(batch, index, pose);
    const PlacedObstacle& placed = workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)];
    sum += contact_potential(placed, candidate, point);
  }
  batch.count = 0;
  return sum;
}

void ContactSet::refresh_friction(ContactWorkspace& workspace, FrictionChange& change) const noexcept {
  if (workspace.are_all_planes)
    workspace.planes.refresh_friction(change);
  else
    workspace.refresh_friction(change);
}

double ContactSet::refresh_friction(ContactWorkspace& workspace) const noexcept {
  FrictionChange change;
  refresh_friction(workspace, change);
  return change.relative();
}

/// The factors of a batch, r of each by the rows of its vertex and then its rigid ones, and their squares; empties it.
void ContactSet::add_squares(int rigid, const Eigen::Matrix3d* turn, Batch& batch,
                             ContactWorkspace& workspace) const noexcept {
  if (turn != nullptr) {
    auto torques = batch.rigid.bottomRows<3>().leftCols(batch.count);
    torques = (turn->transpose() * torques).eval();
  }
  const Eigen::Index width = padded(rigid + modes());
  kernels().vertex_loads(rows_.data(), rows_.stride(), batch.vertices.data(), batch.count, batch.vectors.data(),
                         workspace.factors.data(), width);
  for (int index = 0; index < batch.count; ++index) {
    double* const after = workspace.factors.data() + index * width + modes();
    std::copy_n(batch.rigid.col(index).data(), rigid, after);
    std::fill(after + rigid, workspace.factors.data() + (index + 1) * width, 0.0);
  }
  kernels().add_squares(workspace.factors.data(), batch.count, width, workspace.squares.data());
  batch.count = 0;
}

void ContactSet::sum_squares(int rigid, const Eigen::Matrix3d* turn, const BodyPose& pose,
                             ContactWorkspace& workspace) const noexcept {
  const Eigen::Index width = padded(rigid + modes());
  std::fill_n(workspace.squares.data(), width * width, 0.0);
  Batch batch;
  static_assert(kBatch >= kPlaneFactors);
  for (std::size_t panel = 0; workspace.are_all_planes && panel < workspace.planes.panels().size(); ++panel) {
    if (batch.count + kPlaneFactors > kBatch) add_squares(rigid, turn, batch, workspace);
    const auto begin = static_cast<std::size_t>(batch.count);
    batch.count +=
        static_cast<int>(workspace.planes.factors(panel, pose, batch.vectors.col(batch.count).data(),
                                                  batch.rigid.col(batch.count).data(), batch.vertices.data() + begin));
  }
  for (std::size_t i = 0; i < workspace.loaded_count; ++i) {
    const ContactCandidate& candidate = workspace.candidates[workspace.loaded[i]];
    const StiffnessFactors factors(candidate);
    for (int k = 0; k < factors.count; ++k) {
      const Eigen::Vector3d direction = factors.columns.col(k);
      batch.rigid.col(batch.count) << direction, candidate.arm.cross(direction);
      batch.vectors.col(batch.count) = pose.rotation.transpose() * direction;
      batch.add(candidate.vertex, workspace.loaded[i]);
      if (batch.full()) add_squares(rigid, turn, batch, workspace);
    }
  }
  add_squares(rigid, turn, batch, workspace);
}

void ContactSet::add_stiffness_of(int rigid, const BodyPose& pose, ContactWorkspace& workspace,
                                  Eigen::MatrixXd& stiffness) const noexcept {
  sum_squares(rigid, nullptr, pose, workspace);
  const Eigen::Index width = padded(rigid + modes());
  const Eigen::Map<const RowMatrix> upper(workspace.squares.data(), width, width);
  for (Eigen::Index j = 0; j < modes(); ++j) {
    const Eigen::Index below = modes() - j;
    stiffness.col(rigid + j).tail(below) += upper.row(j).segment(j, below).transpose();
    stiffness.row(rigid + j).head(rigid) += upper.row(j).segment(modes(), rigid);
  }
  for (Eigen::Index c = 0; c < rigid; ++c)
    stiffness.col(c).segment(c, rigid - c) += upper.row(modes() + c).segment(modes() + c, rigid - c).transpose();
}

void ContactSet::add_stiffness(const BodyPose& pose, ContactWorkspace& workspace,
                               Eigen::MatrixXd& stiffness) const noexcept {
  add_stiffness_of(6, pose, workspace, stiffness);
}

void ContactSet::add_reduced_stiffness(const BodyPose& pose, ContactWorkspace& workspace,
                                       Eigen::MatrixXd& stiffness) const noexcept {
  add_stiffness_of(0, pose, workspace, stiffness);
}

void ContactSet::commit(const BodyPose& pose, ContactWorkspace& workspace, ContactState& state) const noexcept {
  state.count = 0;
  if (workspace.are_all_planes)
    for (std::size_t i = 0; i < workspace.candidate_count; ++i) workspace.planes.take(i, workspace.candidates[i]);
  for (std::size_t i = 0; i < workspace.candidate_count; ++i) {
    const ContactCandidate& candidate = workspace.candidates[i];
    const Eigen::Vector3d point = pose.position + candidate.arm;
    hold_contact(workspace.obstacles[static_cast<std::size_t>(candidate.obstacle)], point, candidate, state);
  }
}

}  // namespace exmat::runtime
