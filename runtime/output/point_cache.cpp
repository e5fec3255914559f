#include "runtime/output/point_cache.h"

#include <bit>
#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <limits>
#include <system_error>
#include <vector>

#include "common/bundle/file_schemas.h"
#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "common/hdf5/value_checks.h"

namespace exmat::runtime {
namespace {

/// The frames of one dataset of positions, F x points x 3.
class PositionReader {
 public:
  PositionReader(const std::filesystem::path& trajectory, bool mesh)
      : file_(open(trajectory)),
        dataset_(
            file_.open_dataset(!mesh && file_.has_dataset("/render/vertices") ? "/render/vertices" : "/vertices")) {
    const auto& sizes = dataset_.sizes();
    if (dataset_.type() != ElementType::kFloat32 || sizes.size() != 3 || sizes[2] != 3 || dataset_.element_count() == 0)
      refuse(dataset_.path(), "float32 of F x n x 3",
             fmt::format("{} of {}", dataset_.type_name(), fmt::join(sizes, " x ")));
    for (const std::int64_t size : {samples(), points()})
      if (size > std::numeric_limits<std::int32_t>::max())
        refuse(dataset_.path(), "as many frames and points as a 32-bit number counts", fmt::format("{}", size));
    dataset_.check_storage();
  }

  const std::string& path() const { return dataset_.path(); }
  std::int64_t samples() const { return dataset_.sizes()[0]; }
  std::int64_t points() const { return dataset_.sizes()[1]; }

  /// The next frame, xyz of each point.
  void read_next(std::vector<float>& frame) {
    frame.resize(static_cast<std::size_t>(3 * points()));
    dataset_.read_rows(next_++, 1, frame.data(), ElementType::kFloat32);
    crc_ = crc32_of(std::as_bytes(std::span(frame)), crc_);
    const std::int64_t sizes[] = {points(), 3};
    if (const auto fault = check_values(trajectory_schema().dataset(path()), sizes, frame.data(), {}))
      refuse(fmt::format("{}, frame {}", path(), next_ - 1), fault->expected, fault->found);
  }

  /// To be called after the last frame.
  void check_sum() const {
    const AttributeValue stored = file_.read_attribute(path(), "crc32");
    const auto* sum = std::get_if<std::int64_t>(&stored);
    if (sum == nullptr || *sum != crc_)
      refuse(path(), sum == nullptr ? "a checksum" : fmt::format("checksum {:08x}", *sum), fmt::format("{:08x}", crc_),
             "the data are damaged or were changed after the trajectory was written");
  }

  /// Seconds from frame to frame; of one frame 0.
  double spacing() const {
    if (samples() < 2) return 0;
    double times[2] = {};
    const Hdf5Dataset time = file_.open_dataset("/time");
    if (time.sizes() != std::vector{samples()}) refuse("/time", "a time for each frame", "another number");
    time.read_rows(0, 2, times, ElementType::kFloat64);
    return times[1] - times[0];
  }

 private:
  static Hdf5File open(const std::filesystem::path& trajectory) {
    Hdf5File file = Hdf5File::open(trajectory);
    for (const AttributeSchema& schema : trajectory_schema().attributes) {
      if (schema.name != "format" && schema.name != "format_version") continue;
      const AttributeValue value = file.read_attribute("/", schema.name);
      if (const auto fault = check_value(schema, value, {}))
        throw InputError({file.name(), "/@" + schema.name, fault->expected, fault->found, "is this a trajectory?"});
      const auto* version = std::get_if<std::int64_t>(&value);
      if (version != nullptr && *version > trajectory_schema().format_version)
        throw InputError({file.name(), "/@" + schema.name,
                          fmt::format("at most {}", trajectory_schema().format_version), fmt::format("{}", *version),
                          "a newer version of exmat wrote this trajectory"});
    }
    return file;
  }

  [[noreturn]] void refuse(const std::string& place, const std::string& expected, const std::string& found,
                           const std::string& advice = "") const {
    throw InputError({file_.name(), place, expected, found, advice});
  }

  Hdf5File file_;
  Hdf5Dataset dataset_;
  std::int64_t next_ = 0;
  std::uint32_t crc_ = 0;
};

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
  PositionReader reader(trajectory, options.mesh);
  PointCacheSummary summary{reader.path(), reader.points(), reader.samples()};
  if (options.frame_rate && reader.samples() > 1) summary.sample_rate = reader.spacing() * *options.frame_rate;

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
