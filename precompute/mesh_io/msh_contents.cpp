#include "precompute/mesh_io/msh_contents.h"

#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>
#include <limits>

#include "common/surface_io/mesh_arrays.h"

namespace exmat::precompute {
namespace {

// Nodes of the element types 1 to 31 of Gmsh's manual, "MSH file format"; 0 where the manual has no such type.
constexpr std::array<int, 32> kNodeCounts{0, 2,  3,  4,  4, 8,  6,  5,  3,  6,  9, 10, 27, 18, 14, 1,
                                          8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5,  6,  20, 35, 56};

bool is_high_order_tetrahedron(std::int32_t type) { return type == 11 || (type >= 29 && type <= 31); }

}  // namespace

int msh_node_count(const MshCursor& cursor, std::int32_t element_type) {
  if (is_high_order_tetrahedron(element_type))
    cursor.fail("tetrahedra of first order (element type 4)",
                fmt::format("tetrahedra of higher order (element type {})", element_type),
                "make the mesh with 'gmsh -3 -order 1'");
  const bool is_known = element_type > 0 && element_type < static_cast<std::int32_t>(kNodeCounts.size()) &&
                        kNodeCounts[static_cast<std::size_t>(element_type)] > 0;
  if (!is_known) cursor.fail("a known element type (1 to 31)", fmt::format("{}", element_type));
  return kNodeCounts[static_cast<std::size_t>(element_type)];
}

void MshNodes::add(const MshCursor& cursor, std::uint64_t tag) {
  if (tag == 0) cursor.fail("a node tag above 0", "0");
  tags_.push_back({tag, cursor.last_offset(), static_cast<std::int32_t>(tags_.size())});
}

void MshNodes::index_tags(const MshCursor& cursor) {
  std::stable_sort(tags_.begin(), tags_.end(), [](const Tag& a, const Tag& b) { return a.tag < b.tag; });
  const auto twin =
      std::adjacent_find(tags_.begin(), tags_.end(), [](const Tag& a, const Tag& b) { return a.tag == b.tag; });
  if (twin == tags_.end()) return;
  cursor.fail_at((twin + 1)->offset, "a tag for each node", fmt::format("node {} a second time", twin->tag));
}

std::int32_t MshNodes::find(const MshCursor& cursor, std::uint64_t tag) const {
  const auto fits = [](const Tag& entry, std::uint64_t value) { return entry.tag < value; };
  const bool is_plain = tag >= 1 && tag <= tags_.size() && tags_[tag - 1].tag == tag;
  const auto entry = is_plain ? tags_.begin() + static_cast<std::ptrdiff_t>(tag - 1)
                              : std::lower_bound(tags_.begin(), tags_.end(), tag, fits);
  if (entry == tags_.end() || entry->tag != tag)
    cursor.fail(fmt::format("the tag of one of the {} nodes", tags_.size()), fmt::format("{}", tag));
  return entry->index;
}

VertexArray MshNodes::positions() const { return vertex_array(positions_); }

std::int32_t read_physical_tag(MshCursor& cursor) {
  const std::int32_t tag = cursor.read_int("a physical tag");
  if (tag == std::numeric_limits<std::int32_t>::min()) cursor.fail("a physical tag", fmt::format("{}", tag));
  return std::abs(tag);
}

}  // namespace exmat::precompute
