#pragma once

#include <optional>
#include <string>

#include "common/model/reduced_model.h"

namespace exmat::precompute {

/// Throws InputError where `polynomial` cannot be had at all: another material than stvk, or too many modes.
void require_polynomial(MaterialModel material, Eigen::Index modes);

/// Why `auto` does without a polynomial before there is one, for a model with cubature; empty where it is worth making.
/// `tolerance` is that of cubature, if it has one.
std::string reason_against_polynomial(const ReducedModel& model, std::optional<double> tolerance);

/// `auto` between polynomial and cubature by the ratio of their times: as measured where it is clear (at most 0.8 or
/// at least 1.25), else as modelled, so that bundles do not change from run to run.
bool takes_polynomial(double measured_ratio, double modelled_ratio);

/// Sets internal_force of model.cubature and its reason, and drops model.polynomial where cubature is chosen. `asked`
/// may be auto: then the polynomial, if there is one, where cubature misses its tolerance,
/// else the faster for one force_and_stiffness and two forces, as the run time's own classes are measured. Measured
/// times go to the log.
void choose_internal_force(ForceMethod asked, std::optional<double> tolerance, ReducedModel& model);

}  // namespace exmat::precompute
