#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/hdf5/schema.h"

namespace exmat {

/// The cells that an .xdmf shows, and the datasets of its HDF5 file that hold them and the frames of their vertices.
struct XdmfCells {
  std::string_view cell, cells_path, vertices_path;  ///< such as "Tetrahedron", "/tets", "/vertices"
  std::int64_t corners = 0, cells = 0, vertices = 0;
};

/// One of the bodies that an .xdmf shows.
struct XdmfPart {
  std::string name;
  XdmfCells drawn;
};

/// Claims a trajectory and the .xdmf files beside it as outputs of the command; `role` as for claim_output(). Throws
/// InputError, also where the trajectory has the extension .xdmf.
void claim_trajectory(const std::filesystem::path& trajectory, const std::string& role);

/// Throws InputError where one of these files is there and no earlier output of its kind: `kind`, as "a trajectory", of
/// the format `schema` (require_format()).
void require_trajectory_kind(const std::filesystem::path& trajectory, const std::string& role,
                             const FileSchema& schema);

/// Text of the .xdmf beside `trajectory`, in its folder: one grid for each time [s], whose vertices are float32
/// [times x vertices x 3]; of several parts a collection of such grids.
std::string xdmf_text(const std::filesystem::path& trajectory, const std::vector<XdmfPart>& parts,
                      const std::vector<double>& times);

}  // namespace exmat
