#include "runtime/viewer/simulation/stepped_bodies.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace exmat::viewer {
namespace {

exmat_contact as_with_obstacle(const exmat_body_contact& contact) {
  exmat_contact found{};
  found.vertex = contact.vertex;
  found.obstacle = -1;
  std::ranges::copy(contact.position, found.position);
  std::ranges::copy(contact.normal, found.normal);
  std::ranges::copy(contact.force, found.force);
  found.depth = contact.depth;
  return found;
}

/// One processor is left to what draws: threads that wait for each other in each step must not wait for it.
int threads_of_steps() {
  static const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()) - 1);
  return threads;
}

}  // namespace

SteppedBodies::SteppedBodies(World world) : world_(std::move(world)) {
  for (const std::int64_t id : world_.ids()) bodies_.push_back(world_.body(id));
}

void SteppedBodies::step(std::int64_t steps) { world_.step(steps, threads_of_steps()); }

std::vector<std::vector<exmat_contact>> SteppedBodies::contacts() const {
  std::vector<std::vector<exmat_contact>> contacts;
  for (const BodyRef& body : bodies_) contacts.push_back(body.contacts());
  for (const exmat_body_contact& contact : world_.contacts())
    contacts[static_cast<std::size_t>(contact.body)].push_back(as_with_obstacle(contact));
  return contacts;
}

}  // namespace exmat::viewer
