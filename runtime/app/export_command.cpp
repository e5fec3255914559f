#include <fmt/format.h>

#include "common/core/error.h"
#include "runtime/app/commands.h"
#include "runtime/app/print.h"
#include "runtime/output/point_cache.h"

namespace exmat::runtime {

void export_command(const ExportOptions& options) {
  if (options.output.extension() != ".pc2")
    throw InputError({options.output.string(), "", "an output with the extension .pc2",
                      options.output.has_extension() ? '"' + options.output.extension().string() + '"' : "none", ""});
  const PointCacheSummary summary =
      write_point_cache(options.trajectory, options.output, {options.mesh, options.frame_rate});
  print("point cache", options.output.string());
  print("points", fmt::format("{} of {}", summary.points, summary.dataset));
  print("samples", fmt::format("{}, {:g} frames apart", summary.samples, summary.sample_rate));
}

}  // namespace exmat::runtime
