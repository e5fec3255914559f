#pragma once

#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

namespace exmat::precompute {

/// A table of texts, for pages of HTML and Markdown and for files of CSV.
struct Table {
  struct Column {
    std::string name;
    bool is_text = false;  ///< stands to the left in HTML and Markdown
  };
  /// The last cell of a row that is shorter than the others is a message: HTML spans it over the rest.
  struct Row {
    std::vector<std::string> cells;
    std::string style{};  ///< class of the row in HTML
  };
  std::vector<Column> columns;
  std::vector<Row> rows;

  void add(std::vector<std::string> cells) { rows.push_back({std::move(cells)}); }
};

/// Columns of text by their names.
std::vector<Table::Column> text_columns(std::initializer_list<const char*> names);

std::string to_html(const Table& table);
std::string to_markdown(const Table& table);
/// CSV (RFC 4180 with line feeds alone) of JSON objects, a line each: a column for every member that any of them has a
/// value of, those of inner objects by their path with underscores. Arrays are left out.
std::string to_csv(const std::vector<nlohmann::ordered_json>& records);

/// A page of HTML, all in itself, in the style of all reports.
std::string html_page(const std::string& title, const std::string& body, const std::string& more_style = "");

/// About three digits; "-" where the value is not finite.
std::string short_number(double value);
/// A share as a percentage, likewise.
inline std::string percent(double share) { return short_number(100 * share); }

}  // namespace exmat::precompute
