#include "runtime/export/trajectory_reader.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <limits>
#include <numeric>
#include <span>
#include <string_view>

#include "common/bundle/file_schemas.h"
#include "common/core/error.h"
#include "common/hdf5/value_checks.h"
#include "common/mesh/geometry.h"

namespace exmat::runtime {
namespace {

constexpr double kLatest = 1e30;  // [s]: single precision, as glTF and point caches have it, holds times and time codes

Hdf5File open(const std::filesystem::path& trajectory) {
  Hdf5File file = Hdf5File::open(trajectory);
  for (const AttributeSchema& schema : trajectory_schema().attributes) {
    if (schema.name != "format" && schema.name != "format_version") continue;
    const AttributeValue value = file.read_attribute("/", schema.name);
    if (const auto fault = check_value(schema, value, {}))
      throw InputError({file.name(), "/@" + schema.name, fault->expected, fault->found, "is this a trajectory?"});
    const auto* version = std::get_if<std::int64_t>(&value);
    if (version != nullptr && *version > trajectory_schema().format_version)
      throw InputError({file.name(), "/@" + schema.name, fmt::format("at most {}", trajectory_schema().format_version),
                        fmt::format("{}", *version), "a newer version of exmat wrote this trajectory"});
  }
  return file;
}

template <typename Array>
void resize(Array& array, const std::vector<std::int64_t>& sizes) {
  if constexpr (Array::ColsAtCompileTime == Eigen::Dynamic)
    array.resize(sizes.front(), std::accumulate(sizes.begin() + 1, sizes.end(), std::int64_t{1}, std::multiplies()));
  else
    array.resize(sizes.front(), Array::ColsAtCompileTime);
}

}  // namespace

TrajectoryReader::TrajectoryReader(const std::filesystem::path& trajectory) : file_(open(trajectory)) {
  if (bodies().empty()) check_motion();
}

std::vector<std::string> TrajectoryReader::bodies() const {
  return file_.has_group("/bodies") ? file_.list("/bodies") : std::vector<std::string>{};
}

void TrajectoryReader::select(const std::string& body) {
  const std::vector<std::string> names = bodies();
  if (std::ranges::find(names, body) == names.end()) {
    constexpr std::size_t kShown = 20;
    const auto shown = std::span(names).first(std::min(names.size(), kShown));
    refuse("/bodies", fmt::format("a body \"{}\"", body),
           names.empty() ? "a trajectory of one body" : fmt::format("{} bodies", names.size()),
           names.empty() ? "leave out --body"
                         : fmt::format("it has {}{}", fmt::join(shown, ", "), names.size() > kShown ? ", ..." : ""));
  }
  group_ = fill_name("/bodies/{body}", kBodyPlaceholder, body);
  sizes_ = {};
  positions_.clear();
  if (checked_.insert(body).second) check_motion();
}

void TrajectoryReader::check_motion() {
  for (const char* path : {"/time", "/reduced", "/body/position", "/body/orientation", "/bones"}) {
    if (!has(path)) continue;
    const RowMatrix rows = read(path);
    if (path != std::string_view("/time") || rows(rows.size() - 1) <= kLatest) continue;
    refuse(group_ + path, fmt::format("times of at most {:g} s", kLatest), fmt::format("{:g} s", rows(rows.size() - 1)),
           "run the scene again");
  }
  origin();
  for (const bool mesh : {true, false}) {
    if (!has(mesh ? "/vertices" : "/render/vertices")) continue;
    open_positions(mesh);
    std::vector<float> frame;
    for (std::int64_t sample = 0; sample < samples(); ++sample) read_next(frame);
    check_sum();
  }
  positions_.clear();
}

template <typename Value>
std::optional<Value> TrajectoryReader::attribute(const std::string& name, const char* expected) const {
  const std::string object = group_.empty() ? "/" : group_;
  if (!file_.has_attribute(object, name)) return std::nullopt;
  AttributeValue value = file_.read_attribute(object, name);
  auto* const held = std::get_if<Value>(&value);
  if (held == nullptr) refuse(group_ + "/@" + name, expected, "another type");
  return std::move(*held);
}

std::string TrajectoryReader::text(const std::string& attribute_name) const {
  return attribute<std::string>(attribute_name, "a string").value_or("");
}

std::int64_t TrajectoryReader::integer(const std::string& attribute_name) const {
  return attribute<std::int64_t>(attribute_name, "a whole number").value_or(0);
}

Eigen::Vector3d TrajectoryReader::origin() const {
  const auto numbers = attribute<std::vector<double>>("origin", "three finite numbers");
  if (!numbers) return Eigen::Vector3d::Zero();  // of a format before 6
  if (numbers->size() != 3 || !Eigen::Map<const Eigen::Vector3d>(numbers->data()).allFinite())
    refuse(group_ + "/@origin", "three finite numbers", "others");
  return Eigen::Vector3d(numbers->data());
}

Hdf5Dataset TrajectoryReader::open_dataset(const std::string& path) {
  const DatasetSchema& schema = trajectory_schema().dataset(path);
  Hdf5Dataset dataset = file_.open_dataset(group_ + path);
  const auto text = [&] { return fmt::format("{} of {}", dataset.type_name(), fmt::join(dataset.sizes(), " x ")); };
  if (dataset.type() != schema.type)
    refuse(group_ + path, fmt::format("{} of {}", name_of(schema.type), schema.dims_text), text());
  if (const auto expected = sizes_.bind(schema.dims, dataset.sizes(), group_ + path))
    refuse(group_ + path, *expected, text());
  if (dataset.element_count() == 0) refuse(group_ + path, "some elements", text());
  dataset.check_storage();
  return dataset;
}

void TrajectoryReader::check_sum(const Hdf5Dataset& dataset, std::uint32_t crc) const {
  const AttributeValue stored = file_.read_attribute(dataset.path(), "crc32");
  const auto* sum = std::get_if<std::int64_t>(&stored);
  if (sum == nullptr || *sum != crc)
    refuse(dataset.path(), sum == nullptr ? "a checksum" : fmt::format("checksum {:08x}", *sum),
           fmt::format("{:08x}", crc), "the data are damaged or were changed after the trajectory was written");
}

template <typename Array>
void TrajectoryReader::read_all(const std::string& path, Array& array) {
  const Hdf5Dataset dataset = open_dataset(path);
  const DatasetSchema& schema = trajectory_schema().dataset(path);
  resize(array, dataset.sizes());
  dataset.read(array.data(), schema.type);
  if (const auto fault = check_values(schema, dataset.sizes(), array.data(), sizes_))
    refuse(group_ + path, fault->expected, fault->found);
  check_sum(dataset, crc32_of(std::as_bytes(std::span(array.data(), static_cast<std::size_t>(array.size())))));
}

RowMatrix TrajectoryReader::read(const std::string& dataset) {
  RowMatrix rows;
  read_all(dataset, rows);
  return rows;
}

TriangleArray TrajectoryReader::triangles(bool mesh) {
  TriangleArray triangles;
  if (!mesh && has("/render/triangles")) {
    open_dataset("/render/vertices");  // that the triangles are of
    read_all("/render/triangles", triangles);
    return triangles;
  }
  TetArray tets;
  open_dataset("/vertices");
  read_all("/tets", tets);
  return surface_triangles(tets);
}

const std::string& TrajectoryReader::open_positions(bool mesh) {
  positions_.clear();
  positions_path_ = !mesh && has("/render/vertices") ? "/render/vertices" : "/vertices";
  positions_.push_back(open_dataset(positions_path_));
  for (const std::int64_t size : {samples(), points()})
    if (size > std::numeric_limits<std::int32_t>::max())
      refuse(positions_.front().path(), "as many frames and points as a 32-bit number counts", fmt::format("{}", size));
  next_ = 0;
  crc_ = 0;
  return positions_path_;
}

void TrajectoryReader::read_next(std::vector<float>& frame) {
  const Hdf5Dataset& dataset = positions_.front();
  frame.resize(static_cast<std::size_t>(3 * points()));
  dataset.read_rows(next_++, 1, frame.data(), ElementType::kFloat32);
  crc_ = crc32_of(std::as_bytes(std::span(frame)), crc_);
  const std::int64_t sizes[] = {points(), 3};
  if (const auto fault = check_values(trajectory_schema().dataset(positions_path_), sizes, frame.data(), {}))
    refuse(fmt::format("{}, frame {}", dataset.path(), next_ - 1), fault->expected, fault->found);
}

void TrajectoryReader::refuse(const std::string& place, const std::string& expected, const std::string& found,
                              const std::string& advice) const {
  throw InputError({file_.name(), place, expected, found, advice});
}

}  // namespace exmat::runtime
