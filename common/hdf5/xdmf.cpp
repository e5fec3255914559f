#include "common/hdf5/xdmf.h"

#include <array>
#include <fmt/format.h>
#include <utility>

#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/markup.h"
#include "common/hdf5/hdf5_file.h"

namespace exmat {
namespace {

constexpr std::string_view kBeginning = "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">";

/// The .xdmf files of a trajectory, and how messages name them.
std::array<std::pair<std::filesystem::path, std::string>, 2> files_beside(const std::filesystem::path& trajectory,
                                                                          const std::string& role) {
  const std::string stem = (trajectory.parent_path() / trajectory.stem()).string();
  return {{{stem + ".xdmf", "the .xdmf beside " + role},
           {stem + "_render.xdmf", "the .xdmf of the render mesh beside " + role}}};
}

/// A hyperslab of the vertices on the shared cells.
std::string xdmf_grid(const std::string& h5, const XdmfCells& drawn, std::size_t frames, std::size_t frame,
                      const std::string& name, const std::string& time) {
  return fmt::format(
      "      <Grid Name=\"{1}\">\n"
      "{10}"
      "        <Topology TopologyType=\"{6}\" NumberOfElements=\"{2}\">\n"
      "          <DataItem Dimensions=\"{2} {7}\" NumberType=\"Int\" Precision=\"4\" "
      "Format=\"HDF\">{3}:{8}</DataItem>\n"
      "        </Topology>\n"
      "        <Geometry GeometryType=\"XYZ\">\n"
      "          <DataItem ItemType=\"HyperSlab\" Dimensions=\"1 {4} 3\">\n"
      "            <DataItem Dimensions=\"3 3\" NumberType=\"Int\" Format=\"XML\">{0} 0 0 1 1 1 1 {4} 3</DataItem>\n"
      "            <DataItem Dimensions=\"{5} {4} 3\" NumberType=\"Float\" Precision=\"4\" Format=\"HDF\">{3}:{9}"
      "</DataItem>\n"
      "          </DataItem>\n"
      "        </Geometry>\n"
      "      </Grid>\n",
      frame, name, drawn.cells, h5, drawn.vertices, frames, drawn.cell, drawn.corners, drawn.cells_path,
      drawn.vertices_path, time);
}

/// One grid of the temporal collection.
std::string xdmf_frame(const std::string& h5, const XdmfPart& part, std::size_t frames, std::size_t frame,
                       double time) {
  return xdmf_grid(h5, part.drawn, frames, frame, fmt::format("frame {}", frame),
                   fmt::format("        <Time Value=\"{}\"/>\n", time));
}

}  // namespace

void claim_trajectory(const std::filesystem::path& trajectory, const std::string& role) {
  if (trajectory.extension() == ".xdmf")
    throw InputError({trajectory.string(), role, "an HDF5 file, beside which the .xdmf is written", "\".xdmf\"",
                      "give it the extension .h5"});
  claim_output(trajectory, role);
  for (const auto& [file, beside] : files_beside(trajectory, role)) claim_output(file, beside);
}

void require_trajectory_kind(const std::filesystem::path& trajectory, const std::string& role,
                             const FileSchema& schema) {
  require_format(trajectory, role, "a trajectory", schema);
  for (const auto& [file, beside] : files_beside(trajectory, role)) require_kind(file, beside, "an .xdmf", kBeginning);
}

std::string xdmf_text(const std::filesystem::path& trajectory, const std::vector<XdmfPart>& parts,
                      const std::vector<double>& times) {
  const std::string h5 = escaped(trajectory.filename().string());
  std::string text = std::string(kBeginning) + "\n  <Domain>\n";
  if (parts.size() == 1) {
    text += fmt::format("    <Grid Name=\"{}\" GridType=\"Collection\" CollectionType=\"Temporal\">\n",
                        escaped(parts.front().name));
    for (std::size_t frame = 0; frame < times.size(); ++frame)
      text += xdmf_frame(h5, parts.front(), times.size(), frame, times[frame]);
    return text + "    </Grid>\n  </Domain>\n</Xdmf>\n";
  }
  text += "    <Grid Name=\"bodies\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  for (std::size_t frame = 0; frame < times.size(); ++frame) {
    text += fmt::format(
        "      <Grid Name=\"frame {}\" GridType=\"Collection\" CollectionType=\"Spatial\">\n"
        "        <Time Value=\"{}\"/>\n",
        frame, times[frame]);
    for (const XdmfPart& part : parts) text += xdmf_grid(h5, part.drawn, times.size(), frame, escaped(part.name), "");
    text += "      </Grid>\n";
  }
  return text + "    </Grid>\n  </Domain>\n</Xdmf>\n";
}

}  // namespace exmat
