#include "runtime/output/trajectory_rows.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/bundle/file_schemas.h"
#include "common/core/error.h"

namespace exmat::runtime {

void write_body_groups(Hdf5File& file, const std::string& parent, const SymbolSizes& sizes,
                       const std::vector<WeightInfo>& forces) {
  const auto regional = [](const WeightInfo& force) { return !force.region.empty(); };
  for (const GroupSchema& group : trajectory_schema().groups) {
    if (group.group == "bodies") continue;
    if (group.group == "examples" && std::ranges::all_of(forces, regional)) continue;
    if (group.group == "regions" && std::ranges::none_of(forces, regional)) continue;
    if (group.group == "render" && sizes.find("v") == nullptr) continue;
    if (group.group == "attachments" && sizes.find("a") == nullptr) continue;
    if (is_single(group.path)) {
      write_group(file, group, parent + group.path);
      continue;
    }
    for (const WeightInfo& force : forces)
      if (regional(force)) write_group(file, group, parent + fill_name(group.path, kRegionPlaceholder, force.region));
  }
}

TrajectoryRows::TrajectoryRows(Hdf5File& file, const std::string& group, const SymbolSizes& sizes,
                               const std::vector<WeightInfo>& forces)
    : file_(file), group_(group), sizes_(sizes) {
  for (const WeightInfo& force : forces) {
    DatasetSchema schema =
        trajectory_schema().dataset(force.region.empty() ? "/examples/weights" : "/regions/{region}/weights");
    schema.path = group + fill_name(schema.path, kRegionPlaceholder, force.region);
    SymbolSizes own = sizes;
    own.set("K", force.count, "the bundle");
    weights.emplace_back(file, schema, own);
  }
  if (sizes.find("v") != nullptr) render.emplace(rows("/render/vertices"));
}

void TrajectoryRows::finish() {
  for (RowWriter* dataset : {&time, &positions, &body_position, &body_orientation, &linear_momentum, &angular_momentum,
                             &kinetic, &elastic, &potential, &step_time})
    dataset->finish();
  for (RowWriter& dataset : weights) dataset.finish();
  for (std::optional<RowWriter>* dataset :
       {&reduced, &reduced_velocity, &attachment_forces, &attachment_torques, &bones, &render})
    if (*dataset) (*dataset)->finish();
}

RowWriter TrajectoryRows::rows(const char* path) const {
  DatasetSchema schema = trajectory_schema().dataset(path);
  schema.path = group_ + schema.path;
  return {file_, schema, sizes_};
}

std::optional<RowWriter> TrajectoryRows::rows_if(const char* symbol, const char* path) const {
  if (sizes_.find(symbol) == nullptr) return std::nullopt;
  return rows(path);
}

void TrajectoryRows::append_drawn(double at, const VertexArray& drawn, const Eigen::Vector3d& origin,
                                  RowWriter& dataset) const {
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> row =
      (drawn.rowwise() - origin.transpose()).cast<float>();
  if (!row.allFinite())
    throw WorkError(fmt::format("{}: a position at {:g} s is beyond single precision, {:.3g} m", file_.name(), at,
                                drawn.cwiseAbs().maxCoeff()));
  dataset.append(std::span<const float>(row.data(), static_cast<std::size_t>(row.size())));
}

}  // namespace exmat::runtime
