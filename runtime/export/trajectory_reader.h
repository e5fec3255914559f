#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/core/arrays.h"
#include "common/hdf5/hdf5_file.h"
#include "common/hdf5/schema.h"

namespace exmat::runtime {

/// A trajectory, read and checked: format, sizes, values, checksums. Each call throws InputError that names the file
/// and the dataset. All that any format draws of a body is checked once, whatever is read of it later.
class TrajectoryReader {
 public:
  explicit TrajectoryReader(const std::filesystem::path& trajectory);

  /// Names of the bodies of a scene of several, in ascending order; none of a scene of one body.
  std::vector<std::string> bodies() const;
  /// Selects one body of several, which is read from here on.
  void select(const std::string& body);

  const std::string& name() const { return file_.name(); }
  bool has(const std::string& dataset) const { return file_.has_dataset(group_ + dataset); }
  /// An attribute of the run, or of the body; empty where the trajectory is older than it.
  std::string text(const std::string& attribute_name) const;
  /// Likewise a whole number; 0 where the trajectory is older than it.
  std::int64_t integer(const std::string& attribute_name) const;
  /// Point that positions are measured from [m].
  Eigen::Vector3d origin() const;
  /// All rows of a dataset of numbers, F x the numbers of each.
  RowMatrix read(const std::string& dataset);
  /// Triangles of the render mesh, or of the boundary of the tets.
  TriangleArray triangles(bool mesh);

  /// The dataset below the body's group that positions are read from: of the render mesh where there is one, of the
  /// tets with `mesh`.
  const std::string& open_positions(bool mesh);
  std::int64_t samples() const { return positions_.front().sizes()[0]; }
  std::int64_t points() const { return positions_.front().sizes()[1]; }
  /// The next frame, xyz of each point from the origin [m].
  void read_next(std::vector<float>& frame);
  /// To be called after the last frame.
  void check_sum() const { check_sum(positions_.front(), crc_); }

  [[noreturn]] void refuse(const std::string& place, const std::string& expected, const std::string& found,
                           const std::string& advice = "") const;

 private:
  /// The attribute of the run or of the body; nothing where it has none. Refuses another type.
  template <typename Value>
  std::optional<Value> attribute(const std::string& name, const char* expected) const;
  Hdf5Dataset open_dataset(const std::string& path);
  /// Checks all that any format draws of the selected body: finite numbers, times, checksums.
  void check_motion();
  void check_sum(const Hdf5Dataset& dataset, std::uint32_t crc) const;
  template <typename Array>
  void read_all(const std::string& path, Array& array);

  Hdf5File file_;
  std::set<std::string> checked_;  ///< bodies
  std::string group_;              ///< group of the body; empty: the root
  SymbolSizes sizes_;
  std::vector<Hdf5Dataset> positions_;  ///< the open one
  std::string positions_path_;          ///< its path below the group
  std::int64_t next_ = 0;               ///< frame
  std::uint32_t crc_ = 0;               ///< checksum of the frames before it
};

}  // namespace exmat::runtime
