#include "precompute/drawing/table.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>

#include "common/core/markup.h"

namespace exmat::precompute {
namespace {

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --line: #8886; --soft: #8882; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1100px; margin: 2em auto; padding: 0 1em; background: Canvas; color: CanvasText; }
h1 { font-size: 1.6em; margin-bottom: 0; } h2 { font-size: 1.2em; margin-top: 2em; }
table { border-collapse: collapse; font-size: 12px; font-variant-numeric: tabular-nums; }
td, th { padding: 2px 7px; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { vertical-align: bottom; background: var(--soft); } .l { text-align: left; white-space: normal; }
tr.front { font-weight: 600; } tr.chosen { background: #2a82; }
.wide { overflow-x: auto; } svg { max-width: 100%; height: auto; } svg text { font: 12px system-ui, sans-serif; fill: currentColor; }
.grid { stroke: var(--line); stroke-width: .5; } .bad { color: #d33; } p.note { font-size: 13px; }
)";

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c);
  return result + '"';
}

std::string html_row(const Table& table, const Table::Row& row) {
  std::string text = row.style.empty() ? "<tr>" : fmt::format("<tr class=\"{}\">", row.style);
  for (std::size_t i = 0; i < row.cells.size(); ++i) {
    const bool spans = i + 1 == row.cells.size() && row.cells.size() < table.columns.size();
    if (spans)
      text += fmt::format("<td class=\"l bad\" colspan=\"{}\">", table.columns.size() - i);
    else
      text += table.columns[i].is_text ? "<td class=\"l\">" : "<td>";
    text += escaped(row.cells[i]) + "</td>";
  }
  return text + "</tr>\n";
}

void add_members(const nlohmann::ordered_json& record, const std::string& path, std::vector<std::string>& names,
                 std::map<std::string, std::string>& line) {
  for (const auto& [member, value] : record.items()) {
    const std::string name = path + member;
    if (value.is_object()) add_members(value, name + "_", names, line);
    if (value.is_structured() || value.is_null()) continue;
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
    line[name] = value.is_string() ? value.get<std::string>() : value.dump();
  }
}

}  // namespace

std::vector<Table::Column> text_columns(std::initializer_list<const char*> names) {
  std::vector<Table::Column> columns;
  for (const char* name : names) columns.push_back({name, true});
  return columns;
}

std::string to_html(const Table& table) {
  std::string text = "<div class=\"wide\"><table>\n<tr>";
  for (const Table::Column& column : table.columns)
    text += fmt::format("<th{}>{}</th>", column.is_text ? " class=\"l\"" : "", escaped(column.name));
  text += "</tr>\n";
  for (const Table::Row& row : table.rows) text += html_row(table, row);
  return text + "</table></div>\n";
}

std::string to_markdown(const Table& table) {
  std::string text = "|", rule = "\n|";
  for (const Table::Column& column : table.columns) {
    text += " " + column.name + " |";
    rule += column.is_text ? " --- |" : " ---: |";
  }
  text += rule + '\n';
  for (const Table::Row& row : table.rows) {
    text += '|';
    for (const std::string& cell : row.cells) text += " " + cell + " |";
    text += '\n';
  }
  return text;
}

std::string to_csv(const std::vector<nlohmann::ordered_json>& records) {
  std::vector<std::string> names;
  std::vector<std::map<std::string, std::string>> lines;
  for (const nlohmann::ordered_json& record : records) add_members(record, "", names, lines.emplace_back());
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ",") + csv_field(name);
  text += '\n';
  for (auto& line : lines) {
    for (std::size_t i = 0; i < names.size(); ++i) text += (i > 0 ? "," : "") + csv_field(line[names[i]]);
    text += '\n';
  }
  return text;
}

std::string html_page(const std::string& title, const std::string& body, const std::string& more_style) {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{0}</title>\n<style>{1}{2}"
      "</style>\n</head>\n<body>\n<h1>{0}</h1>\n{3}</body>\n</html>\n",
      escaped(title), kStyle, more_style, body);
}

std::string short_number(double value) {
  if (!std::isfinite(value)) return "-";
  if (value == 0) return "0";
  const double size = std::abs(value);
  if (size < 0.01 || size >= 1e6) return fmt::format("{:.1e}", value);
  return fmt::format("{:.{}f}", value, size < 1 ? 3 : size < 10 ? 2 : 1);
}

}  // namespace exmat::precompute
