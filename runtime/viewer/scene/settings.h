#pragma once

#include <array>
#include <string>
#include <vector>

namespace exmat::viewer {

/// An example force, of the whole body or of a region.
struct ForceSettings {
  std::string region;  ///< empty: the whole body
  bool on = true;
  double stiffness = 0;  ///< kappa [1/s^2]; of an elastic force its factor
  double damping = 0;    ///< c_kappa [1/s]
  double bias = 1;
  std::string target = "auto";
  std::string law = "linear";
  bool given = false;           ///< weights are given
  bool keyed = false;           ///< by the scene's keys: `weights` are those of the first
  std::vector<double> weights;  ///< K; those that are or would be given

  bool operator==(const ForceSettings&) const = default;
};

/// Settings that may change while a scene runs.
struct Settings {
  double time_step = 0.001;  ///< [s]
  std::array<double, 3> gravity{};
  bool own_gravity = false;                        ///< gravity is that of these bodies alone, not of the scene
  double mass_damping = 0, stiffness_damping = 0;  ///< alpha [1/s], beta [s]
  std::string integrator = "bdf2";
  std::string internal_force = "auto";
  std::string space = "reduced";
  std::vector<ForceSettings> forces;

  bool operator==(const Settings&) const = default;
};

/// True if a body can go on under `b` as it went under `a`, without a new model.
bool same_model(const Settings& a, const Settings& b);

}  // namespace exmat::viewer
