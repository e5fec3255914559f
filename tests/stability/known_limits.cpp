#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/stability/suite_case.h"

namespace exmat::precompute {
namespace {

constexpr double kSixtieth = 1.0 / 60;

bool is_newmark(const StabilityCase& test) { return test.integrator == Integrator::kNewmark; }

/// Highest frequency of the body with its example force [rad/s].
double highest_frequency(const StabilityCase& test, const StudyBody& body) {
  if (test.examples.elastic) return body.highest_frequency * std::sqrt(1 + test.examples.stiffness);
  return std::max(body.highest_frequency, std::sqrt(test.examples.stiffness));
}

/// Weight per area of a bar that stands on its end, over Young's modulus.
double weight_over_modulus(const StabilityCase& test, const StudyBody& body) {
  return test.body.density * test.gravity * body.size / test.body.youngs_modulus;
}

/// Corotational, with more than that weight over its modulus.
bool is_crushed(const StabilityCase& test, const StudyBody& body, double weight) {
  return test.body.material == MaterialModel::kCorotational && weight_over_modulus(test, body) > weight;
}

}  // namespace

const std::vector<KnownLimit>& known_limits() {
  constexpr std::string_view kUnconverged =
      "status kStepIterationLimit or kStepStagnated; run: \"N of M steps did not reach the tolerance ...; a smaller "
      "time_step or more newton.max_iterations may help\"";
  static const std::vector<KnownLimit> limits{
      {"newmark-rings", Check::kRest,
       [](const StabilityCase& test, const StudyBody& body) {
         return is_newmark(test) && test.time_step * highest_frequency(test, body) > 1;
       },
       1,
       "newmark, time step above 1 over the highest frequency of the basis, times sqrt(1 + e) with an elastic example "
       "force, or sqrt(kappa)",
       "the amplification of modes that the time step does not resolve tends to -1: they ring on, whatever the damping",
       "none: the summary's kinetic energy does not fall; take bdf2"},
      {"newmark-spins", Check::kRest,
       [](const StabilityCase& test, const StudyBody&) { return is_newmark(test) && test.spin * test.time_step >= 1; },
       1e-5, "newmark, bodies that turn by 1 rad a step and more",
       "a turn of such a step is not resolved, and vibrations in the turning frame fade more slowly",
       "none: the summary's kinetic energy falls slowly; take bdf2"},
      {"newmark-overflows", Check::kFinite,
       [](const StabilityCase& test, const StudyBody& body) {
         return is_newmark(test) && is_crushed(test, body, 1) && test.body.poisson_ratio > 0.49;
       },
       1, "newmark, corotational, nu above 0.49, weight per area of a bar standing on end above E",
       "the energy of newmark-grows has overflowed", "status kStepNonFinite; run ends with it"},
      {"newmark-grows", Check::kBounded, [](const StabilityCase& test, const StudyBody&) { return is_newmark(test); },
       std::numeric_limits<double>::infinity(), "newmark, far from linear elasticity",
       "stable without condition for linear elasticity alone: in large motions that the time step does not resolve its "
       "energy grows, in the end until numbers overflow",
       kUnconverged},
      {"newmark-unconverged", Check::kSolved,
       [](const StabilityCase& test, const StudyBody&) { return is_newmark(test); }, 1,
       "newmark, far from linear elasticity",
       "accelerations of unresolved modes make each step's problem as hard as the first", kUnconverged},
      {"unresolved-turn", Check::kSolved,
       [](const StabilityCase& test, const StudyBody&) {
         return test.body.free && test.tip_load.norm() > 0 && test.time_step >= kSixtieth;
       },
       1, "a free body that a load beside its centre of mass turns by more than 0.3 rad a step",
       "the turn of such a step is not resolved; forces of the rotation have no potential, and the search ends early, "
       "where it ends at its start in every step from then on: the body turns on in the shape that it has",
       kUnconverged},
      {"bodies-turn", Check::kEnergy,
       [](const StabilityCase& test, const StudyBody& body) {
         return test.company == Company::kPair && test.velocity * test.time_step > 0.7 * body.size &&
                test.contact_stiffness >= 1e8;
       },
       1, "bodies that come nearer by their size in a step and meet stiffly off their centres",
       "they turn by several radians in a step, which is not resolved, while they are in each other: what the contacts "
       "hold comes back as more than it was",
       "none; a smaller time_step"},
      {"bodies-unsolved", Check::kSolved,
       [](const StabilityCase& test, const StudyBody&) {
         return test.company == Company::kPair && test.velocity >= 50 && test.time_step >= kSixtieth &&
                test.contact_stiffness >= 1e8;
       },
       0.1, "bodies that meet stiffly and off their centres at 50 m/s, in steps of 1/60 s and more",
       "they are as deep in each other as they are thick, and sides of vertices are as the step begins: neither from "
       "where they would go nor from where they are does a search end; such a step keeps momenta and gains no energy",
       "run: \"N solutions of bodies that touch did not reach the tolerance; a smaller time_step or contact stiffness "
       "may help\""},
      {"friction-couple", Check::kRest,
       [](const StabilityCase& test, const StudyBody&) {
         return test.company == Company::kPile && test.friction > 0 && test.contact_stiffness <= 1e4 &&
                test.time_step >= kSixtieth;
       },
       1e-4, "bodies that lie as deep in each other as they are thick, in steps of 1/60 s and more",
       "friction acts at the vertex and at the surface, which are apart by the depth, and each body gets half of that "
       "couple after the solution: the next step takes it back, and bodies that do not move keep an angular velocity "
       "that grows with friction, depth and time step",
       "none; a larger contact stiffness or a smaller time_step"},
      {"full-iterations", Check::kSolved,
       [](const StabilityCase& test, const StudyBody&) { return test.space != Space::kReduced; }, 1,
       "in all vertices, bodies that are thrown inside out, pressed flat or fall onto stiff ground",
       "at most 20 iterations bound the time of a step: where that is not enough it ends with a larger residual",
       kUnconverged},
      {"full-settles", Check::kRest,
       [](const StabilityCase& test, const StudyBody&) {
         return test.space != Space::kReduced && test.body.free && test.time_step > kSixtieth;
       },
       1e-3, "in all vertices, free bodies in steps of 1/30 s that lie on the ground, or are inside out",
       "a mesh has softer ways to move than the modes whose rate the run's length is of: what is left fades more "
       "slowly",
       "none: the summary's kinetic energy falls slowly"},
      {"auto-returns", Check::kEnergy,
       [](const StabilityCase& test, const StudyBody&) {
         return test.space == Space::kAuto && test.body.material == MaterialModel::kCorotational &&
                test.tip_load.norm() > 0;
       },
       0.5, "corotational, space auto, loads that turn elements inside out",
       "the modes do not hold the folds that all vertices have when the load ends: their nearest pose has another "
       "energy",
       "none; space full"},
      {"corotational-kink", Check::kSolved,
       [](const StabilityCase& test, const StudyBody&) {
         return test.body.material == MaterialModel::kCorotational && test.tip_load.norm() > 0;
       },
       0.3, "corotational, loads that turn elements inside out",
       "the energy has a kink where two singular values of F add up to 0, and minima lie on it, in each step that the "
       "load lasts: their sum is below 1e-7 of the largest there",
       kUnconverged},
      {"corotational-weight", Check::kSolved,
       [](const StabilityCase& test, const StudyBody& body) { return is_crushed(test, body, 100); }, 1.2,
       "corotational, weight per area of a bar standing on end above 100 E",
       "the weight turns elements inside out; the energy has a kink where two singular values of F add up to 0, and "
       "minima lie on it",
       kUnconverged},
      {"corotational-heavy", Check::kSolved,
       [](const StabilityCase& test, const StudyBody& body) { return is_crushed(test, body, 5); }, 0.02,
       "corotational, weight per area of a bar standing on end above 5 E", "that of corotational-weight, in few steps",
       kUnconverged},
      {"corotational-gain", Check::kEnergy,
       [](const StabilityCase& test, const StudyBody& body) {
         return is_crushed(test, body, 100) && test.time_step >= kSixtieth;
       },
       0.25, "corotational, weight per area of a bar standing on end above 100 E, steps of 1/60 s and more",
       "most steps end on the kink, above the minimum whose energy the method bounds", kUnconverged},
      {"stretched-volume", Check::kSolved,
       [](const StabilityCase& test, const StudyBody& body) {
         return test.body.material == MaterialModel::kStableNeoHookean && weight_over_modulus(test, body) > 500;
       },
       0.6, "stable neo-Hookean, weight per area of a bar standing on end above 500 E",
       "elements are stretched a hundred times in one direction alone: their volume is a difference of large products, "
       "and its rounding is above the tolerance; steps end within 2e-5 of their forces",
       kUnconverged}};
  return limits;
}

}  // namespace exmat::precompute
