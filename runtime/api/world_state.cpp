#include <algorithm>
#include <cinttypes>
#include <fmt/format.h>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/body_state.h"
#include "runtime/api/state_numbers.h"
#include "runtime/api/world_handle.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

// The state of a world: how many bodies; of each its number of numbers, whether it is anew, and these; how many pairs;
// of each its bodies, how many vertices of either touch, its energy and account, and ten numbers for each vertex.

namespace {

constexpr std::size_t kHeadNumbers = 2, kBodyNumbers = 2, kPairNumbers = 6, kContactNumbers = 10;

std::size_t size_of(const exmat_world& world) {
  std::size_t size = kHeadNumbers;
  for (const auto& member : world.members) size += kBodyNumbers + state_size(*member.body);
  for (const HeldPair& pair : world.world.held())
    size += kPairNumbers + kContactNumbers * (pair.held[0].size() + pair.held[1].size());
  return size;
}

void write_contacts(const HeldPair& pair, std::vector<double>& numbers) {
  for (const auto number :
       {static_cast<double>(pair.first), static_cast<double>(pair.second), static_cast<double>(pair.held[0].size()),
        static_cast<double>(pair.held[1].size()), pair.energy, pair.account})
    numbers.push_back(number);
  for (const auto& side : pair.held)
    for (const HeldBodyContact& held : side) {
      for (const double number : {static_cast<double>(held.vertex), held.gap, held.normal_force, held.overlap})
        numbers.push_back(number);
      numbers.insert(numbers.end(), held.stretch.begin(), held.stretch.end());
      numbers.insert(numbers.end(), held.normal.begin(), held.normal.end());
    }
}

std::vector<double> write_world(const exmat_world& world) {
  std::vector<double> numbers{static_cast<double>(world.members.size())};
  for (std::size_t i = 0; i < world.members.size(); ++i) {
    const std::vector<double> own = write_state(*world.members[i].body);
    numbers.push_back(static_cast<double>(own.size()));
    numbers.push_back(world.world.is_anew(static_cast<int>(i)) ? 1 : 0);
    numbers.insert(numbers.end(), own.begin(), own.end());
  }
  numbers.push_back(static_cast<double>(world.world.held().size()));
  for (const HeldPair& pair : world.world.held()) write_contacts(pair, numbers);
  return numbers;
}

std::vector<HeldBodyContact> read_contacts(StateNumbers& reader, std::size_t count, const exmat_body& body) {
  std::vector<HeldBodyContact> contacts(count);
  int last = -1;
  for (HeldBodyContact& held : contacts) {
    held.vertex = static_cast<int>(reader.count("vertex", static_cast<std::size_t>(body.model().contact->vertices())));
    if (held.vertex <= last) throw InvalidArgument("numbers: expected vertices of a contact in ascending order");
    last = held.vertex;
    held.gap = reader.number();
    held.normal_force = reader.number();
    held.overlap = reader.number();
    if (held.overlap < 0) throw InvalidArgument("numbers: expected overlaps of contacts >= 0");
    held.stretch = reader.vector();
    held.normal = reader.vector();
  }
  return contacts;
}

std::vector<HeldPair> read_pairs(StateNumbers& reader, const exmat_world& world) {
  const std::size_t bodies = world.members.size();
  std::vector<HeldPair> pairs(reader.count("pairs", reader.left()));
  for (HeldPair& pair : pairs) {
    const std::size_t first = reader.count("body", bodies), second = reader.count("body", bodies);
    if (second < first) throw InvalidArgument("numbers: expected the bodies of a pair in ascending order");
    pair.first = static_cast<int>(first);
    pair.second = static_cast<int>(second);
    const std::size_t of_first = reader.count("contacts", reader.left()),
                      of_second = reader.count("contacts", reader.left());
    pair.energy = reader.number();
    pair.account = reader.number();
    if (pair.energy < 0 || pair.account < 0) throw InvalidArgument("numbers: expected energies of a pair >= 0");
    pair.held[0] = read_contacts(reader, of_first, *world.members[first].body);
    pair.held[1] = read_contacts(reader, of_second, *world.members[second].body);
  }
  const auto before = [](const HeldPair& a, const HeldPair& b) {
    return std::pair(a.first, a.second) < std::pair(b.first, b.second);
  };
  if (!std::ranges::is_sorted(pairs, before)) throw InvalidArgument("numbers: expected pairs in ascending order");
  return pairs;
}

struct ReadState {
  std::vector<std::span<const double>> bodies;
  std::vector<bool> anew;
  std::vector<HeldPair> held;
};

ReadState read(std::span<const double> numbers, const exmat_world& world) {
  if (!all_finite(numbers.data(), std::ssize(numbers))) throw InvalidArgument("numbers: expected finite ones");
  StateNumbers reader(numbers);
  ReadState state;
  if (const std::size_t bodies = reader.count("bodies", numbers.size() + 1); bodies != world.members.size())
    throw InvalidArgument(fmt::format("numbers: {} bodies: expected {}", bodies, world.members.size()));
  for (std::size_t i = 0; i < world.members.size(); ++i) {
    const std::size_t size = reader.count("numbers of a body", numbers.size());
    state.anew.push_back(reader.flag("anew"));
    state.bodies.push_back(reader.take(size));
  }
  state.held = read_pairs(reader, world);
  if (reader.left() > 0) throw InvalidArgument(fmt::format("numbers: {} too many", reader.left()));
  return state;
}

/// All bodies take their states, or none does.
void set_world(std::span<const double> numbers, exmat_world& world) {
  ReadState state = read(numbers, world);
  std::vector<std::vector<double>> before;
  for (const auto& member : world.members) before.push_back(write_state(*member.body));
  std::vector<bool> anew_before;
  std::vector<HeldPair> held_before = world.world.held();
  for (int i = 0; i < world.world.count(); ++i) anew_before.push_back(world.world.is_anew(i));
  const double time = time_of(world);
  for (std::size_t i = 0; i < world.members.size(); ++i) try {
      take_state(state.bodies[i], *world.members[i].body);
    } catch (const InvalidArgument& error) {
      for (std::size_t k = 0; k < i; ++k) take_state(before[k], *world.members[k].body);
      world.world.set_memory(std::move(held_before), anew_before);
      throw InvalidArgument(fmt::format("body {}: {}", world.members[i].id, error.what()));
    }
  world.world.set_memory(std::move(state.held), state.anew);
  world.contacts.clear();
  follow_times(world, time);
}

}  // namespace

std::int64_t exmat_world_state_size(const exmat_world* world) noexcept {
  return world != nullptr ? static_cast<std::int64_t>(size_of(*world)) : -1;
}

exmat_status exmat_world_read_state(const exmat_world* world, double* numbers, std::int64_t count) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(numbers);
  EXMAT_REQUIRE_LENGTH(count, size_of(*world));
  return guarded(__func__, [&] { std::ranges::copy(write_world(*world), numbers); });
}

exmat_status exmat_world_set_state(exmat_world* world, const double* numbers, std::int64_t count) noexcept {
  EXMAT_REQUIRE(world);
  EXMAT_REQUIRE(numbers);
  if (count < 0) return fail(EXMAT_INVALID_ARGUMENT, "%s: count = %" PRId64 ": expected >= 0", __func__, count);
  return guarded(__func__, [&] { set_world({numbers, static_cast<std::size_t>(count)}, *world); });
}
