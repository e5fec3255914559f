#include "runtime/api/body_state.h"

#include <algorithm>
#include <fmt/format.h>

#include "runtime/api/arguments.h"
#include "runtime/api/body_steps.h"
#include "runtime/api/failures.h"
#include "runtime/api/state_numbers.h"
#include "runtime/api/world_handle.h"
#include "runtime/scene/state_hash.h"

namespace exmat::runtime {
namespace {

constexpr double kLayout = 4;
constexpr std::size_t kHeadNumbers = 6, kSleepNumbers = 3, kContactNumbers = 10;
constexpr double kMostSteps = 9007199254740992;  // 2^53: whole numbers up to here have all their digits

constexpr Eigen::VectorXd State::*kModeArrays[] = {&State::q,          &State::v, &State::q_previous,
                                                   &State::v_previous, &State::a, &State::applied_force};

constexpr Eigen::VectorXd FullMotion::*kVertexArrays[] = {&FullMotion::q, &FullMotion::v, &FullMotion::q_previous,
                                                          &FullMotion::v_previous};

class Writer {
 public:
  void add(double number) { numbers_.push_back(number); }
  void add_all(const auto& numbers) { numbers_.insert(numbers_.end(), numbers.begin(), numbers.end()); }
  std::vector<double> take() { return std::move(numbers_); }

 private:
  std::vector<double> numbers_;
};

bool may_sleep(const exmat_body& body) { return body.scene.sleep.energy > 0; }

std::size_t contact_count(const exmat_body& body) { return body.state.contacts.count; }

std::size_t size_without_contacts(const exmat_body& body, bool in_full_space) {
  const auto unknowns = static_cast<std::size_t>(body.state.vertex_force.size());
  std::size_t size = unknowns;  // of the caller's forces
  if (in_full_space) size += 1 + std::size(kVertexArrays) * unknowns;
  if (body.model().skeleton) size += static_cast<std::size_t>(numbers_of(*body.start.full->skeleton).size());
  size += kHeadNumbers + 1 + std::size(kModeArrays) * static_cast<std::size_t>(body.modes());
  size += body.frame_numbers;
  if (may_sleep(body)) size += kSleepNumbers;
  for (const ExampleState& examples : body.state.examples)
    size += static_cast<std::size_t>(examples.weights.size() + examples.target.size()) + 2;
  return size;
}

void read_contacts(StateNumbers& reader, std::size_t count, const exmat_body& body, ContactState& contacts) {
  if (count > contacts.held.size())
    throw InvalidArgument(fmt::format("numbers: {} contacts: expected at most {}", count, contacts.held.size()));
  contacts.count = count;
  for (HeldContact& held : std::span(contacts.held).first(count)) {
    held.vertex = static_cast<int>(reader.count("vertex", static_cast<double>(body.model().contact->vertices())));
    held.obstacle = static_cast<int>(reader.count("obstacle", static_cast<double>(body.scene.obstacles.size())));
    held.normal_force = reader.number();
    held.anchor = reader.vector();
    held.way_out = reader.vector();
    held.overlap = reader.number();
    if (held.overlap < 0) throw InvalidArgument("numbers: expected overlaps of contacts >= 0");
  }
}

}  // namespace

std::size_t state_size(const exmat_body& body) {
  return size_without_contacts(body, body.state.full.has_value()) + kContactNumbers * contact_count(body);
}

std::vector<double> write_state(const exmat_body& body) {
  const State& state = body.state;
  Writer writer;
  for (const double number :
       {kLayout, body.scene.time_step, static_cast<double>(state.step), state.begins_anew ? 1.0 : 0.0,
        static_cast<double>(contact_count(body)), state.full ? 1.0 : 0.0})
    writer.add(number);
  writer.add(state.elastic_energy);
  for (const auto member : kModeArrays) writer.add_all(state.*member);
  writer.add_all(state.vertex_force);
  if (state.full) {
    writer.add(state.full->alone);
    for (const auto member : kVertexArrays) writer.add_all((*state.full).*member);
    if (state.full->skeleton) writer.add_all(numbers_of(*state.full->skeleton));
  }
  writer.add_all(body.model().frame->numbers(state.frame));
  for (const ExampleState& examples : state.examples) {
    writer.add_all(examples.weights);
    writer.add_all(examples.target);
    writer.add(examples.has_target ? 1 : 0);
    writer.add(examples.target_converged ? 1 : 0);
  }
  if (may_sleep(body)) {
    writer.add(state.sleep.asleep ? 1 : 0);
    writer.add(static_cast<double>(state.sleep.still_steps));
    writer.add(static_cast<double>(state.sleep.loads));
  }
  for (const HeldContact& held : std::span(state.contacts.held).first(contact_count(body))) {
    for (const double number :
         {static_cast<double>(held.vertex), static_cast<double>(held.obstacle), held.normal_force})
      writer.add(number);
    writer.add_all(held.anchor);
    writer.add_all(held.way_out);
    writer.add(held.overlap);
  }
  return writer.take();
}

void take_state(std::span<const double> numbers, exmat_body& body) {
  const bool in_full_space = body.full() != nullptr && numbers.size() > kHeadNumbers && numbers[kHeadNumbers - 1] == 1;
  const std::size_t least = size_without_contacts(body, in_full_space);
  if (numbers.size() < least || (numbers.size() - least) % kContactNumbers != 0)
    throw InvalidArgument(fmt::format("count = {}: expected {} and {} for each contact: is it of another model?",
                                      numbers.size(), least, kContactNumbers));
  if (!all_finite(numbers.data(), std::ssize(numbers))) throw InvalidArgument("numbers: expected finite ones");
  StateNumbers reader(numbers);
  if (const double layout = reader.number(); layout != kLayout)
    throw InvalidArgument(
        fmt::format("numbers: layout {:g}: expected {:g}; is it of another version?", layout, kLayout));
  if (const double step = reader.number(); step != body.scene.time_step)
    throw InvalidArgument(
        fmt::format("numbers: time step {:g} s: expected the model's {:g} s", step, body.scene.time_step));
  State state = body.state;
  state.step = static_cast<std::int64_t>(reader.count("steps", kMostSteps));
  state.time = static_cast<double>(state.step) * body.scene.time_step;
  state.begins_anew = reader.flag("begins_anew") || holds_modes(state.attachments);  // whose past it does not hold
  const auto contacts = static_cast<std::size_t>(reader.count("contacts", kMostSteps));
  if (contacts != (numbers.size() - least) / kContactNumbers)
    throw InvalidArgument(
        fmt::format("numbers: {} contacts: expected {}", contacts, (numbers.size() - least) / kContactNumbers));
  if (reader.flag("full space") != in_full_space)
    throw InvalidArgument("numbers: a body in full space: expected one of a model of space full or auto");
  if (!in_full_space && body.model().skeleton)
    throw InvalidArgument("numbers: a body in its modes: expected one on a skeleton, in full space");
  state.elastic_energy = reader.number();
  for (const auto member : kModeArrays) reader.read(state.*member);
  reader.read(state.vertex_force);
  if (in_full_space) {
    enter_full_space(*body.full(), body.model(), state);
    state.full->alone = reader.number();
    for (const auto member : kVertexArrays) reader.read((*state.full).*member);
    if (state.full->skeleton) {
      Eigen::VectorXd bones = numbers_of(*state.full->skeleton);
      reader.read(bones);
      set_numbers(bones, *state.full->skeleton);
    }
    state.full->elastic_energy = state.elastic_energy;
  } else {
    state.full.reset();
  }
  body.model().frame->set_numbers(reader.take(body.frame_numbers), state.frame);
  for (ExampleState& examples : state.examples) {
    reader.read(examples.weights);
    reader.read(examples.target);
    examples.has_target = reader.flag("has_target");
    examples.target_converged = reader.flag("target_converged");
  }
  if (may_sleep(body)) {
    state.sleep.asleep = reader.flag("asleep");
    state.sleep.still_steps = static_cast<std::int64_t>(reader.count("still steps", kMostSteps));
    state.sleep.loads = static_cast<std::uint64_t>(reader.count("loads", kMostSteps));
  }
  read_contacts(reader, contacts, body, state.contacts);
  body.state = state;  // into the arrays that are there: they are handed out
  begin_steps(body);
  was_put(body);
}

void set_state(std::span<const double> numbers, exmat_body& body) {
  const double time = body.state.time;
  take_state(numbers, body);
  follow_time(body, time);
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
  return guarded(__func__, [&] { std::ranges::copy(write_state(*body), numbers); });
}

exmat_status exmat_body_set_state(exmat_body* body, const double* numbers, std::int64_t count) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(numbers);
  if (count < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 0", __func__, count);
  return guarded(__func__, [&] { set_state({numbers, static_cast<std::size_t>(count)}, *body); });
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
