#include "runtime/app/loading_log.h"

#include <fmt/format.h>

#include "common/core/log.h"

namespace exmat::runtime {

void log_loaded(const LoadedScene& loaded, const SceneConfig& config) {
  log::info(fmt::format("bundle {}: asset \"{}\", {} vertices, {} tets, r = {}, s = {}", config.bundle.string(),
                        loaded.summary.asset_name, loaded.summary.vertices, loaded.summary.tets, loaded.summary.modes,
                        loaded.summary.cubature_elements));
  for (const ReadRecord& record : loaded.records)
    log::info(fmt::format("read {}: {} bytes", record.dataset, record.bytes));
  for (const LedgerEntry& entry : loaded.ledger)
    log::info(fmt::format("group {}: {}, {} bytes, {}", entry.group, entry.included ? "in" : "out", entry.bytes,
                          entry.reason));
  for (const std::string& line : describe_plan(loaded, config)) log::info("plan: " + line);
}

}  // namespace exmat::runtime
