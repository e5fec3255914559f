#include "runtime/api/body_state.h"

#include <algorithm>
#include <fmt/format.h>

#include "runtime/api/arguments.h"
#include "runtime/api/body_steps.h"
#include "runtime/api/failures.h"
#include "runtime/api/state_numbers.h"
#include "runtime/api/world_handle.h"
#include "runtime/scene/state_hash.h"
#include "runtime/sim/frame/free_frame.h"

namespace exmat::runtime {
namespace {

constexpr double kLayout = 6;

constexpr Eigen::VectorXd State::*kModeArrays[] = {&State::q, &State::v, &State::q_previous, &State::v_previous,
                                                   &State::a};

constexpr Eigen::VectorXd FullMotion::*kVertexArrays[] = {&FullMotion::q, &FullMotion::v, &FullMotion::q_previous,
                                                          &FullMotion::v_previous};

bool visit_space(StateWriter& archive, const exmat_body& body) {
  return archive.flag("full space", body.state.full.has_value());
}

bool visit_space(StateReader& archive, exmat_body& body) {
  bool in_full_space = false;
  in_full_space = archive.flag("full space", in_full_space);
  if (in_full_space && body.full() == nullptr)
    throw InvalidArgument("numbers: a body in full space: expected one of a model of space full or auto");
  if (!in_full_space && body.model().skeleton)
    throw InvalidArgument("numbers: a body in its modes: expected one on a skeleton, in full space");
  if (archive.checks()) return in_full_space;
  if (in_full_space)
    enter_full_space(*body.full(), body.model(), body.state);
  else
    body.state.full.reset();
  return in_full_space;
}

void visit_bones(StateWriter& archive, const SkeletonMotion& bones) {
  write_numbers(bones, archive.room(write_numbers(bones, nullptr)));
}

void visit_bones(StateReader& archive, SkeletonMotion& bones) {
  set_numbers(archive.take(write_numbers(bones, nullptr)), bones);
}

void visit_frame(StateWriter& archive, const exmat_body& body) {
  body.model().frame->write_numbers(body.state.frame, archive.room(body.frame_numbers));
}

void visit_frame(StateReader& archive, exmat_body& body) {
  const bool is_free = std::holds_alternative<FreeState>(body.state.frame);
  const auto numbers = is_free ? archive.take(body.frame_numbers, FreeFrame::kFirstLoad, FreeFrame::kLoads)
                               : archive.take(body.frame_numbers);
  if (!archive.checks()) body.model().frame->set_numbers(numbers, body.state.frame);
}

/// All that a body carries from step to step, after seven numbers that say of what.
template <typename Archive, typename Body>
void visit(Archive& archive, Body& body) {
  auto& state = body.state;
  archive.same("layout", kLayout, "", "; is it of another version?");
  archive.same("time step", body.scene.time_step, " s", ", the model's");
  archive.whole("steps", state.step, kMostSteps);
  archive.flag("begins_anew", state.begins_anew);
  archive.flag("first step", state.contacts.first_step);
  const std::size_t contacts =
      archive.whole("contacts", state.contacts.count, static_cast<double>(state.contacts.held.size() + 1));
  const bool in_full_space = visit_space(archive, body);
  archive.load(state.elastic_energy);
  archive.load(state.contacts.account);
  for (const auto member : kModeArrays) archive.array(state.*member);
  archive.load(state.applied_force);
  archive.load(state.vertex_force);
  if (in_full_space && archive.checks()) {
    archive.skip(1 + std::size(kVertexArrays) * static_cast<std::size_t>(state.vertex_force.size()));
    if (body.model().skeleton) archive.skip(write_numbers(*body.start.full->skeleton, nullptr));
  } else if (in_full_space) {
    archive.number(state.full->alone);
    for (const auto member : kVertexArrays) archive.array((*state.full).*member);
    if (state.full->skeleton) visit_bones(archive, *state.full->skeleton);
  }
  visit_frame(archive, body);
  for (auto& examples : state.examples) {
    archive.array(examples.weights);
    archive.array(examples.target);
    archive.flag("has_target", examples.has_target);
    archive.flag("target_converged", examples.target_converged);
  }
  if (body.scene.sleep.energy > 0) {
    archive.flag("asleep", state.sleep.asleep);
    archive.whole("still steps", state.sleep.still_steps, kMostSteps);
    archive.whole("loads", state.sleep.loads, kMostSteps);
  }
  for (auto& held : std::span(state.contacts.held).first(contacts)) {
    archive.whole("vertex", held.vertex, static_cast<double>(body.model().contact->vertices()));
    archive.whole("obstacle", held.obstacle, static_cast<double>(body.scene.obstacles.size()));
    archive.load(held.normal_force);
    archive.array(held.anchor);
    archive.array(held.way_out);
    archive.not_negative("overlaps of contacts", held.overlap);
  }
}

std::size_t state_size(const exmat_body& body) {
  StateWriter writer;
  visit(writer, body);
  return writer.count();
}

/// Throws where numbers are not those of a state of this body.
void check(std::span<const double> numbers, exmat_body& body) {
  StateReader reader(numbers, StateReader::Use::kCheck, kFarthest);
  visit(reader, body);
  if (reader.left() > 0)
    throw InvalidArgument(fmt::format("numbers: {}: expected {}", numbers.size(), numbers.size() - reader.left()));
}

}  // namespace

void visit_state(StateWriter& writer, const exmat_body& body) { visit(writer, body); }

void visit_state(StateReader& reader, exmat_body& body) {
  visit(reader, body);
  if (reader.checks()) return;
  State& state = body.state;
  state.time = static_cast<double>(state.step) * body.scene.time_step;
  if (state.full) state.full->elastic_energy = state.elastic_energy;
  begin_steps(body);
}

}  // namespace exmat::runtime

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

std::int64_t exmat_body_state_size(const exmat_body* body) noexcept {
  return body != nullptr ? static_cast<std::int64_t>(state_size(*body)) : -1;
}

exmat_status exmat_body_read_state(const exmat_body* body, double* numbers, std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(numbers);
  EXMAT_REQUIRE_LENGTH(count, state_size(*body));
  StateWriter writer(numbers);
  visit_state(writer, *body);
  return EXMAT_OK;
}

exmat_status exmat_body_set_state(exmat_body* body, const double* numbers, std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(numbers);
  if (count < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 0", __func__, count);
  return guarded(__func__, [&] {
    const std::span given(numbers, static_cast<std::size_t>(count));
    check(given, *body);
    const double time = body->state.time;
    StateReader reader(given, StateReader::Use::kTake);
    visit_state(reader, *body);
    body->forces.clear();  // the state has their sum
    State& state = body->state;
    state.begins_anew |= holds_modes(state.attachments);                             // whose past it does not hold
    const bool anew = state.contacts.first_step || body->world->members.size() > 1;  // others' contacts are forgotten
    was_put(*body);
    state.contacts.first_step = anew;
    follow_time(*body, time);
  });
}

exmat_status exmat_bodies_hash(exmat_body* const* bodies, std::int64_t count, std::uint64_t* hash) noexcept {
  EXMAT_REQUIRE(hash);
  if (count < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 0", __func__, count);
  if (count > 0) EXMAT_REQUIRE(bodies);
  FnvHash sum;
  for (std::int64_t i = 0; i < count; ++i) {
    if (bodies[i] == nullptr) return fail(EXMAT_INVALID_ARGUMENT, "%s: bodies[%" PRId64 "] is NULL", __func__, i);
    add_to_hash(bodies[i]->model(), bodies[i]->state, sum);
  }
  *hash = sum.value();
  return EXMAT_OK;
}

const double* exmat_body_displacement(const exmat_body* body) noexcept {
  return body != nullptr ? body->state.q.data() : nullptr;
}

const double* exmat_body_velocity(const exmat_body* body) noexcept {
  return body != nullptr ? body->state.v.data() : nullptr;
}

const double* exmat_body_weights(const exmat_body* body) noexcept {
  return body != nullptr && body->model().has_whole_body_examples() ? body->state.examples.front().weights.data()
                                                                    : nullptr;
}
