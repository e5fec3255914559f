#include "common/bundle/format_doc.h"

#include <algorithm>
#include <fmt/format.h>
#include <sstream>

#include "common/bundle/file_schemas.h"
#include "common/hdf5/schema.h"

namespace exmat {
namespace {

constexpr std::string_view kIntroduction = R"(# File formats

<!-- Generated from schemas/bundle.json and schemas/trajectory.json; exmat_test_common writes it. -->

Both files are HDF5, contiguous and little-endian, so `h5dump` and every HDF5 library read them. Arrays are row-major,
indices 0-based, numbers finite. Each dataset has the attributes `description`, `units`, `dims` and `crc32` (zlib's
CRC-32 of its data, row-major and little-endian), each group of a bundle the attribute `description`. Text is UTF-8 of
fixed length. The same model gives the same bytes.

`range`: `positive` > 0; `non_negative` >= 0; `unit_interval` in [0, 1]; `poisson` in (-1, 0.5); `flag` 0 or 1;
`index:n` in [0, n); `ascending` no element below the one before it; `increasing` each above; `symmetric` a symmetric
matrix; `one_of:a|b` one of these texts; `may_be_empty` unlike all others, no elements are allowed.

A reader refuses files of another format version.
)";

constexpr std::string_view kUseOfBundle = R"(
`use` says when the run time reads a dataset of a group that its scene needs: `step`, to step; `positions`, to write
positions; `full_space`, to step in all vertices; `look`, to export what is drawn; `places`, to find the vertices that
the scene names; `draw`, to draw the body or its elements; `inspect`, never, so that packs (docs/packs.md) leave it out.
Groups that no scene needs are left out.
)";

constexpr std::size_t kColumns = 120;

/// The text in lines of at most kColumns, broken at blanks.
std::string wrapped(const std::string& text) {
  std::string page;
  std::size_t column = 0;
  std::istringstream words(text);
  for (std::string word; words >> word; column += word.size()) {
    const bool is_first = page.empty();
    const bool is_full = !is_first && column + 1 + word.size() > kColumns;
    if (!is_first) page += is_full ? '\n' : ' ';
    column = is_full ? 0 : column + (is_first ? 0 : 1);
    page += word;
  }
  return page;
}

// Bars would end a cell.
std::string cell(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.insert(at, 1, '\\');
  return text;
}

std::string code(const std::string& text) { return text.empty() ? "" : "`" + cell(text) + "`"; }

std::string constraints_text(const std::vector<Constraint>& constraints) {
  std::string text;
  for (const Constraint& constraint : constraints) text += (text.empty() ? "" : ", ") + cell(constraint.text);
  return text;
}

std::string attribute_table(const std::vector<AttributeSchema>& attributes) {
  std::string text = "| attribute | type | dims | units | range | |\n| --- | --- | --- | --- | --- | --- |\n";
  for (const AttributeSchema& attribute : attributes)
    text += fmt::format("| {} | {} | {} | {} | {} | {} |\n", code(attribute.name), name_of(attribute.type),
                        cell(attribute.dims_text), attribute.units, constraints_text(attribute.constraints),
                        cell(attribute.description));
  return text;
}

std::string dataset_table(const FileSchema& schema, const std::string& group) {
  std::string text = "| dataset | type | dims | units | range | use | |\n| --- | --- | --- | --- | --- | --- | --- |\n";
  for (const DatasetSchema& dataset : schema.datasets)
    if (dataset.path.substr(0, dataset.path.rfind('/')) == group)
      text += fmt::format("| {} | {} | {} | {} | {} | {} | {} |\n", code(dataset.path), name_of(dataset.type),
                          cell(dataset.dims_text), dataset.units, constraints_text(dataset.constraints),
                          name_of(dataset.use), cell(dataset.description));
  return text;
}

bool has_datasets(const FileSchema& schema, const std::string& group) {
  return std::any_of(schema.datasets.begin(), schema.datasets.end(), [&](const DatasetSchema& dataset) {
    return dataset.path.substr(0, dataset.path.rfind('/')) == group;
  });
}

// Symbols and groups that it has of its own.
std::string own_parts(const GroupSchema& group) {
  if (group.holds.empty()) return "";
  std::string groups;
  for (const std::string& held : group.holds) groups += (groups.empty() ? "" : ", ") + code(group.path + held);
  return "\n" +
         wrapped(fmt::format("It holds {}, all as above; its sizes {} are its own.", groups,
                             fmt::join(group.symbols, ", "))) +
         "\n";
}

std::string group_section(const FileSchema& schema, const GroupSchema& group) {
  if (!group.like.empty()) return "";
  std::string text =
      fmt::format("\n### {}\n{}\n{}", code(group.path), wrapped(group.description + "."), own_parts(group));
  if (!group.attributes.empty()) text += "\n" + attribute_table(group.attributes);
  if (has_datasets(schema, group.path)) text += "\n" + dataset_table(schema, group.path);
  return text;
}

std::string file_section(const FileSchema& schema, const std::string& title, std::string_view remark) {
  std::string text = fmt::format("\n## {}\n{}\n\nFormat version {}.\n{}", title, wrapped(schema.description),
                                 schema.format_version, remark);
  text += "\n| symbol | |\n| --- | --- |\n";
  for (const auto& [name, meaning] : schema.symbols) text += fmt::format("| {} | {} |\n", code(name), meaning);
  text += "\n### Root\n" + attribute_table(schema.attributes);
  if (has_datasets(schema, "")) text += "\n" + dataset_table(schema, "");
  for (const GroupSchema& group : schema.groups) text += group_section(schema, group);
  return text;
}

}  // namespace

std::string format_page() {
  return std::string(kIntroduction) + file_section(bundle_schema(), "Bundle", kUseOfBundle) +
         file_section(trajectory_schema(), "Trajectory", "");
}

}  // namespace exmat
