#pragma once

#include <optional>
#include <string>

namespace exmat {

struct StudyCommandOptions {
  std::string study, folder;
  std::optional<double> budget_us;  ///< of a step
  std::optional<double> max_error;  ///< [%]
  int jobs = 1;                     ///< processes that run points; of the stability suite threads
  bool stability = false;           ///< the stability suite, no study
  bool quick = false;               ///< of it what the tests run
};

/// Runs a study, writes its report and prints the front and what is recommended. Throws WorkError where points failed
/// or none keeps within the budget.
void study_command(const StudyCommandOptions& options);

/// Runs the stability suite, writes its report and prints its table. Throws WorkError where a run failed that is no
/// known limit.
void stability_command(const StudyCommandOptions& options);

}  // namespace exmat
