#include "precompute/study/measure/frames.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/fnv_hash.h"

namespace exmat::precompute {
namespace {

constexpr double kWholeTolerance = 1e-6;  // of a number of steps
constexpr int kMostMultiples = 10000;

bool is_whole(double number) {
  return std::abs(number - std::round(number)) <= kWholeTolerance * std::max(1.0, number);
}

// The smallest multiple of the largest time step that is one of all others.
std::optional<double> common_multiple(const std::vector<double>& time_steps, double limit) {
  const double largest = std::ranges::max(time_steps);
  for (int k = 1; k <= kMostMultiples && k * largest <= limit * (1 + kWholeTolerance); ++k)
    if (std::ranges::all_of(time_steps, [&](double step) { return is_whole(k * largest / step); })) return k * largest;
  return std::nullopt;
}

constexpr std::string_view kMagic = "exmat frames 2\n";

template <typename T>
void put(std::string& bytes, const T* values, std::size_t count) {
  bytes.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

// Takes values from the front; false where there are too few.
template <typename T>
bool take(std::string_view& bytes, T* values, std::size_t count) {
  const std::size_t size = count * sizeof(T);
  if (bytes.size() < size) return false;
  if (size > 0) std::memcpy(values, bytes.data(), size);
  bytes.remove_prefix(size);
  return true;
}

// The scalars of each frame, and those of the whole.
constexpr auto kSeries = std::to_array<std::vector<double> BodyFrames::*>(
    {&BodyFrames::times, &BodyFrames::kinetic, &BodyFrames::elastic, &BodyFrames::potential});
constexpr auto kCounts = std::to_array<std::int64_t BodyFrames::*>({&BodyFrames::steps, &BodyFrames::unconverged});
constexpr auto kMeans = std::to_array<double BodyFrames::*>(
    {&BodyFrames::newton_iterations, &BodyFrames::factorisations, &BodyFrames::step_seconds});
constexpr auto kFields =
    std::to_array<std::vector<VertexArray> BodyFrames::*>({&BodyFrames::positions, &BodyFrames::velocities});

// A rebound is a flag, its time and its velocity.
using ReboundNumbers = std::array<double, 5>;

ReboundNumbers to_numbers(const std::optional<Rebound>& rebound) {
  if (!rebound) return {};
  const Eigen::Vector3d& v = rebound->velocity;
  return {1, rebound->time, v.x(), v.y(), v.z()};
}

std::optional<Rebound> from_numbers(const ReboundNumbers& numbers) {
  if (numbers[0] == 0) return std::nullopt;
  return Rebound{numbers[1], {numbers[2], numbers[3], numbers[4]}};
}

// Size that `sizes` = F, n asks for, in bytes.
double expected_size(const std::array<std::uint64_t, 2>& sizes) {
  const auto F = static_cast<double>(sizes[0]), n = static_cast<double>(sizes[1]);
  return 8 * (kCounts.size() + kMeans.size() + ReboundNumbers().size() + F * (kSeries.size() + 3 * n * kFields.size()));
}

std::optional<BodyFrames> parse(std::string_view bytes) {
  std::array<std::uint64_t, 2> sizes{};
  if (!take(bytes, sizes.data(), 2) || static_cast<double>(bytes.size()) != expected_size(sizes)) return std::nullopt;
  BodyFrames frames;
  bool whole = true;
  for (const auto member : kCounts) whole = take(bytes, &(frames.*member), 1) && whole;
  for (const auto member : kMeans) whole = take(bytes, &(frames.*member), 1) && whole;
  ReboundNumbers rebound{};
  whole = take(bytes, rebound.data(), rebound.size()) && whole;
  frames.rebound = from_numbers(rebound);
  for (const auto member : kSeries) {
    (frames.*member).resize(sizes[0]);
    whole = take(bytes, (frames.*member).data(), sizes[0]) && whole;
  }
  for (const auto member : kFields)
    for (std::uint64_t i = 0; i < sizes[0]; ++i) {
      VertexArray& field = (frames.*member).emplace_back(static_cast<Eigen::Index>(sizes[1]), 3);
      whole = take(bytes, field.data(), static_cast<std::size_t>(field.size())) && whole;
    }
  return whole ? std::optional(std::move(frames)) : std::nullopt;
}

}  // namespace

std::vector<double> frame_times(double duration, std::vector<double> time_steps, int frames) {
  const auto base = common_multiple(time_steps, duration);
  if (!base)
    throw InputError({"", "/sweeps", fmt::format("time steps with a common multiple up to {:g} s", duration),
                      fmt::format("{:g}", fmt::join(time_steps, ", ")), "let each be a multiple of the next"});
  const auto intervals = static_cast<std::int64_t>(std::floor(duration / *base * (1 + kWholeTolerance)));
  const std::int64_t stride = (intervals + frames - 1) / frames;
  std::vector<double> times;
  for (std::int64_t i = stride; i <= intervals; i += stride) times.push_back(static_cast<double>(i) * *base);
  if (const double end = static_cast<double>(intervals) * *base; times.back() < end) {
    if (std::ssize(times) == frames) times.pop_back();
    times.push_back(end);
  }
  return times;
}

void write_frames(const std::filesystem::path& file, const BodyFrames& frames) {
  const std::uint64_t sizes[] = {frames.times.size(),
                                 frames.positions.empty() ? 0 : static_cast<std::uint64_t>(frames.positions[0].rows())};
  std::string bytes;
  put(bytes, sizes, 2);
  for (const auto member : kCounts) put(bytes, &(frames.*member), 1);
  for (const auto member : kMeans) put(bytes, &(frames.*member), 1);
  const ReboundNumbers rebound = to_numbers(frames.rebound);
  put(bytes, rebound.data(), rebound.size());
  for (const auto member : kSeries) put(bytes, (frames.*member).data(), (frames.*member).size());
  for (const auto member : kFields)
    for (const VertexArray& field : frames.*member) put(bytes, field.data(), static_cast<std::size_t>(field.size()));
  const std::uint64_t hash = fnv_hash(bytes);
  put(bytes, &hash, 1);
  write_file_atomically(file, std::string(kMagic) + bytes);
}

std::optional<BodyFrames> read_frames(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string content{std::istreambuf_iterator<char>(stream), {}};
  std::string_view bytes = content;
  std::uint64_t hash = 0;
  if (!stream || !bytes.starts_with(kMagic) || bytes.size() < kMagic.size() + sizeof hash) return std::nullopt;
  bytes.remove_prefix(kMagic.size());
  std::string_view tail = bytes.substr(bytes.size() - sizeof hash);
  bytes.remove_suffix(sizeof hash);
  take(tail, &hash, 1);
  return hash == fnv_hash(bytes) ? parse(bytes) : std::nullopt;
}

}  // namespace exmat::precompute
