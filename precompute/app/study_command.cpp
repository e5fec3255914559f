#include "precompute/app/study_command.h"

#include <filesystem>
#include <fmt/format.h>
#include <string>

#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "precompute/study/stability/scene_study.h"
#include "precompute/study/sweep/report.h"
#include "precompute/study/sweep/study.h"
#include "precompute/study/worlds/world_study.h"

namespace exmat {
namespace {

void print_front(const precompute::StudyResult& result) {
  fmt::print("\n{:>5}{:>14}{:>12}{:>12}  {}\n", "point", result.headline() + std::string(" [%]"), "step [us]",
             "p95 [us]", "front");
  for (const std::size_t i : result.front) {
    const precompute::PointResult& point = result.points[i];
    fmt::print("{:>5}{:>14.3f}{:>12.2f}{:>12.2f}  {}\n", i + 1, 100 * point.errors.headline().mean,
               1e6 * point.times->median, 1e6 * point.times->p95, precompute::describe(point.settings));
  }
}

void print_sources(const precompute::ErrorSplit& split, const std::string& headline) {
  fmt::print("\n{:<16}{:>14}{:>14}\n", "source", headline + " [%]", "settled [%]");
  for (const precompute::ErrorPart& part : split.parts) {
    if (part.added)
      fmt::print("{:<16}{:>14.3f}{:>14.3f}\n", name_of(part.source), 100 * part.added->mean, 100 * part.added->settled);
    else
      fmt::print("{:<16}{:>14}{:>14}\n", name_of(part.source), name_of(part.status), "");
  }
  fmt::print("{:<16}{:>14.3f}{:>14.3f}\n{}\n", "total", 100 * split.total.mean, 100 * split.total.settled,
             split.advice);
}

void print_front(const precompute::WorldStudyResult& result) {
  fmt::print("\n{:>5}{:>14}{:>16}{:>12}  {}\n", "point", "position [%]", "body step [us]", "p95 [us]", "front");
  for (const std::size_t i : result.front) {
    const precompute::WorldPointResult& point = result.points[i];
    std::string settings;
    for (std::size_t k = 0; k < result.kinds.size(); ++k)
      settings += fmt::format("{}{}: {}", k > 0 ? "; " : "", result.kinds[k], precompute::describe(point.settings[k]));
    fmt::print("{:>5}{:>14.3f}{:>16.2f}{:>12.2f}  {}\n", i + 1, 100 * point.errors.front().position.mean,
               1e6 * point.times->median, 1e6 * point.times->p95, settings);
  }
}

void world_study_command(const StudyCommandOptions& options, const precompute::StudyConfig& config,
                         const precompute::StudyOptions& how) {
  const precompute::WorldStudyResult result = precompute::run_world_study(config, how);
  fmt::print("{}: {} points; {}\n", result.name, result.points.size(),
             (std::filesystem::path(options.folder) / "results.json").string());
  print_front(result);
  if (result.recommended) fmt::print("\nrecommended: point {}\n", *result.recommended + 1);
  if (const std::size_t failed = result.failures(); failed > 0)
    throw WorkError(
        fmt::format("{}: {} of {} points failed; see results.json", options.study, failed, result.points.size()));
  if ((how.budget.seconds || how.budget.error) && !result.recommended) throw WorkError("no point meets the budget");
}

}  // namespace

void study_command(const StudyCommandOptions& options) {
  claim_folder(options.folder, "-o");
  for (const char* name : {"report.html", "results.csv", "results.json", "sources.md", "sources.csv", "sources.svg",
                           "recommended_asset.json", "recommended_scene.json"})
    claim_output(std::filesystem::path(options.folder) / name, "-o");
  precompute::StudyOptions how{.folder = options.folder, .jobs = options.jobs, .budget = {}};
  if (options.budget_us) how.budget.seconds = 1e-6 * *options.budget_us;
  if (options.max_error) how.budget.error = 1e-2 * *options.max_error;
  const precompute::StudyConfig config = precompute::load_study(options.study);
  if (precompute::is_of_bodies(config)) return world_study_command(options, config, how);
  const precompute::StudyResult result = precompute::run_study(config, how);
  fmt::print("{}: {} points; {}\n", result.config.name, result.points.size(),
             (std::filesystem::path(options.folder) / "report.html").string());
  print_front(result);
  if (const std::string warning = result.truth_warning(); !warning.empty()) log::warning(warning);
  const std::string recommendation = precompute::recommendation_text(result);
  if (result.recommended) fmt::print("\n{}\n", recommendation);
  if (result.sources && result.sources->failure.empty()) print_sources(*result.sources, result.headline());
  if (const std::size_t failed = result.failures(); failed > 0)
    throw WorkError(fmt::format("{}: {} of {} points or the sources of errors failed; see the report", options.study,
                                failed, result.points.size()));
  if (!recommendation.empty() && !result.recommended) throw WorkError(recommendation);
}

void stability_command(const StudyCommandOptions& options) {
  claim_folder(options.folder, "-o");
  precompute::claim_scene_study(options.folder);
  const precompute::SceneStudy study = precompute::study_scene(options.scene, options.jobs);
  precompute::write_scene_study(study, options.folder);
  fmt::print("{}", precompute::scene_study_markdown(study));
  if (!study.runs.front().passes()) throw WorkError(study.headline());
}

}  // namespace exmat
