#include "runtime/app/lost_work.h"

#include <fmt/format.h>
#include <string>
#include <vector>

#include "common/bundle/bundle.h"
#include "runtime/app/print.h"
#include "runtime/capacity/load_capacity.h"

namespace exmat::runtime {
namespace {

constexpr Eigen::Index kMostMeasured = 6000;  // vertices: some tenths of a second

struct NamedLoad {
  std::string name, remark;
  Eigen::VectorXd load;  ///< [3n]
};

std::vector<NamedLoad> scripted_loads(const std::vector<VertexForceConfig>& forces, Eigen::Index vertices) {
  std::vector<NamedLoad> loads;
  for (std::size_t i = 0; i < forces.size(); ++i) {
    NamedLoad& load = loads.emplace_back(NamedLoad{fmt::format("force {}", i), "", {}});
    load.load.setZero(3 * vertices);
    for (const std::int64_t vertex : forces[i].vertices) load.load.segment<3>(3 * vertex) += forces[i].force;
  }
  return loads;
}

/// The share of the work of each that the basis loses, about the rest shape.
void print_loads(const std::filesystem::path& bundle, const std::vector<NamedLoad>& loads, Eigen::Index vertices,
                 bool asked) {
  if (loads.empty()) return;
  if (vertices > kMostMeasured && !asked)
    return print("lost work", fmt::format("not measured of {} vertices; --load-capacity does it", vertices));
  const std::string reason = "load capacity is asked for";
  const LoadCapacity capacity(
      read_bundle(bundle, {.groups = {{"object", true, 0, reason}, {"modal", true, 0, reason}}}), 0);
  for (const NamedLoad& load : loads)
    print(("lost work, " + load.name).c_str(),
          fmt::format("{:.1f} %{} (the basis cannot answer it)", 100 * capacity.lost_share(load.load), load.remark));
}

}  // namespace

void print_lost_work(const RunSummary& summary, const LoadedWorld& loaded, const WorldConfig& config, bool asked) {
  bool any = false;
  for (std::size_t kind = 0; kind < loaded.kinds.size(); ++kind) {
    const BodiesConfig& bodies = config.bodies[kind];
    const Eigen::Index vertices = loaded.kinds[kind].loaded.summary.vertices;
    std::vector<NamedLoad> loads = scripted_loads(loaded.kinds[kind].loaded.forces, vertices);
    if (config.is_list)
      for (NamedLoad& load : loads) load.name = bodies.name + " " + load.name;
    if (const HardestContact& hardest = summary.hardest_contacts[kind]; hardest.body >= 0) {
      const std::string& name = loaded.bodies[static_cast<std::size_t>(hardest.body)].name;
      loads.push_back({name.empty() ? "contact" : name + " contact",
                       fmt::format(" at {:g} s, when it is {:.3g} N", hardest.time, hardest.force), hardest.load});
    }
    print_loads(bodies.scene.bundle, loads, vertices, asked);
    any = any || !loads.empty();
  }
  if (asked && !any) print("lost work", "none: the scene names no forces, and nothing touched");
}

}  // namespace exmat::runtime
