#pragma once

#include <memory>
#include <string>

#include "runtime/sim/step/scene.h"
#include "tests/support/synthetic_model.h"

namespace exmat::benchmarks {

inline constexpr std::array kModes{20, 30, 42};
inline constexpr std::array kElements{23, 30, 60, 120};
inline constexpr int kExamples = 4;
inline constexpr int kTableDegree = 8;  ///< 165 control points

/// A clamped or free bar of 432 tets with four examples, r modes, a table of targets and the exact polynomial; s of its
/// elements, evenly spread, with equal weights as cubature. Kept for the life of the process.
const ReducedModel& bar_model(int modes, int elements, bool free = false);

enum class Target { kNone, kTable, kSolve };
inline constexpr std::array kTargets{Target::kNone, Target::kTable, Target::kSolve};
std::string name_of(Target target);

std::unique_ptr<const runtime::Model> prepare(const ReducedModel& model, Target target, bool polynomial);

/// It swings under gravity, damped; 1 ms, BDF2.
runtime::StepScene swing(const runtime::Model& model, Target target);

}  // namespace exmat::benchmarks
