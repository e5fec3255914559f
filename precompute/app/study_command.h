#pragma once

#include <optional>
#include <string>

namespace exmat {

struct StudyCommandOptions {
  std::string study, folder;
  std::string scene;                ///< whose stability is studied, in place of `study`
  std::optional<double> budget_us;  ///< most time of a step
  std::optional<double> max_error;  ///< [%]
  int jobs = 1;                     ///< processes that run points, or threads that run a scene's variants
};

/// Runs a study, writes its report and prints the front and what is recommended. Throws WorkError where points failed
/// or none keeps within the budget.
void study_command(const StudyCommandOptions& options);

/// Pushes a scene along each dimension, writes a report and prints what is safe. Throws WorkError where the scene fails
/// as it is.
void stability_command(const StudyCommandOptions& options);

}  // namespace exmat
