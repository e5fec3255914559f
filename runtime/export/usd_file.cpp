#include "runtime/export/usd_file.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cerrno>
#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <set>
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

/// A body of the file.
struct Prim {
  std::string name;  ///< an identifier, each once
  std::string body;  ///< name in the trajectory; empty: the only one
  int shared = -1;   ///< class that holds its triangles; -1: it does itself
};

/// Writes prims of one trajectory.
class UsdWriter {
 public:
  UsdWriter(TrajectoryReader& reader, const UsdOptions& options, TextWriter& writer, Progress& progress)
      : reader_(reader), options_(options), writer_(writer), progress_(progress) {}

  void add_class(int number, const TriangleArray& triangles) {
    writer_.add("class Mesh \"triangles_{}\"\n{{\n    uniform token subdivisionScheme = \"none\"\n", number);
    add_triangles("", triangles);
    writer_.add("}}\n\n");
  }

  /// `pad` stands before its lines.
  void add_body(const Prim& prim, const std::string& pad, UsdSummary& summary) {
    if (!prim.body.empty()) reader_.select(prim.body);
    writer_.add("{}def Mesh \"{}\"", pad, prim.name);
    if (prim.shared >= 0) {
      writer_.add(" (\n{0}    inherits = </triangles_{1}>\n{0})\n{0}{{\n", pad, prim.shared);
    } else {
      writer_.add("\n{0}{{\n{0}    uniform token subdivisionScheme = \"none\"\n", pad);
      add_triangles(pad, reader_.triangles(options_.mesh));
    }
    const Eigen::Vector3d origin = summary.origin = reader_.origin();
    if (!origin.isZero(0))
      writer_.add(
          "{0}    double3 xformOp:translate = ({1}, {2}, {3})\n{0}    uniform token[] xformOpOrder = "
          "[\"xformOp:translate\"]\n",
          pad, origin.x(), origin.y(), origin.z());
    const RowMatrix codes = options_.frame_rate * reader_.read("/time");
    summary.dataset = reader_.open_positions(options_.mesh);
    summary.points += reader_.points();
    summary.samples = reader_.samples();
    add_samples(pad, codes);
    writer_.add("{}}}\n", pad);
  }

 private:
  void add_triangles(const std::string& pad, const TriangleArray& triangles) {
    writer_.add("{}    int[] faceVertexCounts = [", pad);
    for (Eigen::Index k = 0; k < triangles.rows(); ++k) writer_.add("{}3", k == 0 ? "" : ", ");
    writer_.add("]\n{}    int[] faceVertexIndices = [", pad);
    for (Eigen::Index k = 0; k < triangles.rows(); ++k)
      writer_.add("{}{}, {}, {}", k == 0 ? "" : ", ", triangles(k, 0), triangles(k, 1), triangles(k, 2));
    writer_.add("]\n");
  }

  void add_points(const std::string& pad, const Points& points, double code) {
    writer_.add("{}        {:.9g}: [", pad, code);
    for (Eigen::Index k = 0; k < points.rows(); ++k)
      writer_.add("{}({}, {}, {})", k == 0 ? "" : ", ", points(k, 0), points(k, 1), points(k, 2));
    writer_.add("],\n");
  }

  void add_samples(const std::string& pad, const RowMatrix& codes) {
    writer_.add("{}    point3f[] points.timeSamples = {{\n", pad);
    std::vector<float> frame;
    std::vector<Eigen::AlignedBox3f> boxes;
    for (std::int64_t sample = 0; sample < reader_.samples(); ++sample) {
      reader_.read_next(frame);
      const Points points(frame.data(), reader_.points(), 3);
      boxes.emplace_back(points.colwise().minCoeff().transpose(), points.colwise().maxCoeff().transpose());
      add_points(pad, points, codes(sample));
      writer_.flush();
      progress_.advance();
    }
    reader_.check_sum();
    writer_.add("{0}    }}\n{0}    float3[] extent.timeSamples = {{\n", pad);
    for (std::int64_t sample = 0; sample < reader_.samples(); ++sample) {
      const auto& low = boxes[static_cast<std::size_t>(sample)].min();
      const auto& high = boxes[static_cast<std::size_t>(sample)].max();
      writer_.add("{}        {:.9g}: [({}, {}, {}), ({}, {}, {})],\n", pad, codes(sample), low.x(), low.y(), low.z(),
                  high.x(), high.y(), high.z());
    }
    writer_.add("{}    }}\n", pad);
  }

  TrajectoryReader& reader_;
  const UsdOptions& options_;
  TextWriter& writer_;
  Progress& progress_;
};

/// The name of a body as an identifier, other than those in `taken`.
std::string identifier(const std::string& body, std::set<std::string>& taken) {
  std::string name = body;
  std::ranges::replace_if(
      name, [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  if (name.empty() || std::isdigit(static_cast<unsigned char>(name.front())) != 0) name.insert(0, 1, '_');
  while (!taken.insert(name).second) name += '_';
  return name;
}

/// The prims of a trajectory of several bodies, and the triangles that they share.
std::vector<Prim> prims_of(TrajectoryReader& reader, bool mesh, std::vector<TriangleArray>& shared) {
  std::vector<Prim> prims;
  std::set<std::string> taken;
  for (const std::string& body : reader.bodies()) {
    reader.select(body);
    TriangleArray triangles = reader.triangles(mesh);
    const auto same = std::ranges::find_if(
        shared, [&](const TriangleArray& other) { return other.rows() == triangles.rows() && other == triangles; });
    prims.push_back({identifier(body, taken), body, static_cast<int>(same - shared.begin())});
    if (same == shared.end()) shared.push_back(std::move(triangles));
  }
  return prims;
}

}  // namespace

UsdSummary write_usd(const std::filesystem::path& trajectory, const std::filesystem::path& target,
                     const UsdOptions& options) {
  TrajectoryReader reader(trajectory);
  if (options.body) reader.select(*options.body);
  std::vector<TriangleArray> shared;
  std::vector<Prim> prims;
  if (!options.body) prims = prims_of(reader, options.mesh, shared);
  const bool several = !prims.empty();
  if (!several) prims.push_back({"body", options.body.value_or(""), -1});
  if (several) reader.select(prims.front().body);
  const RowMatrix codes = options.frame_rate * reader.read("/time");

  AtomicFile output(target);
  TextWriter writer(output);
  Progress progress("frames", codes.size() * std::ssize(prims));
  UsdWriter bodies(reader, options, writer, progress);
  UsdSummary summary;
  summary.bodies = std::ssize(prims);
  writer.add("#usda 1.0\n(\n    defaultPrim = \"{}\"\n    metersPerUnit = 1\n    upAxis = \"{}\"\n",
             several ? "bodies" : "body", options.up == UpAxis::kY ? "Y" : "Z");
  writer.add("    startTimeCode = {:.9g}\n    endTimeCode = {:.9g}\n    timeCodesPerSecond = {:.9g}\n)\n\n", codes(0),
             codes(codes.size() - 1), options.frame_rate);
  for (std::size_t i = 0; i < shared.size(); ++i) bodies.add_class(static_cast<int>(i), shared[i]);
  if (several) writer.add("def Xform \"bodies\"\n{{\n");
  for (const Prim& prim : prims) bodies.add_body(prim, several ? "    " : "", summary);
  if (several) writer.add("}}\n");
  writer.finish();
  summary.bytes = static_cast<std::int64_t>(std::filesystem::file_size(output.temporary()));
  output.commit();
  return summary;
}

}  // namespace exmat::runtime
