#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/mesh/geometry.h"
#include "precompute/drawing/surface_picture.h"
#include "precompute/study/sweep/report.h"
#include "precompute/study/sweep/results_files.h"
#include "tests/support/box_mesh.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

PointResult some_point(int r, int s, double error, double seconds) {
  PointResult point;
  point.settings = {10, r, 15, "auto", s, "stvk", 0.001, "bdf2", "cubature", "table"};
  point.key = "k" + std::to_string(r) + std::to_string(s);
  point.bundle = "b";
  point.reference = "f";
  point.errors.position = {1 - error, 0.6, 0.7, 0.8};  // ranks the other way round
  point.errors.velocity = {1.0 / 3, kInfinity, 0, 0};
  point.errors.shape = RelativeError{error, 2 * error, 3 * error, 4 * error};
  point.errors.nearest_phase = {error / 2, error, error, error};
  point.errors.worst_frame = 1;
  point.modes = static_cast<std::size_t>(r);
  point.elements = static_cast<std::size_t>(s);
  point.internal_force = "cubature";
  point.target = "table";
  point.heldout_error = 0.01;
  point.steps = 100;
  point.warnings = {"a < b"};
  point.times = StepTimes{seconds, 2 * seconds, 0.1 * seconds, {1e-6, 2e-6, 3e-6, 4e-6, 5e-6}, 50};
  return point;
}

StudyResult some_result() {
  StudyResult result;
  result.config.name = "<study>";
  result.asset_name = "bar";
  result.free_body = result.has_examples = true;
  result.times = {0.1, 0.2};
  result.points = {some_point(10, 20, 0.1, 10e-6), some_point(20, 40, 0.02, 30e-6), some_point(20, 20, 0.12, 20e-6)};
  PointResult failed;
  failed.settings = result.points[0].settings;
  failed.settings.material = "corotational";
  failed.key = "f";
  failed.failure = "went \"wrong\", badly\nindeed";
  result.points.push_back(failed);
  result.references = {
      {.key = "f", .time_step = 0.001, .integrator = "bdf2", .material = "stvk", .failure = "", .inverted = {}}};
  result.front = pareto_front(outcomes(result.points));
  return result;
}

// Returns its key.
std::string add_untrue_reference(StudyResult& result) {
  ReferenceResult reference = result.references[0];
  reference.key = "u";
  reference.inverted = {7, 3};
  result.references.push_back(reference);
  return "u";
}

// Lines of fields, by RFC 4180.
std::vector<std::vector<std::string>> parse_csv(const std::string& text) {
  std::vector<std::vector<std::string>> lines(1, {""});
  bool inside = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (inside && c == '"' && i + 1 < text.size() && text[i + 1] == '"')
      lines.back().back() += text[++i];
    else if (c == '"')
      inside = !inside;
    else if (!inside && c == ',')
      lines.back().emplace_back();
    else if (!inside && c == '\n')
      lines.push_back({""});
    else
      lines.back().back() += c;
  }
  lines.pop_back();
  return lines;
}

TEST(PointFile, KeepsEveryNumber) {
  const test::TemporaryFolder folder;
  PointResult point = some_point(10, 20, 0.1, 1);
  point.times.reset();
  point.from_all_elements = RelativeError{0.1 + 0.2, 1e-300, kInfinity, 1e300};
  point.errors.rebound = kInfinity;
  write_point(folder / "p.json", point);
  const auto read = read_point(folder / "p.json");
  ASSERT_TRUE(read);
  EXPECT_EQ(to_json(*read).dump(), to_json(point).dump());
  EXPECT_EQ(read->from_all_elements->mean, 0.1 + 0.2);
  EXPECT_EQ(read->errors.velocity.max, kInfinity);
  EXPECT_EQ(read->from_all_elements->settled, 1e300);
  EXPECT_EQ(read->errors.rebound, kInfinity);
  EXPECT_EQ(read->settings, point.settings);
}

TEST(PointFile, IsNotTakenWhereItIsDamaged) {
  const test::TemporaryFolder folder;
  write_point(folder / "p.json", some_point(10, 20, 0.1, 1));
  const std::string sound = test::read_file(folder / "p.json");
  EXPECT_FALSE(read_point(folder / "none.json"));
  test::write_file(folder / "q.json", sound.substr(0, sound.size() / 2));
  EXPECT_FALSE(read_point(folder / "q.json"));
  std::string changed = sound;
  changed.replace(changed.find("0.01"), 4, "0.02");
  test::write_file(folder / "q.json", changed);
  EXPECT_FALSE(read_point(folder / "q.json"));
  write_sealed(folder / "q.json", {{"key", "of another version"}});
  EXPECT_FALSE(read_point(folder / "q.json"));
}

TEST(ResultsCsv, HasALineOfAllFieldsForEachPoint) {
  StudyResult result = some_result();
  result.points[1].errors.rebound = 0.25;
  result.points[1].reference = add_untrue_reference(result);
  const auto lines = parse_csv(results_csv(result));
  ASSERT_EQ(lines.size(), 5U);
  for (const auto& line : lines) EXPECT_EQ(line.size(), lines[0].size());
  const auto field = [&](std::size_t line, const std::string& name) {
    const auto found = std::ranges::find(lines[0], name);
    EXPECT_NE(found, lines[0].end()) << name;
    return lines.at(line).at(static_cast<std::size_t>(found - lines[0].begin()));
  };
  EXPECT_EQ(field(2, "basis_size"), "20");
  EXPECT_EQ(std::stod(field(2, "errors_shape_end")), 0.06);
  EXPECT_EQ(std::stod(field(2, "errors_shape_settled")), 0.08);
  EXPECT_EQ(std::stod(field(2, "errors_nearest_phase_mean")), 0.01);
  EXPECT_EQ(field(2, "linear_modes"), "15");
  EXPECT_EQ(std::stod(field(2, "times_median_us")), 30);
  EXPECT_EQ(std::stod(field(2, "errors_position_max")), 0.6);
  EXPECT_EQ(field(1, "errors_rebound") + field(2, "errors_rebound"), "0.25") << "where there was one";
  EXPECT_EQ(field(1, "no_truth") + field(2, "no_truth"), "01");
  EXPECT_EQ(field(2, "reference_inverted_tets_most") + field(2, "reference_inverted_tets_last"), "73");
  EXPECT_EQ(field(1, "on_front") + field(2, "on_front") + field(3, "on_front") + field(4, "on_front"), "1100");
  EXPECT_EQ(field(4, "failure"), "went \"wrong\", badly\nindeed");
  EXPECT_EQ(field(4, "times_median_us") + field(4, "errors_position_mean"), "");
}

TEST(ResultsJson, HoldsAll) {
  StudyResult result = some_result();
  auto json = nlohmann::json::parse(results_json(result).dump());
  EXPECT_EQ(json["points"].size(), 4U);
  EXPECT_EQ(json["headline"], "shape");
  EXPECT_EQ(json["points"][1]["errors"]["shape"]["mean"], 0.02);
  EXPECT_EQ(json["points"][1]["errors"]["shape"]["settled"], 0.08);
  EXPECT_EQ(json["points"][1]["errors"]["nearest_phase"]["mean"], 0.01);
  EXPECT_FALSE(json["points"][1]["errors"].contains("rebound"));
  EXPECT_TRUE(json["points"][1]["errors"]["velocity"]["max"].is_null());
  EXPECT_EQ(json["points"][1]["times"]["median_us"], 30);
  EXPECT_EQ(json["front"], nlohmann::json::parse("[0, 1]"));
  EXPECT_TRUE(json["recommended"].is_null());
  EXPECT_EQ(json["no_truth"], "");
  EXPECT_EQ(json["references"][0]["no_truth"], false);

  add_untrue_reference(result);
  json = nlohmann::json::parse(results_json(result).dump());
  EXPECT_THAT(json["no_truth"].get<std::string>(), HasSubstr("use the material stable_neo_hookean"));
  EXPECT_EQ(json["references"][1]["no_truth"], true);
  EXPECT_EQ(json["references"][1]["inverted_tets"].dump(), R"({"last":3,"most":7})");
  result.free_body = false;
  EXPECT_EQ(nlohmann::json::parse(results_json(result).dump())["headline"], "position");
}

TEST(Results, OfAMaterialThatResistsInversionGiveOtherAdvice) {
  StudyResult result = some_result();
  add_untrue_reference(result);
  result.references[1].material = "stable_neo_hookean";
  EXPECT_THAT(result.truth_warning(), HasSubstr("use smaller loads or a finer mesh"));
}

// The same numbers count by the shape for a free body, by the position for any other.
TEST(Results, AreChosenByTheHeadline) {
  StudyResult result = some_result();
  EXPECT_EQ(outcomes(result.points)[0].error, 0.1);
  for (PointResult& point : result.points) point.errors.shape.reset();
  EXPECT_EQ(outcomes(result.points)[0].error, 0.9);
  EXPECT_EQ(pareto_front(outcomes(result.points)), (std::vector<std::size_t>{0, 2}))
      << "by position the second point is beaten";
}

TEST(Recommendation, IsAFragmentOfTheFiles) {
  StudyResult result = some_result();
  EXPECT_EQ(
      asset_fragment(result, result.points[1]).dump(),
      R"({"shape_space":{"eigenfunctions":10},"basis":{"size":20,"linear_modes":15,"training":"auto"},"cubature":{"elements":40},)"
      R"("internal_force":"cubature","object":{"material":{"model":"stvk"}}})");
  EXPECT_EQ(scene_fragment(result, result.points[1]).dump(),
            R"({"time_step":0.001,"integrator":"bdf2","examples":{"target":"table"}})");
  result.regions = {"left"};
  EXPECT_EQ(scene_fragment(result, result.points[1])["regions"].dump(), R"([{"name":"left","target":"table"}])");
  const test::TemporaryFolder folder;
  result.recommended = 1;
  write_results(result, folder.path());
  EXPECT_EQ(folder.names(), (std::set<std::string>{"recommended_asset.json", "recommended_scene.json", "report.html",
                                                   "results.csv", "results.json"}));
  result.recommended.reset();
  write_results(result, folder.path());
  EXPECT_EQ(folder.size(), 3U) << "what is recommended no longer";
}

TEST(Recommendation, IsPutInWords) {
  StudyResult result = some_result();
  EXPECT_EQ(recommendation_text(result), "");
  result.budget.seconds = 35e-6;
  result.recommended = 1;
  EXPECT_EQ(recommendation_text(result),
            "at most 35 us: point 2 (m 10, r 20 of 15 linear modes, training auto, s 40, stvk, 1 ms, bdf2, "
            "cubature, target table): 2.00 %, 30.0 us a step");
  result.recommended.reset();
  result.nearest = 0;
  EXPECT_THAT(recommendation_text(result), HasSubstr("no point; the nearest is point 1"));
}

TEST(Report, IsOnePageInItself) {
  StudyResult result = some_result();
  const TetMesh mesh = test::box_mesh({2, 2, 2}, {1, 1, 1});
  result.surface = surface_triangles(mesh.tets);
  result.worst_frames = {{1, mesh.vertices, 1.1 * mesh.vertices}};
  const std::string html = report_html(result);
  EXPECT_THAT(html, HasSubstr("&lt;study&gt;"));
  EXPECT_THAT(html, Not(HasSubstr("<study>")));
  EXPECT_THAT(html, HasSubstr("went &quot;wrong&quot;"));
  EXPECT_THAT(html, HasSubstr("a &lt; b")) << "warnings";
  EXPECT_THAT(html, HasSubstr("Error against run time"));
  EXPECT_THAT(html, HasSubstr("Error against the number of modes"));
  EXPECT_THAT(html, HasSubstr("Error against the number of cubature elements"));
  EXPECT_THAT(html, HasSubstr("Worst frames"));
  EXPECT_THAT(html, HasSubstr("error of shape, mean [%]"));
  EXPECT_THAT(html, HasSubstr("shape, settled [%]"));
  EXPECT_THAT(html, HasSubstr("nearest phase [%]"));
  EXPECT_THAT(html, Not(HasSubstr("rebound [%]"))) << "nothing bounced";
  EXPECT_THAT(html, Not(HasSubstr("no truth")));
  for (const char* outside : {"<script", "src=", "@import", "url("}) EXPECT_THAT(html, Not(HasSubstr(outside)));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(Report, MarksWhatIsNoTruth) {
  StudyResult result = some_result();
  result.points[1].reference = add_untrue_reference(result);
  result.points[1].errors.rebound = 0.25;
  const std::string html = report_html(result);
  EXPECT_THAT(html, HasSubstr("use the material stable_neo_hookean"));
  EXPECT_THAT(html, HasSubstr("<td>2 (no truth)</td>"));
  EXPECT_THAT(html, Not(HasSubstr("<td>1 (no truth)</td>")));
  EXPECT_THAT(html, HasSubstr("<tr class=\"bad\">"));
  EXPECT_THAT(html, HasSubstr("rebound [%]"));
  EXPECT_THAT(html, HasSubstr("<td>25.0</td>"));
}

// Each row of points has a cell below every name.
TEST(Report, HasAsManyCellsAsNames) {
  StudyResult result = some_result();
  result.points[1].errors.rebound = 0.25;
  for (const bool free_body : {true, false}) {
    result.free_body = free_body;
    const std::string html = report_html(result), table = html.substr(html.find("<h2>Points</h2>"));
    const auto count = [](const std::string& text, const std::string& what) {
      std::size_t found = 0;
      for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++found;
      return found;
    };
    const std::string row = table.substr(table.find("<tr class"));
    EXPECT_EQ(count(row.substr(0, row.find("</tr>")), "<td"), count(table.substr(0, table.find("</tr>")), "<th"));
  }
}

TEST(Report, OfPointsThatAllFailedIsThere) {
  StudyResult result = some_result();
  result.points = {result.points[3]};
  result.front.clear();
  EXPECT_THAT(report_html(result), HasSubstr("went &quot;wrong&quot;"));
}

// The picture of a large body stays small.
TEST(BodiesPicture, IsSmall) {
  const TetMesh mesh = test::box_mesh({22, 22, 11}, {2, 2, 1});
  const TriangleArray surface = surface_triangles(mesh.tets);
  ASSERT_GT(surface.rows(), 3500);
  const std::string svg = poses_svg(surface, mesh.vertices, 1.05 * mesh.vertices, Eigen::Vector3d::UnitZ(), "p");
  EXPECT_LT(svg.size(), 60000U);
  EXPECT_GT(svg.size(), 10000U);
}

}  // namespace
}  // namespace exmat::precompute
