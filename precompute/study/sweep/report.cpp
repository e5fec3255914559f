#include "precompute/study/sweep/report.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "common/core/markup.h"
#include "precompute/study/drawing/svg.h"
#include "precompute/study/sources/split_text.h"

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

std::string percent(double share) {
  if (!std::isfinite(share)) return "-";
  const double value = 100 * share;
  if (value == 0) return "0";
  return value < 0.01 ? fmt::format("{:.1e}", value)
                      : fmt::format("{:.{}f}", value,
                                    value < 1    ? 3
                                    : value < 10 ? 2
                                                 : 1);
}

std::string microseconds(double seconds) {
  const double value = 1e6 * seconds;
  return fmt::format("{:.{}f}", value, value < 10 ? 2 : value < 1000 ? 1 : 0);
}

std::string cell(const std::string& text, const char* attributes = "") {
  return fmt::format("<td{}>{}</td>", attributes, text);
}

std::string header(const std::vector<std::string>& names) {
  std::string html = "<tr>";
  for (const std::string& name : names) html += "<th>" + name + "</th>";
  return html + "</tr>\n";
}

std::string shades(const char* kind, double hue) {
  std::string css;
  for (int i = 0; i < 8; ++i)
    css += fmt::format(".{0} .s{1}{{fill:hsl({2} 55% {3}%);stroke:hsl({2} 55% {3}%);stroke-width:.4}}\n", kind, i, hue,
                       24 + 6 * i);
  return css;
}

bool is_measured(const PointResult& point) { return point.failure.empty() && point.times.has_value(); }

bool all_elements(const PointResult& point) { return point.settings.internal_force == kAllElements; }

std::string label_of(std::size_t index, const PointResult& point) {
  return fmt::format("{}: {}: {} %, {} us", index + 1, describe(point.settings), percent(point.errors.headline().mean),
                     point.times ? microseconds(point.times->median) : "-");
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

std::vector<std::string> error_names(const StudyResult& result) {
  std::vector<std::string> names;
  for (const char* part : {"mean", "max", "end", "settled", "nearest<br>phase"})
    names.push_back(fmt::format("{},<br>{} [%]", result.headline(), part));
  if (result.free_body) names.emplace_back("position<br>[%]");
  if (rebounds(result)) names.emplace_back("rebound<br>[%]");
  for (const char* name : {"velocity<br>[%]", "energy<br>[%]", "from all<br>elements [%]"}) names.emplace_back(name);
  if (has_mixed(result)) names.emplace_back("mixed, from<br>double [%]");
  return names;
}

// In the order of error_names().
std::string error_cells(const StudyResult& result, const PointResult& point) {
  const TrajectoryErrors& e = point.errors;
  const RelativeError& chosen = e.headline();
  std::string html = cell(percent(chosen.mean)) + cell(percent(chosen.max)) + cell(percent(chosen.end)) +
                     cell(percent(chosen.settled)) + cell(percent(e.nearest_phase.mean));
  if (result.free_body) html += cell(percent(e.position.mean));
  if (rebounds(result)) html += cell(e.rebound ? percent(*e.rebound) : "-");
  html += cell(percent(e.velocity.mean)) + cell(percent(e.energy));
  html += cell(point.from_all_elements ? percent(point.from_all_elements->mean) : "-");
  if (has_mixed(result)) html += cell(point.from_double ? percent(point.from_double->mean) : "-");
  return html;
}

std::string point_row(const StudyResult& result, std::size_t i) {
  const PointResult& point = result.points[i];
  const PointSettings& s = point.settings;
  const bool front = std::ranges::find(result.front, i) != result.front.end();
  std::string html = fmt::format("<tr class=\"{}{}\">", front ? "front " : "", result.recommended == i ? "chosen" : "");
  const char* mark = point.failure.empty() && !result.has_truth(point) ? " (no truth)" : "";
  html += cell(std::to_string(i + 1) + mark) + cell(std::to_string(s.eigenfunctions)) +
          cell(std::to_string(s.basis_size)) + cell(std::to_string(s.linear_modes)) + cell(s.training, " class=\"l\"");
  html += cell(point.failure.empty() ? std::to_string(point.elements) : "-") + cell(s.material, " class=\"l\"");
  html += cell(fmt::format("{:g}", 1e3 * s.time_step)) + cell(s.integrator, " class=\"l\"");
  const auto as_run = [](const std::string& asked, const std::string& taken) {
    return asked == "auto" && !taken.empty() ? "auto: " + taken : asked;
  };
  html += cell(as_run(s.internal_force, point.internal_force), " class=\"l\"") +
          cell(as_run(s.target, point.target), " class=\"l\"") +
          cell(s.elastic_stiffness ? fmt::format("{:g}", *s.elastic_stiffness) : "-");
  if (!point.failure.empty())
    return html + fmt::format("<td class=\"l bad\" colspan=\"19\">{}</td></tr>\n", escaped(point.failure));
  html += error_cells(result, point);
  html += cell(all_elements(point) ? "-" : percent(point.heldout_error));
  if (point.times)
    html += cell(microseconds(point.times->median)) + cell(microseconds(point.times->p95)) +
            cell(microseconds(point.times->interpolation));
  html += cell(fmt::format("{:.1f}", point.precompute_seconds)) + cell(fmt::format("{:.2f}", point.newton_iterations));
  return html + cell(std::to_string(point.unconverged_steps)) + "</tr>\n";
}

std::string points_table(const StudyResult& result) {
  std::vector<std::string> names{
      "#",        "m",          "r",          "linear<br>modes", "training", "s",
      "material", "dt<br>[ms]", "integrator", "internal force",  "target",   "elastic<br>force"};
  for (std::string& name : error_names(result)) names.push_back(std::move(name));
  for (const char* name : {"held-out<br>[%]", "step<br>[us]", "p95<br>[us]", "interp<br>[us]", "precompute<br>[s]",
                           "Newton", "above<br>tolerance"})
    names.emplace_back(name);
  std::string html =
      "<h2>Points</h2>\n<p class=\"note\">Bold: on the front. Settled: mean of the last tenth of the time. Nearest "
      "phase: mean, against the full space up to 5 % of the duration earlier or later; where it is much below the "
      "mean, "
      "the body moves as it should, but too early or too late. Held-out: error of the cubature's force. Newton: "
      "iterations a step; the last column counts steps.</p>\n"
      "<div class=\"wide\"><table>\n" +
      header(names);
  for (std::size_t i = 0; i < result.points.size(); ++i) html += point_row(result, i);
  return html + "</table></div>\n";
}

std::string references_table(const StudyResult& result) {
  std::string html = "<h2>Full space</h2>\n<div class=\"wide\"><table>\n" +
                     header({"m", "material", "dt [ms]", "integrator", "steps", "step, median [ms]", "Newton",
                             "factorisations", "above tolerance", "inverted tets, most", "at the end"});
  for (const ReferenceResult& r : result.references) {
    html += "<tr>" + cell(r.eigenfunctions > 0 ? std::to_string(r.eigenfunctions) : "-") +
            cell(r.material, " class=\"l\"") + cell(fmt::format("{:g}", 1e3 * r.time_step)) +
            cell(r.integrator, " class=\"l\"");
    if (!r.failure.empty()) {
      html += fmt::format("<td class=\"l bad\" colspan=\"7\">{}</td></tr>\n", escaped(r.failure));
      continue;
    }
    html += cell(std::to_string(r.steps)) + cell(fmt::format("{:.3f}", 1e3 * r.step_seconds)) +
            cell(fmt::format("{:.2f}", r.newton_iterations)) + cell(fmt::format("{:.3f}", r.factorisations)) +
            cell(std::to_string(r.unconverged_steps));
    const char* attributes = r.inverted.any() ? " class=\"bad\"" : "";
    html += cell(std::to_string(r.inverted.most), attributes) + cell(std::to_string(r.inverted.last), attributes) +
            "</tr>\n";
  }
  return html +
         "</table></div>\n<p class=\"note\">Times of the full space are of one run, beside whatever else ran.</p>\n";
}

std::string ratio(double slow, double fast) { return fast > 0 ? fmt::format("{:.1f}", slow / fast) : "-"; }

// Ours with the files' own settings, whatever the target.
std::vector<std::size_t> own_points(const StudyResult& result) {
  std::vector<std::size_t> points;
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    PointSettings settings = result.points[i].settings;
    settings.target = result.points[result.own].settings.target;
    if (is_measured(result.points[i]) && settings == result.points[result.own].settings) points.push_back(i);
  }
  return points;
}

std::string baseline_table(const StudyResult& result) {
  if (!result.config.baseline && !result.config.paper) return "";
  std::string html = "<h2>Beside the baseline and the paper</h2>\n";
  if (!result.baseline_failure.empty())
    html += fmt::format("<p class=\"bad\">baseline: {}</p>\n", escaped(result.baseline_failure));
  html += "<table>\n" + header({"", "t_interp [ms]", "ratio", "t_total [ms]", "ratio"});
  const auto row = [](const std::string& name, double interp, double total, const std::string& first,
                      const std::string& second) {
    return "<tr>" + cell(name, " class=\"l\"") + cell(fmt::format("{:.4g}", interp)) + cell(first) +
           cell(fmt::format("{:.4g}", total)) + cell(second) + "</tr>\n";
  };
  const auto& paper = result.config.paper;
  if (paper) html += row("Zhu et al., as the paper measured it", paper->zhu_interp, paper->zhu_total, "", "");
  if (paper)
    html += row("the paper", paper->interp, paper->total, ratio(paper->zhu_interp, paper->interp),
                ratio(paper->zhu_total, paper->total));
  const auto& baseline = result.baseline;
  if (baseline) html += row("the baseline here", 1e3 * baseline->interpolation, 1e3 * baseline->median, "", "");
  for (const std::size_t i : own_points(result)) {
    const PointResult& point = result.points[i];
    const StepTimes& times = *point.times;
    html += row(fmt::format("exmat, point {}, target: {}", i + 1, point.target), 1e3 * times.interpolation,
                1e3 * times.median, baseline ? ratio(baseline->interpolation, times.interpolation) : "",
                baseline ? ratio(baseline->median, times.median) : "");
  }
  html +=
      "</table>\n<p class=\"note\">Medians. A ratio is the time of the full-space method above by this one's; the "
      "paper's "
      "times are of its own machine";
  if (baseline) html += fmt::format("; {} steps of the baseline were measured", baseline->steps);
  return html + ".</p>\n";
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
    html += bodies_svg(result.surface, frame.full, frame.reduced, result.up, fmt::format("p{}", frame.point + 1));
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
                       percent(point.errors.headline().mean), microseconds(point.times->median));
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
  return fmt::format(
             "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta "
             "charset=\"utf-8\">\n<title>{0}</title>\n<style>{1}{2}{3}"
             "</style>\n</head>\n<body>\n<h1>{0}</h1>\n",
             escaped(result.config.name), kStyle, shades("full", 212), shades("reduced", 24)) +
         summary(result) + plots(result) +
         (result.sources ? split_html(*result.sources, sources_point(result), result.headline()) : "") +
         baseline_table(result) + pictures(result) + points_table(result) + references_table(result) +
         warnings(result) + "</body>\n</html>\n";
}

}  // namespace exmat::precompute
