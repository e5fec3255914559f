#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "precompute/mesh_io/mesh_file.h"
#include "precompute/mesh_io/msh_cursor.h"

namespace exmat::precompute {

/// Nodes per element of Gmsh's element type. Throws InputError at the cursor's last value for an unknown type and for
/// tetrahedra of higher order.
int msh_node_count(const MshCursor& cursor, std::int32_t element_type);

inline constexpr std::int32_t kMshTetrahedron = 4;

/// The nodes of a .msh file in its order; tags may be sparse and in any order.
class MshNodes {
 public:
  void add(const MshCursor& cursor, std::uint64_t tag);
  void add_coordinates(const std::array<double, 3>& position) { positions_.push_back(position); }
  bool empty() const { return tags_.empty(); }

  /// To be called after the last add: throws InputError where a tag is used twice.
  void index_tags(const MshCursor& cursor);
  /// Index of the node with that tag; throws InputError at the cursor's last value where there is none.
  std::int32_t find(const MshCursor& cursor, std::uint64_t tag) const;

  VertexArray positions() const;

 private:
  struct Tag {
    std::uint64_t tag;
    std::size_t offset;  // in the file, for the message
    std::int32_t index;
  };
  std::vector<Tag> tags_;  // sorted by index_tags
  std::vector<std::array<double, 3>> positions_;
};

/// Contents of a .msh file of either version.
struct MshContents {
  MshNodes nodes;
  std::vector<std::array<std::int32_t, 4>> tets;
  std::map<std::int32_t, std::string> volume_names;                 ///< physical volumes' names by their tags
  std::map<std::int32_t, std::vector<std::int32_t>> volume_groups;  ///< tets of each physical volume
  std::map<std::int32_t, std::vector<std::int32_t>> volume_tags;    ///< physical tags of each volume (4.1)
  std::map<std::int32_t, std::size_t> skipped;                      ///< numbers of other elements by their types
};

/// The tag of a physical group, which a minus marks as turned round; 0 for none.
std::int32_t read_physical_tag(MshCursor& cursor);

/// The sections of version 2.2, from after "$NAME" to before "$EndNAME".
void read_nodes_22(MshCursor& cursor, MshContents& contents);
void read_elements_22(MshCursor& cursor, MshContents& contents);

/// The sections of version 4.1.
void read_entities_41(MshCursor& cursor, MshContents& contents);
void read_nodes_41(MshCursor& cursor, MshContents& contents);
void read_elements_41(MshCursor& cursor, MshContents& contents);

}  // namespace exmat::precompute
