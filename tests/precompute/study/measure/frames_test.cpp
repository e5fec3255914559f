#include "precompute/study/measure/frames.h"

#include <cmath>
#include <gtest/gtest.h>

#include "common/core/error.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

BodyFrames some_frames() {
  BodyFrames frames;
  for (int i = 1; i <= 3; ++i) {
    frames.times.push_back(0.1 * i);
    frames.positions.push_back(VertexArray::Constant(4, 3, i + 1.0 / 3));
    frames.velocities.push_back(VertexArray::Constant(4, 3, -i));
    frames.kinetic.push_back(i);
    frames.elastic.push_back(10 * i);
    frames.potential.push_back(-i);
  }
  frames.steps = 30;
  frames.unconverged = 2;
  frames.newton_iterations = 2.5;
  frames.step_seconds = 1e-3;
  frames.rebound = Rebound{0.17, {0.1, -2, 1.0 / 3}};
  return frames;
}

TEST(FrameTimes, AreMultiplesOfEveryTimeStepUpToTheEnd) {
  for (const auto& [duration, steps, most] : {std::tuple(2.0, std::vector<double>{0.001}, 200),
                                              {0.7, {0.001, 0.002, 0.004}, 50},
                                              {1.0, {0.01}, 30},
                                              {0.1, {1.0 / 60, 1.0 / 120}, 10},
                                              {0.997, {0.001}, 100},
                                              {0.5, {0.0015, 0.001}, 1}}) {
    const auto times = frame_times(duration, steps, most);
    EXPECT_LE(std::ssize(times), most);
    EXPECT_GE(std::ssize(times), 1);
    double previous = 0;
    for (const double time : times) {
      EXPECT_GT(time, previous);
      previous = time;
      for (const double step : steps) EXPECT_NEAR(time / step, std::round(time / step), 1e-6);
    }
    EXPECT_LE(times.back(), duration * (1 + 1e-6));
    EXPECT_GT(times.back() + 0.0031 + 1.0 / 60, duration) << "to the end";
  }
  EXPECT_EQ(frame_times(2.0, {0.001}, 200).size(), 200U);
  EXPECT_EQ(frame_times(0.005, {0.001}, 200).size(), 5U) << "no more than steps";
}

TEST(FrameTimes, NeedACommonMultiple) {
  EXPECT_THROW(frame_times(1.0, {0.001, std::sqrt(2) * 0.001}, 10), InputError);
  EXPECT_THROW(frame_times(0.5, {1.0}, 10), InputError) << "longer than the scene";
}

TEST(FramesFile, KeepsEveryBit) {
  const test::TemporaryFolder folder;
  const BodyFrames frames = some_frames();
  write_frames(folder / "a.frames", frames);
  const auto read = read_frames(folder / "a.frames");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->times, frames.times);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read->positions[i], frames.positions[i]);
    EXPECT_EQ(read->velocities[i], frames.velocities[i]);
  }
  EXPECT_EQ(read->kinetic, frames.kinetic);
  EXPECT_EQ(read->elastic, frames.elastic);
  EXPECT_EQ(read->potential, frames.potential);
  EXPECT_EQ(read->steps, 30);
  EXPECT_EQ(read->unconverged, 2);
  EXPECT_EQ(read->newton_iterations, 2.5);
  EXPECT_EQ(read->step_seconds, 1e-3);
  EXPECT_EQ(read->rebound.value().time, 0.17);
  EXPECT_EQ(read->rebound->velocity, Eigen::Vector3d(0.1, -2, 1.0 / 3));
}

TEST(FramesFile, MayBeOfNoFrames) {
  const test::TemporaryFolder folder;
  BodyFrames frames;
  frames.steps = 7;
  write_frames(folder / "a.frames", frames);
  const auto read = read_frames(folder / "a.frames");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->steps, 7);
  EXPECT_TRUE(read->times.empty());
  EXPECT_FALSE(read->rebound);
}

TEST(FramesFile, IsNotTakenWhereItIsDamaged) {
  const test::TemporaryFolder folder;
  write_frames(folder / "a.frames", some_frames());
  const std::string sound = test::read_file(folder / "a.frames");
  EXPECT_FALSE(read_frames(folder / "none.frames"));
  for (std::size_t length = 0; length < sound.size(); length += 7) {
    test::write_file(folder / "b.frames", sound.substr(0, length));
    EXPECT_FALSE(read_frames(folder / "b.frames")) << length;
  }
  for (std::size_t at = 0; at < sound.size(); at += 11) {
    std::string spoilt = sound;
    spoilt[at] = static_cast<char>(spoilt[at] ^ 1);
    test::write_file(folder / "b.frames", spoilt);
    EXPECT_FALSE(read_frames(folder / "b.frames")) << at;
  }
  test::write_file(folder / "b.frames", sound + "x");
  EXPECT_FALSE(read_frames(folder / "b.frames"));
}

}  // namespace
}  // namespace exmat::precompute
