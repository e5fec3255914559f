#include "runtime/api/touches.h"

#include <algorithm>
#include <span>
#include <utility>

#include "runtime/api/world_handle.h"

namespace exmat::runtime {

void Touches::gather(const exmat_world& world, std::vector<Pair>& pairs) {
  pairs.clear();
  const auto id_of = [&](int place) { return world.members[static_cast<std::size_t>(place)].id; };
  for (const HeldPair& held : world.world.held())
    if (!held.held[0].empty() || !held.held[1].empty()) pairs.push_back({false, id_of(held.first), id_of(held.second)});
  for (const exmat_world::Member& member : world.members) {
    const ContactState& contacts = member.body->state.contacts;
    int last = -1;
    for (const HeldContact& held : std::span(contacts.held).first(contacts.count))
      if (std::exchange(last, held.obstacle) != held.obstacle)
        pairs.push_back({true, member.id, member.body->obstacle_ids[static_cast<std::size_t>(held.obstacle)]});
  }
  std::ranges::sort(pairs);
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
}

void Touches::begin(const exmat_world& world) { gather(world, before_); }

void Touches::end(const exmat_world& world) {
  gather(world, after_);
  changes_.clear();
  auto before = before_.begin(), after = after_.begin();
  while (before != before_.end() || after != after_.end()) {
    const bool was = before != before_.end() && (after == after_.end() || *before <= *after);
    const bool is = after != after_.end() && (before == before_.end() || *after <= *before);
    const Pair& pair = was ? *before : *after;
    changes_.push_back({pair.body, pair.with_obstacle ? -1 : pair.other, pair.with_obstacle ? pair.other : -1,
                        was && is ? EXMAT_TOUCH_STAYS
                        : is      ? EXMAT_TOUCH_BEGINS
                                  : EXMAT_TOUCH_ENDS,
                        0});
    before += was ? 1 : 0;
    after += is ? 1 : 0;
  }
}

void Touches::reserve(std::size_t pairs) {
  before_.reserve(pairs);
  after_.reserve(pairs);
  changes_.reserve(2 * pairs);
}

void Touches::forget(std::int64_t body) noexcept {
  std::erase_if(changes_, [=](const exmat_touch& touch) { return touch.body == body || touch.other == body; });
}

}  // namespace exmat::runtime
