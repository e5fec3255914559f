#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/pipeline/build_reduced_model.h"

namespace exmat::precompute {

/// Course of a run of `exmat-precompute bundle`, as far as it came, for --report.
struct RunReport {
  std::string asset, bundle;
  std::string status = "failed";  ///< "done", "unchanged" (--if-changed) or "failed"
  std::string message{};          ///< the failure; empty where nothing failed
  int exit_status = 0;
  BuildReport build{};
  std::vector<std::string> warnings{};  ///< warnings in the log
};

/// By schemas/report.json, which says what each member is. Hashes the inputs and, where the run is not failed, the
/// bundle; a file that cannot be read any more has the hash "". `model`: null where none was made.
nlohmann::ordered_json to_json(const RunReport& report, const ReducedModel* model);

}  // namespace exmat::precompute
