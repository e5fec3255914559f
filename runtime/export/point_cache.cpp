#include "runtime/export/point_cache.h"

#include <bit>
#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <system_error>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "runtime/export/trajectory_reader.h"

namespace exmat::runtime {
namespace {

/// Seconds from frame to frame; of one frame 0.
double spacing(TrajectoryReader& trajectory) {
  const RowMatrix times = trajectory.read("/time");
  return times.size() < 2 ? 0 : times(1) - times(0);
}

/// Little-endian values to a file.
class ValueWriter {
 public:
  explicit ValueWriter(const AtomicFile& output)
      : target_(output.target()), stream_(output.temporary(), std::ios::binary | std::ios::trunc) {
    require();
  }

  void bytes(std::string_view bytes) { stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size())); }

  template <typename T>
  void value(T value) {
    static_assert(sizeof(T) == 4);
    auto bits = std::bit_cast<std::uint32_t>(value);
    if constexpr (std::endian::native == std::endian::big) bits = __builtin_bswap32(bits);
    char raw[4];
    std::memcpy(raw, &bits, 4);
    bytes({raw, 4});
  }

  void finish() {
    stream_.close();
    require();
  }

  void require() const {
    if (!stream_) throw WorkError("cannot write " + target_.string() + ": " + std::generic_category().message(errno));
  }

 private:
  const std::filesystem::path& target_;
  std::ofstream stream_;
};

}  // namespace

PointCacheSummary write_point_cache(const std::filesystem::path& trajectory, const std::filesystem::path& target,
                                    const PointCacheOptions& options) {
  TrajectoryReader reader(trajectory);
  if (options.body) reader.select(*options.body);
  if (const auto bodies = reader.bodies(); !options.body && !bodies.empty())
    reader.refuse("/bodies", "one body: a point cache holds no more", fmt::format("{} bodies", bodies.size()),
                  fmt::format("write a file for each: --body {}, and so on", bodies.front()));
  PointCacheSummary summary{reader.open_positions(options.mesh), reader.points(), reader.samples()};
  summary.origin = reader.origin();
  const double seconds = spacing(reader);  // read in any case: times that do not increase are no motion
  if (options.frame_rate && reader.samples() > 1) summary.sample_rate = seconds * *options.frame_rate;

  AtomicFile output(target);
  ValueWriter writer(output);
  constexpr std::string_view kMagic("POINTCACHE2\0", 12);
  writer.bytes(kMagic);
  writer.value(std::int32_t{1});
  writer.value(static_cast<std::int32_t>(summary.points));
  writer.value(0.0F);
  writer.value(static_cast<float>(summary.sample_rate));
  writer.value(static_cast<std::int32_t>(summary.samples));
  std::vector<float> frame;
  for (std::int64_t sample = 0; sample < summary.samples; ++sample) {
    reader.read_next(frame);
    for (const float coordinate : frame) writer.value(coordinate);
    writer.require();
  }
  reader.check_sum();
  writer.finish();
  output.commit();
  return summary;
}

}  // namespace exmat::runtime
