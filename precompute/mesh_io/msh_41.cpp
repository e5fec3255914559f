#include <fmt/format.h>

#include "precompute/mesh_io/msh_contents.h"

namespace exmat::precompute {
namespace {

constexpr int kVolumeDimension = 3;
// Each tet of a volume is noted in each of its groups.
constexpr std::uint64_t kMostGroups = 100;

struct Block {
  std::int32_t dimension = 0, entity = 0, kind = 0;  // kind: parametric or not, or the element type
  std::uint64_t count = 0;
};

std::int32_t read_dimension(MshCursor& cursor) {
  const std::int32_t dimension = cursor.read_int("the dimension of an entity");
  if (dimension < 0 || dimension > kVolumeDimension)
    cursor.fail("the dimension of an entity, 0 to 3", fmt::format("{}", dimension));
  return dimension;
}

void check_total(const MshCursor& cursor, std::uint64_t done, const Block& block, std::uint64_t total,
                 std::string_view what) {
  if (block.count > total - done)
    cursor.fail(fmt::format("at most {} more of the {} {} declared", total - done, total, what),
                fmt::format("{}", block.count));
}

void check_complete(const MshCursor& cursor, std::uint64_t done, std::uint64_t total, std::string_view what) {
  if (done != total) cursor.fail(fmt::format("{} {} in all blocks, as declared", total, what), fmt::format("{}", done));
}

struct Header {
  std::uint64_t blocks = 0, total = 0;
};

Header read_header(MshCursor& cursor, std::string_view what, std::size_t min_text_bytes, std::size_t min_binary_bytes) {
  Header header;
  cursor.begin_record();
  header.blocks = cursor.read_count("blocks", 8, 20);
  header.total = cursor.read_count(what, min_text_bytes, min_binary_bytes);
  cursor.skip_sizes(2, "the smallest and the largest tag");
  return header;
}

std::vector<std::int32_t> read_physical_tags(MshCursor& cursor) {
  std::vector<std::int32_t> tags;
  const std::uint64_t count = cursor.read_count("physical tags", 2, 4);
  if (count > kMostGroups)
    cursor.fail(fmt::format("at most {} physical tags of an entity", kMostGroups), fmt::format("{}", count));
  for (std::uint64_t i = 0; i < count; ++i) tags.push_back(read_physical_tag(cursor));
  return tags;
}

void read_entity(MshCursor& cursor, int dimension, MshContents& contents) {
  cursor.begin_record();
  const std::int32_t tag = cursor.read_int("the tag of an entity");
  const int bounds = dimension == 0 ? 3 : 6;
  for (int i = 0; i < bounds; ++i) cursor.read_real("a bound of an entity");
  const auto physical = read_physical_tags(cursor);
  if (dimension == kVolumeDimension) contents.volume_tags[tag] = physical;
  if (dimension > 0) cursor.skip_ints(cursor.read_count("bounding entities", 2, 4), "the tag of a bounding entity");
}

void read_node_block(MshCursor& cursor, const Block& block, MshContents& contents) {
  for (std::uint64_t n = 0; n < block.count; ++n) {
    cursor.begin_record();
    contents.nodes.add(cursor, cursor.read_size("a node tag"));
  }
  for (std::uint64_t n = 0; n < block.count; ++n) {
    cursor.begin_record();
    const double x = cursor.read_real("an x coordinate");
    const double y = cursor.read_real("a y coordinate");
    contents.nodes.add_coordinates({x, y, cursor.read_real("a z coordinate")});
    const int parameters = block.kind != 0 ? block.dimension : 0;
    for (int i = 0; i < parameters; ++i) cursor.read_real("a parametric coordinate");
  }
}

void read_tets(MshCursor& cursor, const Block& block, MshContents& contents) {
  const auto groups = contents.volume_tags.find(block.entity);
  for (std::uint64_t e = 0; e < block.count; ++e) {
    cursor.begin_record();
    cursor.read_size("an element tag");
    if (groups != contents.volume_tags.end())
      for (const std::int32_t group : groups->second)
        contents.volume_groups[group].push_back(static_cast<std::int32_t>(contents.tets.size()));
    auto& corners = contents.tets.emplace_back();
    for (auto& corner : corners) corner = contents.nodes.find(cursor, cursor.read_size("a node tag"));
  }
}

void skip_elements(MshCursor& cursor, const Block& block, int node_count, MshContents& contents) {
  for (std::uint64_t e = 0; e < block.count; ++e) {
    cursor.begin_record();
    cursor.read_size("an element tag");
    cursor.skip_sizes(static_cast<std::uint64_t>(node_count), "a node tag");
  }
  contents.skipped[block.kind] += block.count;
}

}  // namespace

void read_entities_41(MshCursor& cursor, MshContents& contents) {
  if (!contents.tets.empty()) cursor.fail("$Entities before $Elements", "it after them");
  cursor.begin_record();
  std::array<std::uint64_t, 4> counts{};
  for (auto& count : counts) count = cursor.read_count("entities", 10, 36);
  for (int dimension = 0; dimension <= kVolumeDimension; ++dimension)
    for (std::uint64_t i = 0; i < counts[static_cast<std::size_t>(dimension)]; ++i)
      read_entity(cursor, dimension, contents);
}

void read_nodes_41(MshCursor& cursor, MshContents& contents) {
  const Header header = read_header(cursor, "nodes", 8, 32);
  std::uint64_t done = 0;
  for (std::uint64_t b = 0; b < header.blocks; ++b) {
    cursor.begin_record();
    Block block;
    block.dimension = read_dimension(cursor);
    block.entity = cursor.read_int("the tag of an entity");
    block.kind = cursor.read_int("0 or 1 (parametric)");
    if (block.kind != 0 && block.kind != 1) cursor.fail("0 or 1 (parametric)", fmt::format("{}", block.kind));
    block.count = cursor.read_size("the number of nodes of a block");
    check_total(cursor, done, block, header.total, "nodes");
    read_node_block(cursor, block, contents);
    done += block.count;
  }
  check_complete(cursor, done, header.total, "nodes");
  contents.nodes.index_tags(cursor);
}

void read_elements_41(MshCursor& cursor, MshContents& contents) {
  const Header header = read_header(cursor, "elements", 4, 16);
  std::uint64_t done = 0;
  for (std::uint64_t b = 0; b < header.blocks; ++b) {
    cursor.begin_record();
    Block block;
    block.dimension = read_dimension(cursor);
    block.entity = cursor.read_int("the tag of an entity");
    block.kind = cursor.read_int("an element type");
    const int node_count = msh_node_count(cursor, block.kind);
    block.count = cursor.read_size("the number of elements of a block");
    check_total(cursor, done, block, header.total, "elements");
    if (block.kind == kMshTetrahedron)
      read_tets(cursor, block, contents);
    else
      skip_elements(cursor, block, node_count, contents);
    done += block.count;
  }
  check_complete(cursor, done, header.total, "elements");
}

}  // namespace exmat::precompute
