// Bodies that meet, at the ends of every range: which of them gain energy or end.
//   exmat-meetings [COUNT [FULL]]
// takes COUNT of them at random, 0: all; FULL of the two bodies step in all vertices. Then as many, or 400, that others
// squeeze against a plane, in their modes. docs/stability.md, "Bodies that meet".

#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "tests/runtime/sim/world/meetings.h"

namespace {

using exmat::runtime::test::Meeting;
using exmat::runtime::test::MeetingResult;

constexpr double kGain = 1e-6, kDrift = 1e-9;

void print(const Meeting& meeting, const MeetingResult& result) {
  std::printf(
      "E %g Pa, %g m/s, %g N/m^3, %g s, damped %d, body %d, start %d: peak %g, drift %g, not finite %d, "
      "unconverged %d of %d steps\n",
      meeting.youngs_modulus, meeting.speed, meeting.stiffness, meeting.time_step, meeting.damped, meeting.bodies,
      meeting.start, result.peak, result.drift, result.non_finite, result.unconverged, result.steps);
}

}  // namespace

int main(int argc, char** argv) {
  namespace test = exmat::runtime::test;
  const std::size_t count = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 0;
  std::vector<Meeting> meetings = count > 0 ? test::some_meetings(count, 7) : test::all_meetings();
  for (Meeting& meeting : meetings) meeting.full = argc > 2 ? std::atoi(argv[2]) : 0;
  int gain = 0, ended = 0, drifted = 0, unconverged = 0, steps = 0;
  double highest = 0;
  const auto begin = std::chrono::steady_clock::now();
  for (const Meeting& meeting : meetings) {
    const MeetingResult result = test::meet(test::meeting_blocks(meeting), meeting);
    const bool gains = !(result.peak <= 1 + kGain), ends = result.non_finite > 0, drifts = result.drift > kDrift;
    gain += gains ? 1 : 0;
    ended += ends ? 1 : 0;
    drifted += drifts ? 1 : 0;
    unconverged += result.unconverged;
    steps += result.steps;
    highest = std::max(highest, result.peak);
    if (gains || ends || drifts) print(meeting, result);
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  std::printf(
      "%zu meetings: %d gain energy, at most %g times; %d end, %d lose momentum; %d of %d steps unconverged; %.1f s\n",
      meetings.size(), gain, highest, ended, drifted, unconverged, steps, seconds.count());
  const std::size_t squeezes = count > 0 ? count : 400;
  int squeezed = 0;
  for (const test::Squeeze& squeeze : test::some_squeezes(squeezes, 7)) {
    const double peak = test::peak_of(squeeze);
    if (peak <= 1 + kGain) continue;
    ++squeezed;
    std::printf("squeezed, plane %g, contact %g N/m^3: peak %g\n", squeeze.plane_stiffness, squeeze.stiffness, peak);
  }
  std::printf("%zu squeezed against a plane: %d gain energy\n", squeezes, squeezed);
  return gain + ended + drifted + squeezed > 0 ? 1 : 0;
}
