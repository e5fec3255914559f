#include "precompute/study/stability/checks.h"

#include <algorithm>
#include <cmath>

namespace exmat::precompute {
namespace {

constexpr double kSizes = 3, kLinear = 2;               // bound: 3 L + 2 u_lin
constexpr double kUnconverged = 0.01;                   // of the steps
constexpr double kEulerGain = 1e-9, kOtherGain = 1e-6;  // of the energies that a run exchanges
constexpr double kMomentumDrift = 1e-9;

}  // namespace

Verdict gravest(const CheckResults& checks) {
  Verdict worst = Verdict::kPass;
  for (const CheckResult& check : checks) {
    if (check.verdict == Verdict::kFail) return Verdict::kFail;
    if (check.verdict == Verdict::kKnownLimit) worst = Verdict::kKnownLimit;
  }
  return worst;
}

bool RunRecord::add(const StepFacts& step) {
  non_finite += step.non_finite;
  if (step.non_finite > 0) return false;
  ++steps;
  unsolved += step.unsolved;
  displacement = std::max(displacement, step.displacement);
  kinetic = step.kinetic;
  peak_kinetic = std::max(peak_kinetic, step.kinetic);
  gain = std::max(gain, step.energies.total() - step.work - start_energy);
  exchanged = std::max({exchanged, step.energies.kinetic + step.energies.elastic,
                        std::abs(step.energies.potential - start_potential), std::abs(step.work)});
  momentum_error = std::max(momentum_error, step.momentum_error);
  return true;
}

double displacement_bound(double linear, double start) { return kSizes + kLinear * linear + start; }

CheckResult judge(double value, double limit) {
  return {value <= limit ? Verdict::kPass : Verdict::kFail, value, limit};
}

CheckResults judge(const RunRecord& run, const Expectation& expected) {
  CheckResults results;
  const auto at = [&](Check check) -> CheckResult& { return results[static_cast<std::size_t>(check)]; };
  at(Check::kFinite) = judge(static_cast<double>(run.non_finite), 0);
  if (run.non_finite > 0) return results;
  at(Check::kBounded) = judge(run.displacement, expected.displacement);
  at(Check::kSolved) = judge(static_cast<double>(run.unsolved) / static_cast<double>(run.steps), kUnconverged);
  if (expected.rest) at(Check::kRest) = judge(run.peak_kinetic > 0 ? run.kinetic / run.peak_kinetic : 0, kRestKinetic);
  if (expected.energy)
    at(Check::kEnergy) = judge(run.exchanged > 0 ? run.gain / run.exchanged : 0,
                               expected.integrator == Integrator::kBackwardEuler ? kEulerGain : kOtherGain);
  if (expected.momentum) at(Check::kMomentum) = judge(run.momentum_error, kMomentumDrift);
  return results;
}

}  // namespace exmat::precompute
