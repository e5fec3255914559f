#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "common/console/console.h"
#include "common/core/error.h"
#include "tests/stability/suite.h"
#include "tests/stability/suite_report.h"

namespace {

using namespace exmat;

int run(int argc, char** argv) {
  CLI::App app{
      "Steps bodies at the ends of every range and judges each run; status 1 if one fails that is no known limit.",
      "exmat-stability"};
  CommonOptions common;
  add_common_options(app, common);
  std::string folder;
  bool quick = false;
  int jobs = 0;
  app.add_option("-o,--output", folder, "folder for stability.html, .md, .csv and .json")->required();
  app.add_flag("--quick", quick, "the cases of the test command alone, at most 600 steps each");
  app.add_option("--jobs", jobs, "runs at a time; 0: as many as there are threads")
      ->check(exmat::whole_number_between(0, 256));
  return run_program(app, argc, argv, [&] {
    if (common.log_level == "info") common.log_level = "error";  // of hundreds of small bodies
    apply(common);
    precompute::write_suite_report({}, folder);  // better refused now than after the work
    const auto runs =
        quick ? precompute::run_stability(precompute::short_stability_suite(), {precompute::kShortSteps, jobs})
              : precompute::run_stability(precompute::long_stability_suite(), {precompute::kLongSteps, jobs});
    precompute::write_suite_report(runs, folder);
    fmt::print("{}", precompute::suite_markdown(runs));
    if (const auto failed = precompute::runs_with(runs, precompute::Verdict::kFail).size(); failed > 0)
      throw WorkError(fmt::format("{} of {} runs failed; see {}/stability.html", failed, runs.size(), folder));
  });
}

}  // namespace

int main(int argc, char** argv) { return run(argc, argv); }
