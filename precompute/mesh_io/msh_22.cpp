#include <algorithm>
#include <fmt/format.h>
#include <set>
#include <tuple>

#include "precompute/mesh_io/msh_contents.h"

namespace exmat::precompute {
namespace {

struct ElementTags {
  std::int32_t physical = 0, elementary = 0;
};

struct TetRecord {
  std::array<std::int32_t, 4> corners;
  ElementTags tags;
};

// Tags: the physical group, the elementary entity, then (in partitioned meshes) the partitions.
ElementTags read_tags(MshCursor& cursor, std::int32_t tag_count) {
  ElementTags tags;
  if (tag_count > 0) tags.physical = read_physical_tag(cursor);
  if (tag_count > 1) tags.elementary = cursor.read_int("an elementary tag");
  if (tag_count > 2) cursor.skip_ints(static_cast<std::uint64_t>(tag_count - 2), "a tag");
  return tags;
}

std::int32_t read_tag_count(MshCursor& cursor) {
  const std::int32_t count = cursor.read_int("the number of tags");
  if (count < 0) cursor.fail("the number of tags, at least 0", fmt::format("{}", count));
  return count;
}

void read_element_body(MshCursor& cursor, std::int32_t type, int node_count, std::int32_t tag_count,
                       MshContents& contents, std::vector<TetRecord>& records) {
  TetRecord record;
  record.tags = read_tags(cursor, tag_count);
  if (type != kMshTetrahedron) {
    cursor.skip_ints(static_cast<std::uint64_t>(node_count), "a node tag");
    ++contents.skipped[type];
    return;
  }
  for (auto& corner : record.corners) {
    const std::int32_t tag = cursor.read_int("a node tag");
    if (tag < 1) cursor.fail("a node tag above 0", fmt::format("{}", tag));
    corner = contents.nodes.find(cursor, static_cast<std::uint64_t>(tag));
  }
  records.push_back(record);
}

void read_text_elements(MshCursor& cursor, std::uint64_t count, MshContents& contents,
                        std::vector<TetRecord>& records) {
  for (std::uint64_t e = 0; e < count; ++e) {
    cursor.begin_record();
    cursor.read_int("an element number");
    const std::int32_t type = cursor.read_int("an element type");
    const int node_count = msh_node_count(cursor, type);
    read_element_body(cursor, type, node_count, read_tag_count(cursor), contents, records);
  }
}

void read_binary_elements(MshCursor& cursor, std::uint64_t count, MshContents& contents,
                          std::vector<TetRecord>& records) {
  for (std::uint64_t done = 0; done < count;) {
    const std::int32_t type = cursor.read_int("an element type");
    const int node_count = msh_node_count(cursor, type);
    const std::int32_t block_size = cursor.read_int("the number of elements of a block");
    if (block_size < 1 || static_cast<std::uint64_t>(block_size) > count - done)
      cursor.fail(fmt::format("a block of 1 to {} elements", count - done), fmt::format("{}", block_size));
    const std::int32_t tag_count = read_tag_count(cursor);
    for (std::int32_t e = 0; e < block_size; ++e) {
      cursor.read_int("an element number");
      read_element_body(cursor, type, node_count, tag_count, contents, records);
    }
    done += static_cast<std::uint64_t>(block_size);
  }
}

// Version 2.2 repeats an element for each physical group it is in: for each record, the first one of the same tet.
std::vector<std::size_t> first_records(const std::vector<TetRecord>& records) {
  std::vector<std::size_t> order(records.size()), first(records.size());
  for (std::size_t i = 0; i < order.size(); ++i) first[i] = order[i] = i;
  const auto key = [&](std::size_t i) { return std::tie(records[i].corners, records[i].tags.elementary); };
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    std::set<std::int32_t> groups;
    for (; end < order.size() && key(order[end]) == key(order[begin]); ++end) {
      // The same tet twice in one group is a fault of the mesh, which stays for check_mesh to name.
      const bool is_new = groups.insert(records[order[end]].tags.physical).second;
      if (is_new) first[order[end]] = order[begin];
    }
  }
  return first;
}

void collect_tets(const std::vector<TetRecord>& records, MshContents& contents) {
  const auto first = first_records(records);
  std::vector<std::int32_t> tet_of_record(records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (first[i] == i) {
      tet_of_record[i] = static_cast<std::int32_t>(contents.tets.size());
      contents.tets.push_back(records[i].corners);
    }
    const std::int32_t group = records[i].tags.physical;
    if (group != 0) contents.volume_groups[group].push_back(tet_of_record[first[i]]);
  }
}

}  // namespace

void read_nodes_22(MshCursor& cursor, MshContents& contents) {
  const std::uint64_t count = cursor.read_text_count("nodes", 8, 28);
  for (std::uint64_t n = 0; n < count; ++n) {
    cursor.begin_record();
    const std::int32_t tag = cursor.read_int("a node tag");
    if (tag < 1) cursor.fail("a node tag above 0", fmt::format("{}", tag));
    contents.nodes.add(cursor, static_cast<std::uint64_t>(tag));
    const double x = cursor.read_real("an x coordinate");
    const double y = cursor.read_real("a y coordinate");
    contents.nodes.add_coordinates({x, y, cursor.read_real("a z coordinate")});
  }
  contents.nodes.index_tags(cursor);
}

void read_elements_22(MshCursor& cursor, MshContents& contents) {
  const std::uint64_t count = cursor.read_text_count("elements", 8, 8);
  std::vector<TetRecord> records;
  if (cursor.is_binary())
    read_binary_elements(cursor, count, contents, records);
  else
    read_text_elements(cursor, count, contents, records);
  collect_tets(records, contents);
}

}  // namespace exmat::precompute
