#include "precompute/study/sweep/report.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "common/core/markup.h"
#include "precompute/drawing/chart.h"
#include "precompute/drawing/surface_picture.h"
#include "precompute/drawing/table.h"
#include "precompute/study/sources/split_text.h"

namespace exmat::precompute {
namespace {

std::string microsecond_text(double seconds) {
  const double value = 1e6 * seconds;
  return fmt::format("{:.{}f}", value, value < 10 ? 2 : value < 1000 ? 1 : 0);
}

bool is_measured(const PointResult& point) { return point.failure.empty() && point.times.has_value(); }

bool all_elements(const PointResult& point) { return point.settings.internal_force == kAllElements; }

std::string label_of(std::size_t index, const PointResult& point) {
  return fmt::format("{}: {}: {} %, {} us", index + 1, describe(point.settings), percent(point.errors.headline().mean),
                     point.times ? microsecond_text(point.times->median) : "-");
}

std::string error_label(const StudyResult& result) { return fmt::format("error of {}, mean [%]", result.headline()); }

// Values that occur, in order, and the place of each.
template <typename Value>
std::map<Value, int> places(const std::set<Value>& values) {
  std::map<Value, int> result;
  for (const Value& value : values) result.emplace(value, static_cast<int>(result.size()));
  return result;
}

std::string name_of_elements(const PointResult& point) {
  return all_elements(point) ? "all elements" : fmt::format("s {}", point.elements);
}

// Colour by the number of elements, shape by that of modes.
std::string time_plot(const StudyResult& result) {
  using Group = std::pair<std::size_t, std::size_t>;  // s, r
  std::set<std::size_t> elements, modes;
  for (const PointResult& point : result.points)
    if (is_measured(point)) {
      elements.insert(point.elements);
      modes.insert(point.modes);
    }
  const auto colours = places(elements), shapes = places(modes);
  std::map<Group, PlotSeries> groups;
  PlotSeries front{.name = "front", .points = {}, .joined = true};
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    const PointResult& point = result.points[i];
    if (!is_measured(point)) continue;
    PlotSeries& series = groups[{point.elements, point.modes}];
    series.name = fmt::format("{}, r {}", name_of_elements(point), point.modes);
    series.colour = colours.at(point.elements);
    series.shape = shapes.at(point.modes);
    series.points.push_back({1e6 * point.times->median, 100 * point.errors.headline().mean, label_of(i, point)});
  }
  for (const std::size_t i : result.front)
    front.points.push_back({1e6 * result.points[i].times->median, 100 * result.points[i].errors.headline().mean, ""});
  Plot plot{.title = "Error against run time",
            .x_label = "step, median [us]",
            .y_label = error_label(result),
            .log_x = true,
            .series = {std::move(front)}};
  for (auto& [group, series] : groups) plot.series.push_back(std::move(series));
  return plot_svg(plot);
}

// Settings without one of them, as the name of a series: those that differ within the study.
struct Varying {
  explicit Varying(const std::vector<PointResult>& points) {
    for (const PointResult& point : points) {
      const PointSettings& s = point.settings;
      const std::vector<std::string> names = texts(s);
      values_.resize(names.size());
      for (std::size_t i = 0; i < names.size(); ++i) values_[i].insert(names[i]);
    }
  }
  std::string name(const PointSettings& settings, bool time_step = true) const {
    std::string text;
    const std::vector<std::string> names = texts(settings);
    for (std::size_t i = 0; i < names.size(); ++i)
      if (values_[i].size() > 1 && (time_step || i != kTimeStep)) text += (text.empty() ? "" : ", ") + names[i];
    return text;
  }

 private:
  static constexpr std::size_t kTimeStep = 2;
  static std::string force_of(const PointSettings& s) {
    return s.elastic_stiffness ? fmt::format("elastic force of {:g}", *s.elastic_stiffness) : "force of the scene";
  }
  static std::vector<std::string> texts(const PointSettings& s) {
    return {fmt::format("m {}", s.eigenfunctions),
            s.material,
            fmt::format("{:g} ms", 1e3 * s.time_step),
            s.integrator,
            s.internal_force == kAllElements ? "cubature" : s.internal_force,
            s.target,
            fmt::format("{} linear modes", s.linear_modes),
            "training " + s.training,
            s.precision + " precision",
            "space " + s.space,
            force_of(s)};
  }
  std::vector<std::set<std::string>> values_;
};

using Abscissa = double (*)(const PointResult&);

// Lines of points that differ in one number alone; `rest` is what the others are.
template <typename Rest>
std::string line_plot(const StudyResult& result, const std::string& title, const std::string& x_label, Abscissa x,
                      Rest rest, bool with_levels) {
  std::map<std::string, PlotSeries> lines;
  std::set<double> range;
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    const PointResult& point = result.points[i];
    if (!point.failure.empty() || (with_levels && all_elements(point))) continue;
    PlotSeries& line = lines[rest(point)];
    line.points.push_back({x(point), 100 * point.errors.headline().mean, label_of(i, point)});
  }
  std::erase_if(lines, [](const auto& entry) { return entry.second.points.size() < 2; });
  Plot plot{.title = title, .x_label = x_label, .y_label = error_label(result), .series = {}};
  for (auto& [name, line] : lines) {
    std::ranges::stable_sort(line.points, {}, &PlotPoint::x);
    for (const PlotPoint& point : line.points) range.insert(point.x);
    line.name = name;
    line.colour = line.shape = static_cast<int>(plot.series.size());
    line.joined = true;
    plot.series.push_back(std::move(line));
  }
  if (range.size() < 2) return "";
  for (const PointResult& point : result.points) {
    if (!with_levels || !all_elements(point) || !point.failure.empty()) continue;
    const double error = 100 * point.errors.headline().mean;
    plot.series.push_back({.name = fmt::format("all elements, r {}", point.modes),
                           .points = {{*range.begin(), error, ""}, {*range.rbegin(), error, ""}},
                           .colour = static_cast<int>(plot.series.size()),
                           .joined = true,
                           .dashed = true});
  }
  return plot_svg(plot);
}

std::string plots(const StudyResult& result) {
  const Varying varying(result.points);
  const auto joined = [](std::string first, const std::string& second) {
    return second.empty() ? first : first + ", " + second;
  };
  std::string html = time_plot(result);
  html += line_plot(
      result, "Error against the number of modes", "r",
      [](const PointResult& p) { return static_cast<double>(p.modes); },
      [&](const PointResult& p) { return joined(name_of_elements(p), varying.name(p.settings)); }, false);
  html += line_plot(
      result, "Error against the number of cubature elements", "s",
      [](const PointResult& p) { return static_cast<double>(p.elements); },
      [&](const PointResult& p) { return joined(fmt::format("r {}", p.modes), varying.name(p.settings)); }, true);
  html += line_plot(
      result, "Error against the time step", "time step [ms]",
      [](const PointResult& p) { return 1e3 * p.settings.time_step; },
      [&](const PointResult& p) {
        return joined(fmt::format("r {}, {}", p.modes, name_of_elements(p)), varying.name(p.settings, false));
      },
      false);
  return html;
}

bool rebounds(const StudyResult& result) {
  return std::ranges::any_of(result.points, [](const PointResult& p) { return p.errors.rebound.has_value(); });
}

bool has_mixed(const StudyResult& result) {
  return std::ranges::any_of(result.points, [](const PointResult& p) { return p.from_double.has_value(); });
}

/// Columns of the errors of a point, and its cells in them.
void add_error_columns(const StudyResult& result, std::vector<Table::Column>& columns) {
  for (const char* part : {"mean", "max", "end", "settled", "nearest phase"})
    columns.push_back({fmt::format("{}, {} [%]", result.headline(), part)});
  if (result.free_body) columns.push_back({"position [%]"});
  if (rebounds(result)) columns.push_back({"rebound [%]"});
  for (const char* name : {"velocity [%]", "energy [%]", "from all elements [%]"}) columns.push_back({name});
  if (has_mixed(result)) columns.push_back({"mixed, from double [%]"});
}

void add_errors(const StudyResult& result, const PointResult& point, std::vector<std::string>& cells) {
  const TrajectoryErrors& e = point.errors;
  const RelativeError& chosen = e.headline();
  for (const double share : {chosen.mean, chosen.max, chosen.end, chosen.settled, e.nearest_phase.mean})
    cells.push_back(percent(share));
  if (result.free_body) cells.push_back(percent(e.position.mean));
  if (rebounds(result)) cells.push_back(e.rebound ? percent(*e.rebound) : "-");
  cells.push_back(percent(e.velocity.mean));
  cells.push_back(percent(e.energy));
  cells.push_back(point.from_all_elements ? percent(point.from_all_elements->mean) : "-");
  if (has_mixed(result)) cells.push_back(point.from_double ? percent(point.from_double->mean) : "-");
}

Table::Row point_row(const StudyResult& result, std::size_t i) {
  const PointResult& point = result.points[i];
  const PointSettings& s = point.settings;
  const bool failed = !point.failure.empty(), front = std::ranges::find(result.front, i) != result.front.end();
  const auto as_run = [](const std::string& asked, const std::string& taken) {
    return asked == "auto" && !taken.empty() ? "auto: " + taken : asked;
  };
  std::vector<std::string> cells{std::to_string(i + 1) + (!failed && !result.has_truth(point) ? " (no truth)" : ""),
                                 std::to_string(s.eigenfunctions),
                                 std::to_string(s.basis_size),
                                 std::to_string(s.linear_modes),
                                 s.training,
                                 failed ? "-" : std::to_string(point.elements),
                                 s.material,
                                 fmt::format("{:g}", 1e3 * s.time_step),
                                 s.integrator,
                                 as_run(s.internal_force, point.internal_force),
                                 as_run(s.target, point.target),
                                 s.elastic_stiffness ? fmt::format("{:g}", *s.elastic_stiffness) : "-"};
  if (failed) {
    cells.push_back(point.failure);
    return {std::move(cells)};
  }
  add_errors(result, point, cells);
  cells.push_back(all_elements(point) ? "-" : percent(point.heldout_error));
  const StepTimes times = point.times.value_or(StepTimes());
  for (const double seconds : {times.median, times.p95, times.interpolation})
    cells.push_back(point.times ? microsecond_text(seconds) : "-");
  cells.push_back(fmt::format("{:.1f}", point.precompute_seconds));
  cells.push_back(fmt::format("{:.2f}", point.newton_iterations));
  cells.push_back(std::to_string(point.unconverged_steps));
  return {std::move(cells), std::string(front ? "front " : "") + (result.recommended == i ? "chosen" : "")};
}

std::string points_table(const StudyResult& result) {
  Table table{{{"#"},
               {"m"},
               {"r"},
               {"linear modes"},
               {"training", true},
               {"s"},
               {"material", true},
               {"dt [ms]"},
               {"integrator", true},
               {"internal force", true},
               {"target", true},
               {"elastic force"}},
              {}};
  add_error_columns(result, table.columns);
  for (const char* name :
       {"held-out [%]", "step [us]", "p95 [us]", "interp [us]", "precompute [s]", "Newton", "above tolerance"})
    table.columns.push_back({name});
  for (std::size_t i = 0; i < result.points.size(); ++i) table.rows.push_back(point_row(result, i));
  return "<h2>Points</h2>\n<p class=\"note\">Bold: on the front. Settled: mean of the last tenth of the time. Nearest "
         "phase: mean, against the full space up to 5 % of the duration earlier or later; where it is much below the "
         "mean, the body moves as it should, but too early or too late. Held-out: error of the cubature's force. "
         "Newton: iterations a step; the last column counts steps.</p>\n" +
         to_html(table);
}

std::string references_table(const StudyResult& result) {
  Table table{{{"m"},
               {"material", true},
               {"dt [ms]"},
               {"integrator", true},
               {"steps"},
               {"step, median [ms]"},
               {"Newton"},
               {"factorisations"},
               {"above tolerance"},
               {"inverted tets, most"},
               {"at the end"}},
              {}};
  for (const ReferenceResult& r : result.references) {
    std::vector<std::string> cells{r.eigenfunctions > 0 ? std::to_string(r.eigenfunctions) : "-", r.material,
                                   fmt::format("{:g}", 1e3 * r.time_step), r.integrator};
    if (!r.failure.empty())
      cells.push_back(r.failure);
    else
      for (std::string text :
           {std::to_string(r.steps), fmt::format("{:.3f}", 1e3 * r.step_seconds),
            fmt::format("{:.2f}", r.newton_iterations), fmt::format("{:.3f}", r.factorisations),
            std::to_string(r.unconverged_steps), std::to_string(r.inverted.most), std::to_string(r.inverted.last)})
        cells.push_back(std::move(text));
    table.rows.push_back({std::move(cells), r.inverted.any() ? "bad" : ""});
  }
  return "<h2>Full space</h2>\n" + to_html(table) +
         "<p class=\"note\">Times of the full space are of one run, beside whatever else ran.</p>\n";
}

std::string pictures(const StudyResult& result) {
  if (result.worst_frames.empty()) return "";
  std::string html = fmt::format(
      "<h2>Worst frames</h2>\n<p class=\"note\">Full space, reduced{}, and both on one another, where the "
      "error of {} is largest.</p>\n",
      result.free_body ? " (turned and shifted onto it)" : "", result.headline());
  for (const WorstFrame& frame : result.worst_frames) {
    const PointResult& point = result.points[frame.point];
    html += fmt::format("<p>Point {} ({}) at {:.4g} s: {} % of the RMS {}</p>\n", frame.point + 1,
                        escaped(describe(point.settings)), point.worst_time, percent(point.errors.headline().max),
                        result.free_body ? "deformation" : "displacement");
    html += poses_svg(result.surface, frame.full, frame.reduced, result.up, fmt::format("p{}", frame.point + 1));
  }
  return html;
}

std::string warnings(const StudyResult& result) {
  std::set<std::string> texts;
  for (const PointResult& point : result.points) texts.insert(point.warnings.begin(), point.warnings.end());
  if (texts.empty()) return "";
  std::string html = "<h2>Warnings of the offline stage</h2>\n<ul>\n";
  for (const std::string& text : texts) html += "<li>" + escaped(text) + "</li>\n";
  return html + "</ul>\n";
}

std::string summary(const StudyResult& result) {
  std::string html = fmt::format(
      "<p>Asset {}: {} vertices, {} tets, a {} body. {} frames up to {:g} s. Times: one thread, {}, {}, {} rounds in "
      "turns.</p>\n",
      escaped(result.asset_name), result.vertices, result.tets, result.free_body ? "free" : "constrained",
      result.times.size(), result.times.back(), escaped(result.processor), result.instruction_set,
      result.config.timing.rounds);
  if (const std::size_t failed = result.failures(); failed > 0)
    html += fmt::format("<p class=\"bad\">{} failed, see below.</p>\n", failed);
  if (const std::string text = result.truth_warning(); !text.empty())
    html += fmt::format("<p class=\"bad\">{}</p>\n", escaped(text));
  if (const std::string text = recommendation_text(result); !text.empty())
    html += fmt::format("<p><strong>{}</strong></p>\n", escaped(text));
  return html;
}

std::string budget_text(const Budget& budget) {
  std::string text;
  if (budget.seconds) text += fmt::format("at most {:g} us", 1e6 * *budget.seconds);
  if (budget.error) text += fmt::format("{}at most {:g} %", text.empty() ? "" : " and ", 100 * *budget.error);
  return text;
}

}  // namespace

std::string recommendation_text(const StudyResult& result) {
  if (!result.budget.seconds && !result.budget.error) return "";
  const auto named = [&](std::size_t i) {
    const PointResult& point = result.points[i];
    return fmt::format("point {} ({}): {} %, {} us a step", i + 1, describe(point.settings),
                       percent(point.errors.headline().mean), microsecond_text(point.times->median));
  };
  if (result.recommended) return fmt::format("{}: {}", budget_text(result.budget), named(*result.recommended));
  if (result.nearest)
    return fmt::format("{}: no point; the nearest is {}", budget_text(result.budget), named(*result.nearest));
  return fmt::format("{}: no point", budget_text(result.budget));
}

std::string sources_point(const StudyResult& result) {
  const std::size_t i = result.sources->point;
  return fmt::format("point {} ({})", i + 1, describe(result.points[i].settings));
}

std::string report_html(const StudyResult& result) {
  return html_page(result.config.name,
                   summary(result) + plots(result) +
                       (result.sources ? split_html(*result.sources, sources_point(result), result.headline()) : "") +
                       pictures(result) + points_table(result) + references_table(result) + warnings(result));
}

}  // namespace exmat::precompute
