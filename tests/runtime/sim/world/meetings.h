#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "tests/runtime/sim/world/touching_blocks.h"

namespace exmat::runtime::test {

/// Two equal bodies that fly at each other.
struct Meeting {
  double youngs_modulus = 1e4;  ///< [Pa]
  double speed = 10;            ///< speed of either [m/s]
  double stiffness = 1e7;       ///< [N/m^3]
  double time_step = 1.0 / 60;  ///< [s]
  bool damped = false;          ///< damping in the contact, beside friction of 0.4
  int bodies = 0;               ///< index into kMeetingBodies
  int start = 0;                ///< index into kMeetingStarts
  int full = 0;                 ///< number of the two that step in all vertices
};

/// A cube and a bar.
inline const std::array<exmat::test::BarOptions, 2> kMeetingBodies{
    {{.cells = {3, 3, 3}, .lengths = {1, 1, 1}, .free = true, .linear_modes = 12},
     {.cells = {4, 2, 2}, .lengths = {1, 0.4, 0.4}, .free = true, .linear_modes = 12}}};

/// Start of the second: its place, and its turn about (1, 2, 0.5): flush, beside, turned.
struct MeetingStart {
  Eigen::Vector3d offset;
  double angle = 0;
};
inline const std::array<MeetingStart, 3> kMeetingStarts{
    {{{1.1, 0, 0}, 0}, {{1.1, 0.13, 0.09}, 0}, {{1.3, -0.07, 0.11}, 0.6}}};

/// Result of a meeting.
struct MeetingResult {
  double peak = 0;   ///< largest sum of kinetic and elastic energy and that of contacts, over the start
  double drift = 0;  ///< largest change of linear and of angular momentum, over what either body began with
  int steps = 0, touching = 0, non_finite = 0, unconverged = 0;
};

inline FullBlocks meeting_blocks(const Meeting& meeting) {
  exmat::test::BarOptions options = kMeetingBodies[static_cast<std::size_t>(meeting.bodies)];
  options.youngs_modulus = meeting.youngs_modulus;
  return {meeting.time_step, options};
}

inline ContactLaw law_of(const Meeting& meeting) {
  return meeting.damped ? ContactLaw{meeting.stiffness, meeting.stiffness / 1e3, 0.4}
                        : ContactLaw{meeting.stiffness, 0, 0};
}

inline World meeting_world(const FullBlocks& blocks, const Meeting& meeting) {
  const auto& [offset, angle] = kMeetingStarts[static_cast<std::size_t>(meeting.start)];
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 0.5).normalized()));
  std::vector<WorldBodyStart> bodies;
  bodies.push_back(blocks.body({0, 0, 0}, {meeting.speed, 0, 0}));
  bodies.push_back(blocks.body(offset, {-meeting.speed, 0, 0}, Eigen::Vector3d::Zero(), turn));
  for (int i = 0; i < meeting.full; ++i) blocks.put_in_full_space(bodies[static_cast<std::size_t>(i)]);
  return World(std::move(bodies), law_of(meeting));
}

/// Until either would have gone three lengths by itself, at least 20 steps.
inline MeetingResult meet(const FullBlocks& blocks, const Meeting& meeting) {
  World world = meeting_world(blocks, meeting);
  MeetingResult result;
  const Momenta before = momenta(blocks, world);
  const double start = world.energies().total();
  const double momentum = blocks.mass() * meeting.speed;
  const int steps = std::clamp(static_cast<int>(3 / (meeting.speed * meeting.time_step)), 20, 200);
  for (int i = 0; i < steps; ++i) {
    const WorldReport report = world.step(1);
    ++result.steps;
    result.touching += report.touching_pairs > 0 ? 1 : 0;
    result.unconverged += report.unconverged_islands > 0 ? 1 : 0;
    result.non_finite += ((world.report(0).status | world.report(1).status) & kStepNonFinite) != 0 ? 1 : 0;
    const Energies now = world.energies();
    if (!(now.total() / start <= result.peak)) result.peak = now.total() / start;
    const Momenta there = momenta(blocks, world);
    result.drift = std::max({result.drift, (there.linear - before.linear).norm() / momentum,
                             (there.angular - before.angular).norm() / momentum});
  }
  return result;
}

inline std::vector<Meeting> all_meetings() {
  std::vector<Meeting> all;
  for (int bodies = 0; bodies < static_cast<int>(kMeetingBodies.size()); ++bodies)
    for (const double youngs_modulus : {1e3, 3e3, 1e4, 1e5, 1e7})
      for (const double speed : {1.0, 2.0, 5.0, 20.0, 50.0})
        for (const double stiffness : {1e6, 1e7, 1e8, 1e9})
          for (const double time_step : {1e-3, 1.0 / 240, 1.0 / 60})
            for (const bool damped : {false, true})
              for (int start = 0; start < static_cast<int>(kMeetingStarts.size()); ++start)
                all.push_back({youngs_modulus, speed, stiffness, time_step, damped, bodies, start});
  return all;
}

/// So many of them, at random.
inline std::vector<Meeting> some_meetings(std::size_t count, std::uint32_t seed) {
  const std::vector<Meeting> all = all_meetings();
  std::mt19937 generator(seed);
  std::vector<Meeting> some;
  for (std::size_t i = 0; i < count; ++i) some.push_back(all[generator() % all.size()]);
  return some;
}

/// Two bars and a soft cube, one behind the other, before a plane x = 0 that the latter two fly at by 50 m/s.
struct Squeeze {
  std::array<Eigen::Vector3d, 3> places;      ///< of their corners [m]
  double first_speed = 0;                     ///< speed of the first bar towards the plane [m/s]
  double plane_stiffness = 0, stiffness = 0;  ///< of the plane and between them [N/m^3]
};

/// Largest sum of kinetic and elastic energy in a second, over the start.
inline double peak_of(const Squeeze& squeeze) {
  const auto blocks_of = [](std::array<int, 3> cells, std::array<double, 3> lengths, double youngs_modulus, int modes) {
    return exmat::test::BarOptions{.cells = cells,
                                   .lengths = lengths,
                                   .youngs_modulus = youngs_modulus,
                                   .poisson_ratio = 0.3,
                                   .free = true,
                                   .linear_modes = modes};
  };
  Blocks bars(1.0 / 60, blocks_of({8, 2, 2}, {1, 0.25, 0.25}, 1e6, 15));
  Blocks cubes(1.0 / 60, blocks_of({3, 3, 3}, {1, 1, 1}, 3e3, 12));
  const Plane plane{{0, 0, 0}, Eigen::Vector3d::UnitX()};
  for (Blocks* const blocks : {&bars, &cubes})
    blocks->scene.obstacles.push_back(Obstacle{plane, RigidMotion(), squeeze.plane_stiffness, 0, 0});
  std::vector<WorldBodyStart> bodies;
  bodies.push_back(bars.body(squeeze.places[0], {-squeeze.first_speed, 0, 0}));
  bodies.push_back(bars.body(squeeze.places[1], {-50, 0, 0}));
  bodies.push_back(cubes.body(squeeze.places[2], {-50, 0, 0}));
  World world(std::move(bodies), {squeeze.stiffness, 0, 0});
  const double start = world.energies().total();
  double peak = 0;
  for (int i = 0; i < 60; ++i) {
    world.step(1);
    if (!(world.energies().total() / start <= peak)) peak = world.energies().total() / start;
  }
  return peak;
}

/// So many of them, at random.
inline std::vector<Squeeze> some_squeezes(std::size_t count, std::uint32_t seed) {
  std::mt19937 generator(seed);
  const auto between = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(generator()) / 4294967296.0);
  };
  const auto aside = [&](double centre) { return centre + between(-0.4, 0.4); };
  std::vector<Squeeze> some(count);
  for (Squeeze& own : some) {
    double x = between(0.5, 1.5);
    for (Eigen::Vector3d& place : own.places) {
      const double centre = &place == &own.places.back() ? -0.4 : 0;  // cubes are wider
      place = {x, aside(centre), aside(centre)};
      x += between(1.05, 1.65);
    }
    own.first_speed = 10.0 * (generator() % 2);
    own.plane_stiffness = std::pow(10, between(6, 8));
    own.stiffness = std::pow(10, between(6, 9));
  }
  return some;
}

}  // namespace exmat::runtime::test
