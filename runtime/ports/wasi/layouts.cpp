#include <cstddef>
#include <string>
#include <type_traits>

#include "exmat/exmat.h"

// Layout of the interface's structs for the host: one line per member, "STRUCT MEMBER OFFSET TYPE COUNT",
// and "STRUCT . SIZE s 1". TYPE is d (double), i (int32), u (uint32), l (int64) or z (size_t).

namespace {

template <typename Member>
constexpr char type_of() {
  using Value = std::remove_extent_t<Member>;
  if (std::is_same_v<Value, double>) return 'd';
  if (std::is_same_v<Value, std::int32_t>) return 'i';
  if (std::is_same_v<Value, std::int64_t>) return 'l';
  return std::is_same_v<Value, std::size_t> ? 'z' : 'u';
}

struct Line {
  const char* words;
  std::size_t offset;
  char type;
  std::size_t count;
};

template <typename Member>
constexpr std::size_t kCount = std::is_array_v<Member> ? std::extent_v<Member> : 1;

#define EXMAT_MEMBER(structure, member)                                                                         \
  {#structure " " #member, offsetof(exmat_##structure, member), type_of<decltype(exmat_##structure::member)>(), \
   kCount<decltype(exmat_##structure::member)>},
#define EXMAT_SIZE(structure) {#structure " .", sizeof(exmat_##structure), 's', 1},

// clang-format off
constexpr Line kLines[] = {
  EXMAT_SIZE(settings)
  EXMAT_MEMBER(settings, size)
  EXMAT_MEMBER(settings, time_step)
  EXMAT_MEMBER(settings, gravity)
  EXMAT_MEMBER(settings, mass_damping)
  EXMAT_MEMBER(settings, stiffness_damping)
  EXMAT_MEMBER(settings, newton_tolerance)
  EXMAT_MEMBER(settings, example_stiffness)
  EXMAT_MEMBER(settings, example_damping)
  EXMAT_MEMBER(settings, example_bias)
  EXMAT_MEMBER(settings, newton_iterations)
  EXMAT_MEMBER(settings, integrator)
  EXMAT_MEMBER(settings, internal_force)
  EXMAT_MEMBER(settings, use_examples)
  EXMAT_MEMBER(settings, example_target)
  EXMAT_MEMBER(settings, target_iterations)
  EXMAT_MEMBER(settings, energy_reference)
  EXMAT_MEMBER(settings, use_contact)
  EXMAT_MEMBER(settings, sleep_energy)
  EXMAT_MEMBER(settings, sleep_time)
  EXMAT_MEMBER(settings, precision)
  EXMAT_MEMBER(settings, space)
  EXMAT_MEMBER(settings, space_release)
  EXMAT_SIZE(contact_law)
  EXMAT_MEMBER(contact_law, size)
  EXMAT_MEMBER(contact_law, stiffness)
  EXMAT_MEMBER(contact_law, damping)
  EXMAT_MEMBER(contact_law, friction)
  EXMAT_MEMBER(contact_law, self)
  EXMAT_MEMBER(contact_law, apart)
  EXMAT_MEMBER(contact_law, release)
  EXMAT_SIZE(obstacle)
  EXMAT_MEMBER(obstacle, size)
  EXMAT_MEMBER(obstacle, point)
  EXMAT_MEMBER(obstacle, direction)
  EXMAT_MEMBER(obstacle, half_extents)
  EXMAT_MEMBER(obstacle, orientation)
  EXMAT_MEMBER(obstacle, radius)
  EXMAT_MEMBER(obstacle, stiffness)
  EXMAT_MEMBER(obstacle, damping)
  EXMAT_MEMBER(obstacle, friction)
  EXMAT_MEMBER(obstacle, shape)
  EXMAT_MEMBER(obstacle, group)
  EXMAT_MEMBER(obstacle, mask)
  EXMAT_SIZE(motion)
  EXMAT_MEMBER(motion, size)
  EXMAT_MEMBER(motion, position)
  EXMAT_MEMBER(motion, orientation)
  EXMAT_MEMBER(motion, linear_velocity)
  EXMAT_MEMBER(motion, angular_velocity)
  EXMAT_SIZE(attachment)
  EXMAT_MEMBER(attachment, size)
  EXMAT_MEMBER(attachment, kind)
  EXMAT_MEMBER(attachment, stiffness)
  EXMAT_MEMBER(attachment, damping)
  EXMAT_MEMBER(attachment, break_force)
  EXMAT_SIZE(energies)
  EXMAT_MEMBER(energies, size)
  EXMAT_MEMBER(energies, kinetic)
  EXMAT_MEMBER(energies, elastic)
  EXMAT_MEMBER(energies, potential)
  EXMAT_MEMBER(energies, contact)
  EXMAT_SIZE(touch)
  EXMAT_MEMBER(touch, body)
  EXMAT_MEMBER(touch, other)
  EXMAT_MEMBER(touch, obstacle)
  EXMAT_MEMBER(touch, change)
  EXMAT_SIZE(ray_hit)
  EXMAT_MEMBER(ray_hit, size)
  EXMAT_MEMBER(ray_hit, body)
  EXMAT_MEMBER(ray_hit, surface)
  EXMAT_MEMBER(ray_hit, triangle)
  EXMAT_MEMBER(ray_hit, shares)
  EXMAT_MEMBER(ray_hit, distance)
  EXMAT_MEMBER(ray_hit, normal)
  EXMAT_MEMBER(ray_hit, obstacle)
};
// clang-format on

std::string layouts() {
  std::string text;
  for (const Line& line : kLines)
    text += std::string(line.words) + ' ' + std::to_string(line.offset) + ' ' + line.type + ' ' +
            std::to_string(line.count) + '\n';
  return text;
}

}  // namespace

extern "C" EXMAT_API const char* exmat_web_layouts() {
  static const std::string text = layouts();
  return text.c_str();
}
