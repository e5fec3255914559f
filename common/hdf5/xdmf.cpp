#include "common/hdf5/xdmf.h"

#include <fmt/format.h>

#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/markup.h"

namespace exmat {
namespace {

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
  const std::filesystem::path beside = trajectory.parent_path() / trajectory.stem();
  claim_output(beside.string() + ".xdmf", "the .xdmf beside " + role);
  claim_output(beside.string() + "_render.xdmf", "the .xdmf of the render mesh beside " + role);
}

std::string xdmf_text(const std::filesystem::path& trajectory, const std::vector<XdmfPart>& parts,
                      const std::vector<double>& times) {
  const std::string h5 = escaped(trajectory.filename().string());
  std::string text = "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n";
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
