#include "precompute/polynomial/internal_force.h"

#include <algorithm>
#include <fmt/format.h>
#include <vector>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/timer.h"
#include "precompute/polynomial/reduced_polynomial.h"
#include "runtime/sim/elasticity/reduced_elasticity.h"
#include "runtime/sim/elasticity/reduced_polynomial.h"

namespace exmat::precompute {
namespace {

constexpr MaterialModel kMaterial = MaterialModel::kStVenantKirchhoff;
// Beyond these `auto` makes no polynomial: minutes of work, or slower than cubature as far as can be told.
constexpr Eigen::Index kMostAutoModes = 64;
constexpr double kMostAutoFlops = 200e9;
constexpr double kHopeless = 3;

constexpr double kClearlyFaster = 0.8, kClearlySlower = 1 / kClearlyFaster;

// A step: forces beside the one with the stiffness.
constexpr int kForces = 2;
constexpr std::size_t kRounds = 41, kFewestRounds = 9;
constexpr int kStepsPerRound = 4;  // so that each finds its data in the caches as in a run
constexpr double kMostSeconds = 0.05;

// Rates of one thread, with AVX-512: the polynomial is bound by its memory, cubature by its arithmetic. This predicts
// the ratio to 20 percent from r = 20 to 30, and flatters the polynomial beyond.
constexpr double kBytesPerSecond = 30e9, kFlopsPerSecond = 20e9;

// Evaluates one body again and again.
template <typename Elasticity>
class Steps {
 public:
  explicit Steps(const Elasticity& elasticity)
      : elasticity_(elasticity),
        workspace_(elasticity.make_workspace()),
        q_(Eigen::VectorXd::Ones(elasticity.modes())),
        force_(elasticity.modes()),
        stiffness_(elasticity.modes(), elasticity.modes()) {}

  // Seconds of one step, the mean of a round.
  double round() {
    const Timer timer;
    for (int step = 0; step < kStepsPerRound; ++step) {
      elasticity_.force_and_stiffness(q_, workspace_, force_, stiffness_);
      for (int i = 0; i < kForces; ++i) elasticity_.force(q_, workspace_, force_);
    }
    return timer.seconds() / kStepsPerRound;
  }

 private:
  const Elasticity& elasticity_;
  typename Elasticity::Workspace workspace_;
  Eigen::VectorXd q_, force_;
  Eigen::MatrixXd stiffness_;
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Polynomial to cubature.
double measured_ratio(const runtime::ReducedPolynomial& polynomial, const runtime::ReducedElasticity& cubature) {
  Steps polynomial_steps(polynomial);
  Steps cubature_steps(cubature);
  std::vector<double> polynomial_times, cubature_times;
  const Timer timer;
  for (std::size_t i = 0; i < kRounds && (i < kFewestRounds || timer.seconds() < kMostSeconds); ++i) {
    polynomial_times.push_back(polynomial_steps.round());
    cubature_times.push_back(cubature_steps.round());
  }
  const double first = median(polynomial_times), second = median(cubature_times);
  log::info(fmt::format("internal force of a step: polynomial {:.1f} us, {} cubature elements {:.1f} us", 1e6 * first,
                        cubature.elements(), 1e6 * second));
  return first / second;
}

// Each evaluation reads the polynomial once.
double modelled_ratio(const runtime::ReducedElasticity& cubature) {
  const auto& potential = cubature.potential();
  const double bytes = (1 + kForces) * static_cast<double>(polynomial_bytes(cubature.modes()));
  const double flops = potential.stiffness_flops() + (1 + kForces) * potential.force_flops();
  return bytes / kBytesPerSecond / (flops / kFlopsPerSecond);
}

runtime::ReducedElasticity elasticity_of(const ReducedModel& model) {
  return runtime::ReducedElasticity(model.object->materials.model, *model.cubature);
}

bool is_polynomial_faster(const ReducedModel& model) {
  const runtime::ReducedElasticity cubature = elasticity_of(model);
  return takes_polynomial(measured_ratio(runtime::ReducedPolynomial(*model.polynomial), cubature),
                          modelled_ratio(cubature));
}

bool misses(const CubatureData& cubature, std::optional<double> tolerance) {
  return tolerance && cubature.heldout_error > *tolerance;
}

std::string slower_text(const CubatureData& cubature) {
  return fmt::format("{} cubature elements are as fast as the polynomial or faster at r = {}", cubature.elements.size(),
                     cubature.gradient.cols());
}

}  // namespace

void require_polynomial(MaterialModel material, Eigen::Index modes) {
  if (material != kMaterial)
    throw InputError({"", "/internal_force", "\"cubature\" or \"auto\"",
                      fmt::format("\"polynomial\" for {}", name_of(material)),
                      fmt::format("only {} has one", name_of(kMaterial))});
  require_polynomial_modes(modes);
}

std::string reason_against_polynomial(const ReducedModel& model, std::optional<double> tolerance) {
  const Eigen::Index modes = model.cubature->gradient.cols();
  if (model.object->materials.model != kMaterial) return "the material has no polynomial";
  if (modes > kMostAutoModes) return fmt::format("a polynomial of more than {} modes is slow", kMostAutoModes);
  if (polynomial_flops(modes, model.object->mesh.tet_count()) > kMostAutoFlops)
    return "the polynomial takes too long to precompute";
  if (!misses(*model.cubature, tolerance) && modelled_ratio(elasticity_of(model)) > kHopeless)
    return slower_text(*model.cubature);
  return "";
}

bool takes_polynomial(double measured_ratio, double modelled_ratio) {
  if (measured_ratio <= kClearlyFaster) return true;
  if (measured_ratio >= kClearlySlower) return false;
  return modelled_ratio < 1;
}

void choose_internal_force(ForceMethod asked, std::optional<double> tolerance, ReducedModel& model) {
  CubatureData& cubature = *model.cubature;
  const auto choose = [&](bool polynomial, const std::string& reason) {
    cubature.internal_force = polynomial ? ForceMethod::kPolynomial : ForceMethod::kCubature;
    cubature.internal_force_reason = reason;
    if (!polynomial) model.polynomial.reset();
  };
  if (asked != ForceMethod::kAuto) return choose(asked == ForceMethod::kPolynomial, "it is asked for");
  if (!model.polynomial) return choose(false, reason_against_polynomial(model, tolerance));
  const Eigen::Index modes = cubature.gradient.cols(), elements = cubature.elements.size();
  if (misses(cubature, tolerance))
    return choose(true, fmt::format("exact, where {} cubature elements miss the tolerance", elements));
  if (is_polynomial_faster(model))
    return choose(true, fmt::format("exact, and as fast as {} cubature elements or faster at r = {}", elements, modes));
  choose(false, slower_text(cubature));
}

}  // namespace exmat::precompute
