#include "runtime/app/loading_log.h"

#include <fmt/format.h>

#include "common/core/log.h"
#include "runtime/scene/keyed_settings.h"

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

void log_loaded(const LoadedWorld& loaded, const WorldConfig& config) {
  for (std::size_t i = 0; i < loaded.kinds.size(); ++i) {
    const LoadedScene& kind = loaded.kinds[i].loaded;
    const std::size_t places = config.bodies[i].places.size();
    log::info(fmt::format("{}: {} of r = {} modes, {} vertices against {} triangles", config.bodies[i].name,
                          places == 1 ? std::string("a body") : fmt::format("{} bodies", places), kind.model->modes(),
                          kind.model->contact->vertices(), loaded.kinds[i].surface->surface.triangles()));
    for (const std::string& line : describe_keys(kind.keys, *kind.model))
      log::info(fmt::format("plan: {}: {}", config.bodies[i].name, line));
  }
}

}  // namespace exmat::runtime
