#include "common/hdf5/xdmf.h"

#include <fmt/format.h>

#include "common/core/markup.h"

namespace exmat {
namespace {

/// One grid of the temporal collection: a hyperslab of the vertices on the shared cells.
std::string xdmf_frame(const std::string& h5, const XdmfCells& drawn, std::size_t frames, std::size_t frame,
                       double time) {
  return fmt::format(
      "      <Grid Name=\"frame {0}\">\n"
      "        <Time Value=\"{1}\"/>\n"
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
      frame, time, drawn.cells, h5, drawn.vertices, frames, drawn.cell, drawn.corners, drawn.cells_path,
      drawn.vertices_path);
}

}  // namespace

std::string xdmf_text(const std::filesystem::path& trajectory, const std::string& name, const XdmfCells& drawn,
                      const std::vector<double>& times) {
  const std::string h5 = escaped(trajectory.filename().string());
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n"
      "    <Grid Name=\"{}\" GridType=\"Collection\" CollectionType=\"Temporal\">\n",
      escaped(name));
  for (std::size_t frame = 0; frame < times.size(); ++frame)
    text += xdmf_frame(h5, drawn, times.size(), frame, times[frame]);
  return text + "    </Grid>\n  </Domain>\n</Xdmf>\n";
}

}  // namespace exmat
