#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace exmat {

/// A constant world-space force on each of the named vertices while start <= t < end.
struct VertexForceConfig {
  std::vector<std::int64_t> vertices;                    ///< 0-based ids
  Eigen::Vector3d force = Eigen::Vector3d::Zero();       ///< on each vertex [N]
  double start = 0;                                      ///< [s]
  double end = std::numeric_limits<double>::infinity();  ///< [s]
};

struct ExampleForceConfig {
  double stiffness = 0;  ///< kappa >= 0 [1/s^2]
  double damping = 0;    ///< c_kappa >= 0 [1/s]
  double bias = 1;       ///< in [0, 1]
  std::string target = "solve";
  std::string force = "linear";
  std::string energy_reference = "example";  ///< or "rest"
};

struct NewtonConfig {
  int max_iterations = 20;
  double tolerance = 1e-6;  ///< relative to |f_ext| + |f_int| + |inertia|
};

/// SCENE.json after validation, paths resolved against its folder. interfaces.md, "SCENE.json".
struct SceneConfig {
  std::filesystem::path file;
  std::filesystem::path bundle;
  double time_step = 0.001;  ///< [s]
  std::int64_t steps = 1000;
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< [m/s^2]
  std::string integrator = "bdf2";                    ///< "bdf2", "backward_euler" or "newmark"
  double mass_damping = 0;                            ///< alpha [1/s]
  double stiffness_damping = 0;                       ///< beta [s]
  NewtonConfig newton;
  std::optional<ExampleForceConfig> examples;
  std::vector<VertexForceConfig> forces;
  std::optional<std::filesystem::path> trajectory;
  std::int64_t every = 10;
};

}  // namespace exmat
