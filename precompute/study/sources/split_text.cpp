#include "precompute/study/sources/split_text.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "common/core/markup.h"
#include "precompute/study/drawing/stacked_bars.h"
#include "precompute/study/measure/error_json.h"

namespace exmat::precompute {
namespace {

using Ordered = nlohmann::ordered_json;

std::string spaced(std::string_view name) {
  std::string text(name);
  std::ranges::replace(text, '_', ' ');
  return text;
}

std::string source_name(const ErrorPart& part) { return spaced(name_of(part.source)); }

std::string percent(double share) {
  if (!std::isfinite(share)) return "-";
  const double value = 100 * share;
  return value != 0 && value < 0.01 ? fmt::format("{:.1e}", value)
                                    : fmt::format("{:.{}f}", value,
                                                  value < 1    ? 3
                                                  : value < 10 ? 2
                                                               : 1);
}

// A line of the table.
struct Row {
  std::string source, adds, adds_settled, so_far, so_far_settled, setting, note;
};

Row row_of(const ErrorPart& part) {
  const std::string remark = spaced(name_of(part.status));
  const auto numbers = [&](const std::optional<RelativeError>& error) {
    return error ? std::pair(percent(error->mean), percent(error->settled)) : std::pair(remark, remark);
  };
  const auto [adds, adds_settled] = numbers(part.added);
  const auto [so_far, so_far_settled] = numbers(part.so_far);
  return {source_name(part),       adds,     adds_settled, part.so_far ? so_far : "", part.so_far ? so_far_settled : "",
          setting_of(part.source), part.note};
}

std::vector<Row> rows_of(const ErrorSplit& split) {
  std::vector<Row> rows;
  for (const ErrorPart& part : split.parts) rows.push_back(row_of(part));
  rows.push_back({"sum of the parts", percent(split.sum.mean), percent(split.sum.settled), "", "", "", ""});
  rows.push_back({"total", "", "", percent(split.total.mean), percent(split.total.settled), "", "never above the sum"});
  return rows;
}

constexpr const char* kHeaders[] = {"source",           "adds, mean [%]",      "adds, settled [%]",
                                    "so far, mean [%]", "so far, settled [%]", "setting",
                                    "what is compared"};

std::string definition(const ErrorSplit& split, const std::string& headline) {
  return fmt::format(
      "Error of {} against {}. A part is the distance of two motions that differ in this approximation alone; all are "
      "over the size of the full problem's motion. So far: from the full problem.",
      headline, split.full_problem);
}

constexpr const char* kNoTruth =
    "No truth: the full problem has inverted tets, so that errors against it say nothing; use the material "
    "stable_neo_hookean, or smaller loads.";

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? "\"\"" : std::string(1, c);
  return result + '"';
}

std::string csv_numbers(const std::optional<RelativeError>& error) {
  if (!error) return ",,,,";
  std::string text;
  for (const double value : {error->mean, error->max, error->end, error->settled})
    text += std::isfinite(value) ? fmt::format(",{:.9g}", value) : ",inf";
  return text;
}

}  // namespace

std::string split_svg(const ErrorSplit& split, const std::string& headline) {
  StackedBars picture;
  picture.title = "Errors by source";
  picture.x_label = fmt::format("error of {} [%]", headline);
  StackedBar mean{"mean", {}, 100 * split.total.mean, "total"},
      settled{"settled", {}, 100 * split.total.settled, "total"};
  for (const ErrorPart& part : split.parts) {
    picture.parts.push_back({source_name(part), part.added ? "" : spaced(name_of(part.status))});
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
  html += fmt::format("<p><strong>{}</strong></p>\n{}<div class=\"wide\"><table>\n<tr>", escaped(split.advice),
                      split_svg(split, headline));
  for (const char* name : kHeaders) html += fmt::format("<th>{}</th>", name);
  html += "</tr>\n";
  for (const Row& row : rows_of(split)) {
    html += fmt::format("<tr><td class=\"l\">{}</td>", escaped(row.source));
    for (const std::string& text : {row.adds, row.adds_settled, row.so_far, row.so_far_settled})
      html += fmt::format("<td>{}</td>", text);
    for (const std::string& text : {row.setting, row.note})
      html += fmt::format("<td class=\"l\">{}</td>", escaped(text));
    html += "</tr>\n";
  }
  return html + fmt::format("</table></div>\n<p class=\"note\">{}</p>\n", escaped(definition(split, headline)));
}

std::string split_markdown(const ErrorSplit& split, const std::string& study, const std::string& point,
                           const std::string& headline) {
  std::string text = fmt::format("# Errors by source: {}\n\nOf {}.\n\n", study, point);
  if (!split.failure.empty()) return text + split.failure + "\n";
  if (split.no_truth) text += fmt::format("{}\n\n", kNoTruth);
  text += fmt::format("{}\n\n{}\n\n|", split.advice, definition(split, headline));
  for (const char* name : kHeaders) text += fmt::format(" {} |", name);
  text += "\n| --- | ---: | ---: | ---: | ---: | --- | --- |\n";
  for (const Row& row : rows_of(split))
    text += fmt::format("| {} | {} | {} | {} | {} | {} | {} |\n", row.source, row.adds, row.adds_settled, row.so_far,
                        row.so_far_settled, row.setting, row.note);
  return text;
}

std::string split_csv(const ErrorSplit& split) {
  std::string text = "source,status";
  for (const char* kind : {"added", "so_far"})
    for (const char* part : {"mean", "max", "end", "settled"}) text += fmt::format(",{}_{}", kind, part);
  text += ",note\n";
  for (const ErrorPart& part : split.parts)
    text += fmt::format("{},{}{}{},{}\n", name_of(part.source), name_of(part.status), csv_numbers(part.added),
                        csv_numbers(part.so_far), quoted(part.note));
  if (!split.failure.empty())
    return text + fmt::format("total,failed{}{},{}\n", csv_numbers({}), csv_numbers({}), quoted(split.failure));
  text += fmt::format("sum,measured{}{},\n", csv_numbers(split.sum), csv_numbers({}));
  return text + fmt::format("total,measured{}{},\n", csv_numbers({}), csv_numbers(split.total));
}

Ordered to_json(const ErrorSplit& split) {
  Ordered json{{"point", split.point}, {"failure", split.failure}, {"full_problem", split.full_problem}};
  json["parts"] = Ordered::array();
  for (const ErrorPart& part : split.parts)
    json["parts"].push_back({{"source", name_of(part.source)},
                             {"status", name_of(part.status)},
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
