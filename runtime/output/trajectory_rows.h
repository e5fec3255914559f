#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/core/arrays.h"
#include "common/hdf5/hdf5_file.h"

namespace exmat::runtime {

/// An example force whose weights a trajectory shows.
struct WeightInfo {
  std::size_t force = 0;   ///< in the state's examples
  std::string region;      ///< empty: the whole body
  std::int64_t count = 0;  ///< K
};

/// Writes the groups of one body below `parent`: "" for the root, or "/bodies/NAME". Bound v: with the render mesh; a:
/// with attachments.
void write_body_groups(Hdf5File& file, const std::string& parent, const SymbolSizes& sizes,
                       const std::vector<WeightInfo>& forces);

/// Open datasets of one body's frames, in the order of the format.
class TrajectoryRows {
 public:
  /// Below `group`, as write_body_groups(), which comes first. Bound r: with reduced coordinates; v: with the render
  /// mesh; a: with attachments; b: with bones.
  TrajectoryRows(Hdf5File& file, const std::string& group, const SymbolSizes& sizes,
                 const std::vector<WeightInfo>& forces);
  TrajectoryRows(const TrajectoryRows&) = delete;
  TrajectoryRows& operator=(const TrajectoryRows&) = delete;

  /// Appends the positions [n x 3] of a time, measured from `origin`, to one of the datasets in single precision.
  /// Throws WorkError where they are beyond it.
  void append_drawn(double at, const VertexArray& drawn, const Eigen::Vector3d& origin, RowWriter& dataset) const;

  /// To be called after the last frame. Throws WorkError.
  void finish();

 private:
  RowWriter rows(const char* path) const;
  std::optional<RowWriter> rows_if(const char* symbol, const char* path) const;

  Hdf5File& file_;
  const std::string& group_;
  const SymbolSizes& sizes_;

 public:
  RowWriter time = rows("/time");
  RowWriter positions = rows("/vertices");
  std::optional<RowWriter> reduced = rows_if("r", "/reduced");
  std::optional<RowWriter> reduced_velocity = rows_if("r", "/reduced_velocity");
  RowWriter body_position = rows("/body/position");
  RowWriter body_orientation = rows("/body/orientation");
  RowWriter linear_momentum = rows("/linear_momentum");
  RowWriter angular_momentum = rows("/angular_momentum");
  RowWriter kinetic = rows("/energy/kinetic");
  RowWriter elastic = rows("/energy/elastic");
  RowWriter potential = rows("/energy/potential");
  RowWriter step_time = rows("/step_time");
  std::optional<RowWriter> attachment_forces = rows_if("a", "/attachments/force");
  std::optional<RowWriter> attachment_torques = rows_if("a", "/attachments/torque");
  std::optional<RowWriter> bones = rows_if("b", "/bones");
  std::vector<RowWriter> weights;   ///< in the order of `forces`
  std::optional<RowWriter> render;  ///< vertices of the render mesh
};

/// All numbers of a vector, or of a matrix by columns.
template <typename Numbers>
std::span<const double> row_of(const Eigen::PlainObjectBase<Numbers>& numbers) {
  return {numbers.data(), static_cast<std::size_t>(numbers.size())};
}

}  // namespace exmat::runtime
