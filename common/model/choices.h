#pragma once

#include "common/core/names.h"

namespace exmat {

// What assets and scenes choose between, by the names in their files and in bundles (schemas/).

enum class Integrator { kBdf2, kBackwardEuler, kNewmark };
template <>
inline constexpr std::array<std::string_view, 3> kNames<Integrator>{"bdf2", "backward_euler", "newmark"};

/// Of bodies side by side: mixed has stiffness in single precision.
enum class Precision { kDouble, kMixed };
template <>
inline constexpr std::array<std::string_view, 2> kNames<Precision>{"double", "mixed"};

/// The unknowns of a body: reduced coordinates, all vertices, or reduced until something acts that the modes were not
/// made for.
enum class Space { kReduced, kFull, kAuto };
template <>
inline constexpr std::array<std::string_view, 3> kNames<Space>{"reduced", "full", "auto"};

/// How the internal force is computed; `auto` as the bundle says, or by measurement where the bundle is made.
enum class ForceMethod { kAuto, kCubature, kPolynomial };
template <>
inline constexpr std::array<std::string_view, 3> kNames<ForceMethod>{"auto", "cubature", "polynomial"};

/// Where targets come from; `auto` is the bundle's table if it has one.
enum class TargetSource { kAuto, kTable, kSolve };
template <>
inline constexpr std::array<std::string_view, 3> kNames<TargetSource>{"auto", "table", "solve"};

/// Where the loads of the runs come from that bases learn from; `auto` is the scene, else the asset's loads, else
/// examples, gravity and pushes of all kinds where there are examples.
enum class Training { kAuto, kNone, kScene, kLoads };
template <>
inline constexpr std::array<std::string_view, 4> kNames<Training>{"auto", "none", "scene", "loads"};

/// What runs of training have: all degrees of freedom, or those of many modes.
enum class TrainingSpace { kAuto, kFullSpace, kModes };
template <>
inline constexpr std::array<std::string_view, 3> kNames<TrainingSpace>{"auto", "full_space", "modes"};

/// The undeformed shape of an example's energy. docs/method.md, "Target".
enum class EnergyReference {
  kExample,  ///< E_k(p) = sum_j w_j V_j det F_jk Psi(F_j(p) F_jk^-1)
  kRest,     ///< E_k(p) = sum_j w_j V_j Psi(I + B_j (p - p_k))
};
template <>
inline constexpr std::array<std::string_view, 2> kNames<EnergyReference>{"example", "rest"};

/// What an example force is the slope of: a spring to the target, or the elastic energy with the target as the
/// undeformed shape. docs/method.md, "Force".
enum class ExampleForceLaw { kLinear, kElastic };
template <>
inline constexpr std::array<std::string_view, 2> kNames<ExampleForceLaw>{"linear", "elastic"};

/// What a setting is between its keys: the value of the last one, or on the line to the next.
enum class Interpolation { kLinear, kStep };
template <>
inline constexpr std::array<std::string_view, 2> kNames<Interpolation>{"linear", "step"};

/// Lambda of the descriptors (docs/method.md, "Shape space"): the eigenvalues, or ones.
enum class Weighting { kEigenvalue, kNone };
template <>
inline constexpr std::array<std::string_view, 2> kNames<Weighting>{"eigenvalue", "none"};

/// How poses are carried to the object. docs/alignment.md.
enum class AlignmentMethod { kAuto, kCoupled, kLandmarks, kMap };
template <>
inline constexpr std::array<std::string_view, 4> kNames<AlignmentMethod>{"auto", "coupled", "landmarks", "map"};

/// Whether the examples stand in the object's frame; `auto` if the rest example does.
enum class AlignmentFrame { kAuto, kShared, kFree };
template <>
inline constexpr std::array<std::string_view, 3> kNames<AlignmentFrame>{"auto", "shared", "free"};

/// How cubature elements and their weights are chosen.
enum class CubatureMethod { kGreedySwap, kGreedy, kNnHtp, kAllElements };
template <>
inline constexpr std::array<std::string_view, 4> kNames<CubatureMethod>{"greedy_swap", "greedy", "nn_htp",
                                                                        "all_elements"};

}  // namespace exmat
