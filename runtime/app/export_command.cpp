#include <algorithm>
#include <fmt/format.h>
#include <numbers>

#include "common/bundle/bundle.h"
#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "runtime/app/commands.h"
#include "runtime/app/print.h"
#include "runtime/export/point_cache.h"
#include "runtime/export/usd_file.h"

namespace exmat::runtime {
namespace {

constexpr double kMegabyte = 1e6;
constexpr double kDegree = std::numbers::pi / 180;

[[noreturn]] void refuse_option(const ExportOptions& options, const std::string& expected, const std::string& found) {
  throw InputError({options.output.string(), "", expected, found, ""});
}

/// A trajectory, and no options of glTF.
void require_trajectory(const ExportOptions& options) {
  const std::string extension = options.output.extension().string();
  if (options.trajectory.empty()) refuse_option(options, "a trajectory to write as " + extension, "none");
  if (options.bundle) refuse_option(options, "--bundle with an output .glb", extension);
  if (options.targets) refuse_option(options, "--targets with an output .glb", extension);
}

void export_point_cache(const ExportOptions& options) {
  require_trajectory(options);
  const PointCacheSummary summary =
      write_point_cache(options.trajectory, options.output, {options.mesh, options.frame_rate});
  print("point cache", options.output.string());
  print("points", fmt::format("{} of {}", summary.points, summary.dataset));
  print("samples", fmt::format("{}, {:g} frames apart", summary.samples, summary.sample_rate));
}

void export_usd(const ExportOptions& options) {
  require_trajectory(options);
  UsdOptions usd{.mesh = options.mesh, .up = options.up};
  if (options.frame_rate) usd.frame_rate = *options.frame_rate;
  const UsdSummary summary = write_usd(options.trajectory, options.output, usd);
  print("scene description", options.output.string());
  print("points", fmt::format("{} of {}", summary.points, summary.dataset));
  print("samples", fmt::format("{}, {:g} time codes a second", summary.samples, usd.frame_rate));
  print("size", fmt::format("{:.3g} MB", static_cast<double>(summary.bytes) / kMegabyte));
}

/// The bundle that a trajectory is of: as the user says, or as it says itself.
std::filesystem::path bundle_of(const ExportOptions& options, const TrajectoryReader& trajectory) {
  const std::string own = trajectory.text("bundle");
  std::filesystem::path bundle = options.bundle.value_or(options.trajectory.parent_path() / own);
  if (!options.bundle && (own.empty() || !std::filesystem::exists(bundle)))
    trajectory.refuse("/@bundle", "the bundle that was stepped, whose modes become morph targets",
                      own.empty() ? "no name" : fmt::format("no file {}", bundle.string()),
                      "name it by --bundle BUNDLE.h5");
  const std::string digest = summarise_bundle(bundle).input_sha256;
  if (digest != trajectory.text("input_sha256"))
    throw InputError({bundle.string(), "/@input_sha256",
                      fmt::format("that of {}, {:.12}", trajectory.name(), trajectory.text("input_sha256")),
                      fmt::format("{:.12}", digest), "name the bundle that was stepped by --bundle, or run it again"});
  return bundle;
}

void print_targets(const MorphTargets& targets, const DrawnSurface& surface) {
  const char* const kind = targets.displacements.cols() < surface.mode_count() ? "principal components" : "modes";
  print("surface", fmt::format("{} vertices, {} triangles of {}", surface.vertex_count(), surface.triangles.rows(),
                               surface.source));
  print("morph targets", fmt::format("{}, {}", targets.displacements.cols(), kind));
}

void print_error(const MorphError& error, const DrawnSurface& surface) {
  const double size = bounding_box_diagonal(surface.vertices);
  print("error", fmt::format("largest {:.2g} m ({:.2g} of the size), RMS {:.2g} m ({:.2g})", error.largest,
                             error.largest / size, error.rms, error.rms / size));
  print("error of normals", fmt::format("RMS {:.2g} degrees", error.normal_rms / kDegree));
}

void export_gltf(const ExportOptions& options) {
  if (options.frame_rate) refuse_option(options, "--frame-rate with an output .pc2 or .usda", ".glb");
  std::optional<BodyMotion> motion;
  std::filesystem::path bundle;
  if (options.trajectory.empty()) {
    if (!options.bundle) refuse_option(options, "a trajectory, or a bundle by --bundle", "neither");
    if (options.targets) refuse_option(options, "a trajectory, whose components --targets takes", "none");
    bundle = *options.bundle;
  } else {
    TrajectoryReader trajectory(options.trajectory);
    motion = read_body_motion(trajectory);
    bundle = bundle_of(options, trajectory);
  }
  const DrawnSurface surface = read_drawn_surface(bundle, options.mesh);
  if (motion && motion->reduced.cols() != surface.mode_count())
    throw InputError({options.trajectory.string(), "/reduced", fmt::format("{} columns", surface.mode_count()),
                      fmt::format("{}", motion->reduced.cols()), ""});
  if (options.targets && *options.targets > surface.mode_count())
    refuse_option(options, fmt::format("at most {} targets, as the bundle has modes", surface.mode_count()),
                  fmt::format("{}", *options.targets));
  const VertexNormals normals(surface.vertices, surface.triangles);
  const MorphTargets targets = motion ? targets_of_motion(surface, normals, motion->reduced, options.targets)
                                      : modes_as_targets(surface, normals);
  const std::int64_t bytes =
      write_gltf(options.output, surface, normals.at(surface.vertices), targets, motion, options.up);
  print("glTF", options.output.string());
  print_targets(targets, surface);
  const auto megabytes = static_cast<double>(bytes) / kMegabyte;
  if (!motion) {
    print("weights", "q [kg^(1/2) m], as exmat_body_reduced() gives it");
    print("size", fmt::format("{:.3g} MB", megabytes));
    return;
  }
  const double cache = static_cast<double>(12 * surface.vertex_count() * motion->frames()) / kMegabyte;
  print("frames",
        fmt::format("{}, {:g} to {:g} s", motion->frames(), motion->times[0], motion->times[motion->frames() - 1]));
  print_error(error_of(targets, surface, normals, motion->reduced), surface);
  print("size", fmt::format("{:.3g} MB; as a point cache {:.3g} MB", megabytes, cache));
}

}  // namespace

void export_command(const ExportOptions& options) {
  const std::string extension = options.output.extension().string();
  if (extension == ".pc2") return export_point_cache(options);
  if (extension == ".usda") return export_usd(options);
  if (extension == ".glb") return export_gltf(options);
  throw InputError({options.output.string(), "", "an output with the extension .glb, .usda or .pc2",
                    extension.empty() ? "none" : '"' + extension + '"',
                    extension == ".abc" ? "Alembic is not written: programs that read it read .usda or .pc2" : ""});
}

}  // namespace exmat::runtime
