#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "common/model/choices.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::precompute {

/// Questions about a run. docs/stability.md, "What is asked".
enum class Check { kFinite, kBounded, kSolved, kRest, kEnergy, kMomentum, kReturn };
inline constexpr std::array<std::string_view, 7> kCheckNames{"finite", "bounded",  "solved", "rest",
                                                             "energy", "momentum", "return"};

enum class Verdict {
  kPass,
  kFail,
  kKnownLimit,     ///< fails for a reason that the caller knows
  kNotApplicable,  ///< the check has no meaning for the run
};

/// One check of a run: `value` against `limit`.
struct CheckResult {
  Verdict verdict = Verdict::kNotApplicable;
  double value = 0, limit = 0;
};
using CheckResults = std::array<CheckResult, kCheckNames.size()>;

/// The gravest of the checks.
Verdict gravest(const CheckResults& checks);

inline constexpr double kRestKinetic = 1e-6;  ///< limit of Check::kRest, of the largest kinetic energy

/// Facts of one step, of all bodies together.
struct StepFacts {
  int non_finite = 0;       ///< bodies whose state is not finite
  int unsolved = 0;         ///< status bits that say that the search for the minimum ended early
  double displacement = 0;  ///< the largest of a vertex, without the rigid motion of a free body, over the body's size
  double kinetic = 0;       ///< kinetic energy that is to come to rest [J]
  runtime::Energies energies{};
  double work = 0;            ///< work of loads since the start [J]
  double momentum_error = 0;  ///< relative to the start's momentum
};

/// The extremes of a run so far.
struct RunRecord {
  double start_energy = 0, start_potential = 0;  ///< to be set at the start [J]
  double exchanged = 0;                          ///< the largest energy that changed its form [J]
  double kinetic = 0, peak_kinetic = 0;          ///< [J]
  double gain = 0;                               ///< the largest of energy, less the work of loads [J]
  double displacement = 0, momentum_error = 0;   ///< as StepFacts
  std::int64_t steps = 0, unsolved = 0, non_finite = 0;

  /// False where a state is not finite: the run ends.
  bool add(const StepFacts& step);
  bool is_at_rest() const { return kinetic <= kRestKinetic * peak_kinetic; }
};

/// The largest displacement that is plausible, over the body's size. `linear`: what start and loads can do in linear
/// elasticity, `start`: the start's displacement, both over the size.
double displacement_bound(double linear, double start);

/// Limits of a run, and which checks apply.
struct Expectation {
  double displacement = 0;  ///< limit of Check::kBounded
  bool rest = false, energy = false, momentum = false;
  Integrator integrator = Integrator::kBdf2;
};

/// All checks of a run but Check::kReturn.
CheckResults judge(const RunRecord& run, const Expectation& expected);

/// One check: passes where `value` is at most `limit`.
CheckResult judge(double value, double limit);

}  // namespace exmat::precompute
