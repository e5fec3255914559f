#include "runtime/app/loading_log.h"

#include <fmt/format.h>

#include "common/core/log.h"

namespace exmat::runtime {

void log_loaded(const LoadedWorld& loaded, const WorldConfig& config) {
  for (std::size_t i = 0; i < loaded.kinds.size(); ++i) {
    const LoadedScene& kind = loaded.kinds[i].loaded;
    const BodiesConfig& bodies = config.bodies[i];
    log::info(fmt::format("bundle {}: asset \"{}\", {} vertices, {} tets, r = {}, s = {}", bodies.scene.bundle.string(),
                          kind.summary.asset_name, kind.summary.vertices, kind.summary.tets, kind.summary.modes,
                          kind.summary.cubature_elements));
    for (const ReadRecord& record : kind.records)
      log::info(fmt::format("read {}: {} bytes", record.dataset, record.bytes));
    for (const LedgerEntry& entry : kind.ledger)
      log::info(fmt::format("group {}: {}, {} bytes, {}", entry.group, entry.included ? "in" : "out", entry.bytes,
                            entry.reason));
    const std::string of_kind = bodies.name.empty() ? "" : bodies.name + ": ";
    if (config.is_list)
      log::info(fmt::format("plan: {}{}", of_kind,
                            bodies.places.size() == 1 ? "a body" : fmt::format("{} bodies", bodies.places.size())));
    for (const std::string& line : describe_plan(kind, bodies.scene)) log::info("plan: " + of_kind + line);
    if (loaded.kinds[i].surface)
      log::info(fmt::format("plan: {}contact of bodies: {} vertices against {} triangles", of_kind,
                            kind.model->contact->vertices(), loaded.kinds[i].surface->surface.triangles()));
  }
}

}  // namespace exmat::runtime
