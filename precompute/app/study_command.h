#pragma once

#include <optional>
#include <string>

namespace exmat {

struct StudyCommandOptions {
  std::string study, folder;
  std::optional<double> budget_us;  ///< of a step
  std::optional<double> max_error;  ///< [%]
  int jobs = 1;                     ///< processes that run points
};

/// Runs a study, writes its report and prints the front and what is recommended. Throws WorkError where points failed
/// or none keeps within the budget.
void study_command(const StudyCommandOptions& options);

}  // namespace exmat
