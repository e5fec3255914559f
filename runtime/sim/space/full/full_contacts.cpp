#include "runtime/sim/space/full/full_contacts.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "common/core/decompositions.h"

namespace exmat::runtime {

FullContacts::FullContacts(const ContactSet& set, const FullSpace& space, const Eigen::Vector3d& origin)
    : rest_(set.rest().rowwise() + origin.transpose()), areas_(set.vertices()), load_(set.load()) {
  for (int v = 0; v < set.vertices(); ++v) {
    areas_[v] = set.area(v);
    places_.push_back(space.place(set.object_vertex(v)));
  }
}

FullContacts::FullContacts(const ContactData& data, const FullSpace& space)
    : rest_(data.positions), areas_(data.areas) {
  for (const std::int32_t vertex : data.vertices) places_.push_back(space.place(vertex));
}

bool FullContacts::begin(const Obstacles& obstacles, double end_time, double time_step, const Eigen::Vector3d& gravity,
                         double pushed, const double* u, const double* v, const ContactState& held,
                         ContactWorkspace& contact) const noexcept {
  contact.candidate_count = contact.loaded_count = 0;
  contact.are_all_planes = false;
  contact.set_zero(contact.generalised.size());
  contact.obstacles.resize(obstacles.size());  // within what it was sized for
  double square = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  int moving = 0;
  const auto moves = [this](int vertex) { return places_[static_cast<std::size_t>(vertex)] >= 0; };
  for (int vertex = 0; vertex < std::ssize(places_); ++vertex) {
    if (!moves(vertex)) continue;
    square = std::max(square, at(vertex, v).squaredNorm());
    centre += point(vertex, u);
    ++moving;
  }
  centre /= std::max(1, moving);
  const double way = std::max(time_step * std::sqrt(square), pushed);
  const double margin = kContactMarginSteps * way + time_step * time_step * gravity.norm() + held.longest_way_out();
  for (std::size_t i = 0; i < obstacles.size(); ++i) {
    PlacedObstacle& placed = contact.obstacles[i] = PlacedObstacle(*obstacles[i], end_time, time_step);
    if (!placed.obstacle->motion.moves()) continue;
    const double limit = kSweep * shortest_passage(placed.obstacle->shape);
    for (int vertex = 0; vertex < std::ssize(places_) && !placed.sweeps; ++vertex)
      placed.sweeps = moves(vertex) && placed.sweep(point(vertex, u), 0) > limit;
  }
  std::size_t next = 0;
  for (int vertex = 0; vertex < std::ssize(places_); ++vertex) {
    if (!moves(vertex)) continue;
    const Eigen::Vector3d here = point(vertex, u);
    for (std::size_t i = 0; i < obstacles.size(); ++i) {
      if (!contact.obstacles[i].may_meet(here, 0, margin)) continue;
      ContactCandidate& candidate = contact.candidates[contact.candidate_count++];
      candidate.vertex = vertex;
      candidate.obstacle = static_cast<int>(i);
      const Eigen::Vector3d ahead = time_step * at(vertex, v);
      const Eigen::Vector3d predicted = here + ahead;
      freeze_contact(
          contact.obstacles[i], find_held(held, next, candidate),
          {here, predicted, predicted + ahead + time_step * time_step * gravity, centre, load_, held.first_step},
          areas_[vertex], time_step, candidate);
    }
  }
  return contact.candidate_count > 0;
}

double FullContacts::evaluate(const double* u, ContactWorkspace& contact, double* gradient) const noexcept {
  contact.set_zero(contact.generalised.size());
  double square = 0;
  contact.loaded_count = 0;
  for (std::size_t i = 0; i < contact.candidate_count; ++i) {
    ContactCandidate& candidate = contact.candidates[i];
    const Eigen::Vector3d here = point(candidate.vertex, u);
    candidate.arm = here;
    const double potential =
        evaluate_contact(contact.obstacles[static_cast<std::size_t>(candidate.obstacle)], here, candidate);
    if (!contact.add_candidate(i, potential)) continue;
    square += candidate.force.squaredNorm();
    Eigen::Map<Eigen::Vector3d>(gradient + 4 * places_[static_cast<std::size_t>(candidate.vertex)]) -= candidate.force;
  }
  return std::sqrt(square);
}

void FullContacts::add_blocks(const ContactWorkspace& contact, FullContactScratch& scratch) const noexcept {
  for (const std::size_t number : std::span(contact.loaded).first(contact.loaded_count)) {
    const ContactCandidate& candidate = contact.candidates[number];
    const StiffnessFactors factors(candidate);
    const Eigen::Matrix3f stiffness = (factors.used().lazyProduct(factors.used().transpose())).cast<float>();
    FullContactScratch::Block& block = scratch.at(places_[static_cast<std::size_t>(candidate.vertex)]);
    block.stiffness += stiffness;
    block.pushed += stiffness;
  }
}

void FullContactScratch::clear() noexcept {
  for (const Block& block : std::span(blocks).first(block_count)) block_of[static_cast<std::size_t>(block.place)] = -1;
  block_count = 0;
}

FullContactScratch::Block& FullContactScratch::at(Eigen::Index place) noexcept {
  std::int32_t& number = block_of[static_cast<std::size_t>(place)];
  if (number < 0) {
    number = static_cast<std::int32_t>(block_count++);
    Block& fresh = blocks[static_cast<std::size_t>(number)];
    fresh.place = place;
    fresh.stiffness.setZero();
    fresh.pushed.setZero();
  }
  return blocks[static_cast<std::size_t>(number)];
}

void FullContactScratch::set_scales(const Eigen::VectorXd& inverse_diagonal) noexcept {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;  // portable builds have sines of doubles alone
  for (Block& block : std::span(blocks).first(block_count)) {
    solver.computeDirect(block.pushed.cast<double>());
    const Eigen::Vector3d shares =
        (1 + inverse_diagonal[block.place] * solver.eigenvalues().array().max(0)).sqrt().inverse();
    block.scale =
        (solver.eigenvectors() * shares.asDiagonal() * solver.eigenvectors().transpose()).eval().cast<float>();
  }
}

void FullContacts::commit(const double* u, const ContactWorkspace& contact, ContactState& held) const noexcept {
  held.count = 0;
  for (const ContactCandidate& candidate : std::span(contact.candidates).first(contact.candidate_count))
    hold_contact(contact.obstacles[static_cast<std::size_t>(candidate.obstacle)], point(candidate.vertex, u), candidate,
                 held);
}

}  // namespace exmat::runtime
