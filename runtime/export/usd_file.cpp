#include "runtime/export/usd_file.h"

#include <Eigen/Geometry>
#include <cerrno>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <system_error>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/progress.h"
#include "runtime/export/trajectory_reader.h"

namespace exmat::runtime {
namespace {

using Points = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>>;

/// Text to a file, gathered in memory by pieces.
class TextWriter {
 public:
  explicit TextWriter(const AtomicFile& output)
      : target_(output.target()), stream_(output.temporary(), std::ios::binary | std::ios::trunc) {}

  template <typename... Values>
  void add(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }
  void flush() {
    stream_.write(text_.data(), static_cast<std::streamsize>(text_.size()));
    text_.clear();
    require();
  }
  void finish() {
    flush();
    stream_.close();
    require();
  }

 private:
  void require() const {
    if (!stream_) throw WorkError("cannot write " + target_.string() + ": " + std::generic_category().message(errno));
  }

  std::filesystem::path target_;
  std::ofstream stream_;
  fmt::memory_buffer text_;
};

void add_points(const Points& points, double code, TextWriter& writer) {
  writer.add("        {:.9g}: [", code);
  for (Eigen::Index k = 0; k < points.rows(); ++k)
    writer.add("{}({}, {}, {})", k == 0 ? "" : ", ", points(k, 0), points(k, 1), points(k, 2));
  writer.add("],\n");
}

void add_triangles(const TriangleArray& triangles, TextWriter& writer) {
  writer.add("    int[] faceVertexCounts = [");
  for (Eigen::Index k = 0; k < triangles.rows(); ++k) writer.add("{}3", k == 0 ? "" : ", ");
  writer.add("]\n    int[] faceVertexIndices = [");
  for (Eigen::Index k = 0; k < triangles.rows(); ++k)
    writer.add("{}{}, {}, {}", k == 0 ? "" : ", ", triangles(k, 0), triangles(k, 1), triangles(k, 2));
  writer.add("]\n");
}

}  // namespace

UsdSummary write_usd(const std::filesystem::path& trajectory, const std::filesystem::path& target,
                     const UsdOptions& options) {
  TrajectoryReader reader(trajectory);
  const TriangleArray triangles = reader.triangles(options.mesh);
  const RowMatrix times = reader.read("/time");
  UsdSummary summary{reader.open_positions(options.mesh), reader.points(), reader.samples()};
  const RowMatrix codes = options.frame_rate * times;

  AtomicFile output(target);
  TextWriter writer(output);
  writer.add("#usda 1.0\n(\n    defaultPrim = \"body\"\n    metersPerUnit = 1\n    upAxis = \"{}\"\n",
             options.up == UpAxis::kY ? "Y" : "Z");
  writer.add("    startTimeCode = {:.9g}\n    endTimeCode = {:.9g}\n    timeCodesPerSecond = {:.9g}\n)\n\n", codes(0),
             codes(codes.size() - 1), options.frame_rate);
  writer.add("def Mesh \"body\"\n{{\n    uniform token subdivisionScheme = \"none\"\n");
  add_triangles(triangles, writer);
  writer.add("    point3f[] points.timeSamples = {{\n");
  std::vector<float> frame;
  std::vector<Eigen::AlignedBox3f> boxes;
  Progress progress("frames", summary.samples);
  for (std::int64_t sample = 0; sample < summary.samples; ++sample) {
    reader.read_next(frame);
    const Points points(frame.data(), reader.points(), 3);
    boxes.emplace_back(points.colwise().minCoeff().transpose(), points.colwise().maxCoeff().transpose());
    add_points(points, codes(sample), writer);
    writer.flush();
    progress.advance();
  }
  reader.check_sum();
  writer.add("    }}\n    float3[] extent.timeSamples = {{\n");
  for (std::int64_t sample = 0; sample < summary.samples; ++sample) {
    const auto& low = boxes[static_cast<std::size_t>(sample)].min();
    const auto& high = boxes[static_cast<std::size_t>(sample)].max();
    writer.add("        {:.9g}: [({}, {}, {}), ({}, {}, {})],\n", codes(sample), low.x(), low.y(), low.z(), high.x(),
               high.y(), high.z());
  }
  writer.add("    }}\n}}\n");
  writer.finish();
  summary.bytes = static_cast<std::int64_t>(std::filesystem::file_size(output.temporary()));
  output.commit();
  return summary;
}

}  // namespace exmat::runtime
