#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "runtime/export/gltf_file.h"
#include "runtime/scene/scene_run.h"

namespace exmat::runtime {

struct RunCommandOptions {
  std::filesystem::path scene;
  std::optional<std::filesystem::path> trajectory;  ///< instead of the scene's
  std::optional<std::int64_t> steps;                ///< instead of the scene's
  RunOptions run;
  bool load_capacity = false;  ///< print what the basis loses of forces and contacts of any mesh
};

struct BenchCommandOptions {
  std::filesystem::path scene;
  std::optional<std::int64_t> steps;  ///< steps of one round, instead of the scene's
  bool json = false;
};

struct PackOptions {
  std::filesystem::path bundle, output;
  std::optional<std::filesystem::path> scene;  ///< the pack holds the groups that it needs, no more
};

struct ExportOptions {
  std::filesystem::path trajectory;  ///< empty: a bundle without motion
  std::filesystem::path output;
  std::optional<std::filesystem::path> bundle;  ///< instead of the one that the trajectory names
  std::optional<std::string> body;              ///< alone, of a trajectory of several
  bool mesh = false;                            ///< the tet mesh, not the render mesh
  std::optional<double> frame_rate;             ///< [1/s]
  std::optional<std::int64_t> targets;          ///< morph targets, >= 1
  UpAxis up = UpAxis::kY;
};

// The commands of exmat-runtime: results on stdout, logs and progress on stderr; failures are InputError or WorkError.
void run_command(const RunCommandOptions& options);
void bench_command(const BenchCommandOptions& options);
void export_command(const ExportOptions& options);
void pack_command(const PackOptions& options);
void info_command(const std::filesystem::path& bundle);
void validate_command(const std::filesystem::path& bundle);

}  // namespace exmat::runtime
