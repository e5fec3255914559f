#pragma once

#include <cstdint>

namespace exmat {

/// Says who meets whom: two meet if each one's mask has a bit of the other's group.
struct MeetingGroup {
  std::uint32_t group = 1;   ///< bits that it has
  std::uint32_t mask = ~0U;  ///< bits of those that it meets

  bool meets(const MeetingGroup& other) const noexcept {
    return (mask & other.group) != 0 && (other.mask & group) != 0;
  }
};

}  // namespace exmat
