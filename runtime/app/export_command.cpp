#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <numbers>
#include <string_view>
#include <utility>

#include "common/bundle/bundle.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/mesh/geometry.h"
#include "common/surface_io/glb.h"
#include "runtime/app/commands.h"
#include "runtime/app/print.h"
#include "runtime/export/drawn_skin.h"
#include "runtime/export/point_cache.h"
#include "runtime/export/surface_look.h"
#include "runtime/export/surface_motion.h"
#include "runtime/export/usd_file.h"

namespace exmat::runtime {
namespace {

constexpr double kMegabyte = 1e6;
constexpr std::string_view kGltfGenerator = "\"generator\":\"exmat-runtime ";  // as write_gltf() writes it
constexpr double kMotionTolerance = 1e-6;  // RMS, of the size: what components leave out of a motion
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
      write_point_cache(options.trajectory, options.output, {options.mesh, options.frame_rate, options.body});
  print("point cache", options.output.string());
  print("points", fmt::format("{} of {}", summary.points, summary.dataset));
  print("samples", fmt::format("{}, {:g} frames apart", summary.samples, summary.sample_rate));
  print_origin(summary.origin, "which the points are measured from: the format has no place for it");
}

void export_usd(const ExportOptions& options) {
  require_trajectory(options);
  UsdOptions usd{.mesh = options.mesh, .up = options.up, .body = options.body};
  if (options.frame_rate) usd.frame_rate = *options.frame_rate;
  const UsdSummary summary = write_usd(options.trajectory, options.output, usd);
  print("scene description", options.output.string());
  if (summary.bodies > 1) print("bodies", fmt::format("{}", summary.bodies));
  print("points", fmt::format("{} of {}", summary.points, summary.dataset));
  print("samples", fmt::format("{}, {:g} time codes a second", summary.samples, usd.frame_rate));
  print_origin(summary.origin, "the translation of each Mesh");
  print("size", fmt::format("{:.3g} MB", static_cast<double>(summary.bytes) / kMegabyte));
}

VertexNormals normals_of(const DrawnSurface& surface) {
  return {surface.vertices, surface.triangles, surface.look ? surface.look->normals : VertexArray()};
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
  const bool cut = targets.displacements.cols() < surface.mode_count();
  const std::string kind = cut ? "principal components" : fmt::format("{}s", surface.mode_name);
  print("surface", fmt::format("{} vertices, {} triangles of {}", surface.vertex_count(), surface.triangles.rows(),
                               surface.source));
  print("morph targets", fmt::format("{}, {}", targets.displacements.cols(), kind));
  if (surface.skin)
    print("skin", fmt::format("{} bones as its file has them, which move by themselves", surface.skin->names.size()));
  if (!surface.look) return;
  const auto count = [&](const char* name) {
    return surface.look->document.value(name, nlohmann::json::array()).size();
  };
  print("look", fmt::format("{} materials and {} images, as its file has them", count("materials"), count("images")));
}

/// `beside`: what the motion has beside the modes.
void print_error(MorphError error, const MorphError& beside, const DrawnSurface& surface) {
  error.largest += beside.largest;
  error.rms = std::hypot(error.rms, beside.rms);
  const double size = bounding_box_diagonal(surface.vertices);
  print("error", fmt::format("largest {:.2g} m ({:.2g} of the size), RMS {:.2g} m ({:.2g})", error.largest,
                             error.largest / size, error.rms, error.rms / size));
  print("error of normals", fmt::format("RMS {:.2g} degrees", error.normal_rms / kDegree));
}

/// Contents of a .glb: bodies, and what those of one bundle share.
struct Drawing {
  std::vector<DrawnKind> kinds;
  std::vector<RowMatrix> reduced;  ///< one for each kind: q of all frames of its bodies, one body after the other
  std::vector<MorphError> beside;  ///< one for each kind: what their motion has beside the modes
  std::vector<DrawnBody> bodies;
  std::vector<SurfaceMotion> motions;  ///< one for each body; empty where its modes say all
};

DrawnKind read_kind(const ExportOptions& options, const std::filesystem::path& bundle) {
  return {read_drawn_surface(bundle, options.mesh), {}, {}};
}

/// Its body as it is selected.
void add_body(const ExportOptions& options, const std::string& name, TrajectoryReader& trajectory,
              std::map<std::string, std::size_t>& kinds, Drawing& drawing) {
  BodyMotion motion = read_body_motion(trajectory);
  const auto [known, is_new] =
      kinds.try_emplace(trajectory.text("bundle") + '\n' + trajectory.text("input_sha256"), drawing.kinds.size());
  if (is_new) drawing.kinds.push_back(read_kind(options, bundle_of(options, trajectory)));
  DrawnSurface& surface = drawing.kinds[known->second].surface;
  if (motion.reduced.cols() != surface.mode_count())
    trajectory.refuse("/reduced", fmt::format("{} columns", surface.mode_count()),
                      fmt::format("{}", motion.reduced.cols()));
  if (surface.skin && motion.bones.cols() != 7 * std::ssize(surface.skin->names)) surface.skin.reset();
  drawing.motions.push_back(motion.full ? read_surface_motion(trajectory, surface, motion) : SurfaceMotion());
  drawing.bodies.push_back({name.empty() ? surface.name : name, known->second, {}, std::move(motion)});
}

/// Rows of all frames of a kind's bodies, one body after the other: of body i those of rows_of(i).
template <typename RowsOf>
RowMatrix stacked(const Drawing& drawing, std::size_t kind, Eigen::Index columns, const RowsOf& rows_of) {
  Eigen::Index rows = 0;
  for (const DrawnBody& body : drawing.bodies)
    if (body.motion && body.kind == kind) rows += body.motion->frames();
  RowMatrix all(rows, columns);
  rows = 0;
  for (std::size_t i = 0; i < drawing.bodies.size(); ++i) {
    const DrawnBody& body = drawing.bodies[i];
    if (!body.motion || body.kind != kind) continue;
    all.middleRows(rows, body.motion->frames()) = rows_of(i);
    rows += body.motion->frames();
  }
  return all;
}

/// q of all frames of a kind's bodies. Where one of them was in full space, the principal components of their motions
/// take the place of the modes.
RowMatrix take_motions(Drawing& drawing, std::size_t kind, MorphError& beside) {
  DrawnSurface& surface = drawing.kinds[kind].surface;
  const auto motion_of = [&](std::size_t body) -> const BodyMotion& { return *drawing.bodies[body].motion; };
  bool full = false;
  for (std::size_t i = 0; i < drawing.bodies.size(); ++i) {
    if (!drawing.bodies[i].motion || drawing.bodies[i].kind != kind) continue;
    full = full || motion_of(i).full;
    beside.largest = std::max(beside.largest, drawing.motions[i].missed);
  }
  if (!full)
    return stacked(drawing, kind, surface.mode_count(),
                   [&](std::size_t i) -> const RowMatrix& { return motion_of(i).reduced; });
  const RowMatrix all = stacked(drawing, kind, surface.modes.rows(), [&](std::size_t i) -> RowMatrix {
    if (motion_of(i).full) return std::exchange(drawing.motions[i].displacements, {});
    return motion_of(i).reduced * surface.modes.transpose();
  });
  MotionComponents components = components_of(all, kMotionTolerance * bounding_box_diagonal(surface.vertices));
  beside.largest += components.largest;
  beside.rms = components.rms;
  surface.modes = std::move(components.modes);
  surface.mode_name = "component";
  return std::move(components.reduced);
}

/// Morph targets of each kind for the motions of all its bodies, and the weights of each body.
void find_targets(const ExportOptions& options, Drawing& drawing) {
  std::vector<Eigen::Index> used(drawing.kinds.size(), 0);
  for (std::size_t i = 0; i < drawing.kinds.size(); ++i) {
    DrawnKind& kind = drawing.kinds[i];
    drawing.reduced.push_back(take_motions(drawing, i, drawing.beside.emplace_back()));
    const Eigen::Index modes = kind.surface.mode_count();
    if (options.targets && *options.targets > modes)
      refuse_option(options, fmt::format("at most {} targets, as there are {}s", modes, kind.surface.mode_name),
                    fmt::format("{}", *options.targets));
    const VertexNormals normals = normals_of(kind.surface);
    kind.normals = normals.at(kind.surface.vertices);
    kind.targets = drawing.bodies.front().motion
                       ? targets_of_motion(kind.surface, normals, drawing.reduced[i], options.targets)
                       : modes_as_targets(kind.surface, normals);
  }
  for (DrawnBody& body : drawing.bodies) {
    if (!body.motion) continue;
    body.weights = drawing.kinds[body.kind].targets.weights.middleRows(used[body.kind], body.motion->frames());
    used[body.kind] += body.motion->frames();
  }
}

Drawing read_drawing(const ExportOptions& options) {
  Drawing drawing;
  if (options.trajectory.empty()) {
    if (!options.bundle) refuse_option(options, "a trajectory, or a bundle by --bundle", "neither");
    if (options.body) refuse_option(options, "a trajectory, a body of which --body names", "none");
    if (options.targets) refuse_option(options, "a trajectory, whose components --targets takes", "none");
    drawing.kinds.push_back(read_kind(options, *options.bundle));
    drawing.bodies.push_back({drawing.kinds.front().surface.name, 0, {}, {}});
    return drawing;
  }
  TrajectoryReader trajectory(options.trajectory);
  std::map<std::string, std::size_t> kinds;
  std::vector<std::string> names = trajectory.bodies();
  if (options.body) names = {*options.body};
  for (const std::string& name : names) {
    trajectory.select(name);
    add_body(options, name, trajectory, kinds, drawing);
  }
  if (names.empty()) add_body(options, "", trajectory, kinds, drawing);
  return drawing;
}

void export_gltf(const ExportOptions& options) {
  if (options.frame_rate) refuse_option(options, "--frame-rate with an output .pc2 or .usda", ".glb");
  Drawing drawing = read_drawing(options);
  find_targets(options, drawing);
  const std::int64_t bytes = write_gltf(options.output, drawing.kinds, drawing.bodies, options.up);
  print("glTF", options.output.string());
  print_origin(origin_of(drawing.kinds, drawing.bodies), "the translation of the node \"origin\"");
  if (drawing.bodies.size() > 1)
    print("bodies", fmt::format("{} of {} meshes", drawing.bodies.size(), drawing.kinds.size()));
  std::int64_t cached = 0;
  for (const DrawnBody& body : drawing.bodies)
    if (body.motion) cached += 12 * drawing.kinds[body.kind].surface.vertex_count() * body.motion->frames();
  for (std::size_t i = 0; i < drawing.kinds.size(); ++i) {
    const DrawnKind& kind = drawing.kinds[i];
    print_targets(kind.targets, kind.surface);
    if (cached == 0) continue;
    const VertexNormals normals = normals_of(kind.surface);
    print_error(error_of(kind.targets, kind.surface, normals, drawing.reduced[i]), drawing.beside[i], kind.surface);
  }
  const auto megabytes = static_cast<double>(bytes) / kMegabyte;
  if (!drawing.bodies.front().motion) {
    print("weights", "q [kg^(1/2) m], as exmat_body_reduced() gives it");
    print("size", fmt::format("{:.3g} MB", megabytes));
    return;
  }
  const BodyMotion& motion = *drawing.bodies.front().motion;
  print("frames",
        fmt::format("{}, {:g} to {:g} s", motion.frames(), motion.times[0], motion.times[motion.frames() - 1]));
  print("size",
        fmt::format("{:.3g} MB; as a point cache {:.3g} MB", megabytes, static_cast<double>(cached) / kMegabyte));
}

/// Refuses to replace a .glb of another program: it may be what the body was made of. A damaged one passes.
void require_own_gltf(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored) || std::filesystem::file_size(file, ignored) == 0) return;
  try {
    const OwnOutputRead own;
    const std::string bytes = read_whole_file(file, "a .glb");
    if (parts_of_glb(file.string(), bytes).json.find(kGltfGenerator) != std::string_view::npos) return;
  } catch (const InputError&) {
    return;
  }
  refuse_to_replace(file, "-o", "a .glb of exmat-runtime", "that of another program");
}

}  // namespace

void export_command(const ExportOptions& options) {
  const std::string extension = lower_extension(options.output);
  claim_output(options.output, "-o");
  const auto begin = [&](const char* kind, std::string_view beginning) {
    if (!options.trajectory.empty()) check_input(options.trajectory, "an HDF5 file");
    require_kind(options.output, "-o", kind, beginning);
  };
  if (extension == ".pc2") {
    begin("a point cache", "POINTCACHE2");
    return export_point_cache(options);
  }
  if (extension == ".usda") {
    begin("a USD file", "#usda 1.0\n(\n    defaultPrim");
    return export_usd(options);
  }
  if (extension == ".glb") {
    begin("a .glb", "glTF");
    require_own_gltf(options.output);
    return export_gltf(options);
  }
  throw InputError({options.output.string(), "", "an output with the extension .glb, .usda or .pc2",
                    extension.empty() ? "none" : '"' + extension + '"',
                    extension == ".abc" ? "Alembic is not written: programs that read it read .usda or .pc2" : ""});
}

}  // namespace exmat::runtime
