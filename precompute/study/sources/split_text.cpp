#include "precompute/study/sources/split_text.h"

#include <algorithm>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "common/core/markup.h"
#include "precompute/drawing/chart.h"
#include "precompute/drawing/table.h"
#include "precompute/study/measure/error_json.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

std::string spaced(std::string_view name) {
  std::string text(name);
  std::ranges::replace(text, '_', ' ');
  return text;
}

std::string source_name(const ErrorPart& part) { return spaced(exmat::name_of(part.source)); }

std::vector<std::string> row_of(const ErrorPart& part) {
  const std::string remark = spaced(exmat::name_of(part.status));
  std::vector<std::string> cells{source_name(part), part.added ? percent(part.added->mean) : remark,
                                 part.added ? percent(part.added->settled) : remark};
  cells.push_back(part.so_far ? percent(part.so_far->mean) : "");
  cells.push_back(part.so_far ? percent(part.so_far->settled) : "");
  cells.emplace_back(setting_of(part.source));
  cells.push_back(part.note);
  return cells;
}

Table table_of(const ErrorSplit& split) {
  Table table{{{"source", true},
               {"adds, mean [%]"},
               {"adds, settled [%]"},
               {"so far, mean [%]"},
               {"so far, settled [%]"},
               {"setting", true},
               {"comparison", true}},
              {}};
  for (const ErrorPart& part : split.parts) table.add(row_of(part));
  table.add({"sum of the parts", percent(split.sum.mean), percent(split.sum.settled), "", "", "", ""});
  table.add({"total", "", "", percent(split.total.mean), percent(split.total.settled), "", "never above the sum"});
  return table;
}

std::string definition(const ErrorSplit& split, const std::string& headline) {
  return fmt::format(
      "Error of {} against {}. A part is the distance of two motions that differ in this approximation alone; all are "
      "over the size of the full problem's motion. So far: from the full problem.",
      headline, split.full_problem);
}

constexpr const char* kNoTruth =
    "No truth: the full problem has inverted tets, so that errors against it say nothing; use the material "
    "stable_neo_hookean, or smaller loads.";

}  // namespace

std::string split_svg(const ErrorSplit& split, const std::string& headline) {
  StackedBars picture;
  picture.title = "Errors by source";
  picture.x_label = fmt::format("error of {} [%]", headline);
  StackedBar mean{"mean", {}, 100 * split.total.mean, "total"},
      settled{"settled", {}, 100 * split.total.settled, "total"};
  for (const ErrorPart& part : split.parts) {
    picture.parts.push_back({source_name(part), part.added ? "" : spaced(exmat::name_of(part.status))});
    mean.values.push_back(part.added ? 100 * part.added->mean : 0);
    settled.values.push_back(part.added ? 100 * part.added->settled : 0);
  }
  picture.bars = {mean, settled};
  return stacked_svg(picture);
}

std::string split_html(const ErrorSplit& split, const std::string& point, const std::string& headline) {
  std::string html = fmt::format("<h2>Errors by source</h2>\n<p class=\"note\">Of {}.</p>\n", escaped(point));
  if (!split.failure.empty()) return html + fmt::format("<p class=\"bad\">{}</p>\n", escaped(split.failure));
  if (split.no_truth) html += fmt::format("<p class=\"bad\">{}</p>\n", kNoTruth);
  return html + fmt::format("<p><strong>{}</strong></p>\n{}{}<p class=\"note\">{}</p>\n", escaped(split.advice),
                            split_svg(split, headline), to_html(table_of(split)), escaped(definition(split, headline)));
}

std::string split_markdown(const ErrorSplit& split, const std::string& study, const std::string& point,
                           const std::string& headline) {
  std::string text = fmt::format("# Errors by source: {}\n\nOf {}.\n\n", study, point);
  if (!split.failure.empty()) return text + split.failure + "\n";
  if (split.no_truth) text += fmt::format("{}\n\n", kNoTruth);
  return text + fmt::format("{}\n\n{}\n\n{}", split.advice, definition(split, headline), to_markdown(table_of(split)));
}

std::string split_csv(const ErrorSplit& split) {
  const Ordered json = to_json(split);
  std::vector<Ordered> records = json["parts"];
  if (!split.failure.empty()) {
    records.push_back({{"source", "total"}, {"status", "failed"}, {"note", split.failure}});
  } else {
    records.push_back({{"source", "sum"}, {"status", "measured"}, {"added", json["sum"]}});
    records.push_back({{"source", "total"}, {"status", "measured"}, {"so_far", json["total"]}});
  }
  return to_csv(records);
}

Ordered to_json(const ErrorSplit& split) {
  Ordered json{{"point", split.point}, {"failure", split.failure}, {"full_problem", split.full_problem}};
  json["parts"] = Ordered::array();
  for (const ErrorPart& part : split.parts)
    json["parts"].push_back({{"source", exmat::name_of(part.source)},
                             {"status", exmat::name_of(part.status)},
                             {"note", part.note},
                             {"added", to_json(part.added)},
                             {"so_far", to_json(part.so_far)}});
  if (!split.failure.empty()) return json;
  json["sum"] = to_json(split.sum);
  json["total"] = to_json(split.total);
  json["no_truth"] = split.no_truth;
  json["advice"] = split.advice;
  return json;
}

}  // namespace exmat::precompute
