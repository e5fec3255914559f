#pragma once

#include "common/core/names.h"

namespace exmat {

// Choices of assets and scenes, by the names in their files and in bundles (schemas/).

enum class Integrator { kBdf2, kBackwardEuler, kNewmark };
template <>
inline constexpr std::array<std::string_view, 3> kNames<Integrator>{"bdf2", "backward_euler", "newmark"};

/// Precision of bodies side by side: mixed has stiffness in single precision.
enum class Precision { kDouble, kMixed };
template <>
inline constexpr std::array<std::string_view, 2> kNames<Precision>{"double", "mixed"};

/// The unknowns of a body: reduced coordinates, all vertices, or reduced until something acts that the modes were not
/// made for.
enum class Space { kReduced, kFull, kAuto };
template <>
inline constexpr std::array<std::string_view, 3> kNames<Space>{"reduced", "full", "auto"};

/// Method of the internal force; `auto` as the bundle says, or by measurement where the bundle is made.
enum class ForceMethod { kAuto, kCubature, kPolynomial };
template <>
inline constexpr std::array<std::string_view, 3> kNames<ForceMethod>{"auto", "cubature", "polynomial"};

/// Source of targets; `auto` is the bundle's table if it has one.
enum class TargetSource { kAuto, kTable, kSolve };
template <>
inline constexpr std::array<std::string_view, 3> kNames<TargetSource>{"auto", "table", "solve"};

/// Source of the loads in the runs that bases learn from; `auto` is the scene, else the asset's loads, else
/// examples, gravity and pushes of all kinds where there are examples.
enum class Training { kAuto, kNone, kScene, kLoads };
template <>
inline constexpr std::array<std::string_view, 4> kNames<Training>{"auto", "none", "scene", "loads"};

/// Unknowns of training runs: all degrees of freedom, or those of many modes.
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

/// Potential of an example force: a spring to the target, or the elastic energy with the target as the
/// undeformed shape. docs/method.md, "Force".
enum class ExampleForceLaw { kLinear, kElastic };
template <>
inline constexpr std::array<std::string_view, 2> kNames<ExampleForceLaw>{"linear", "elastic"};

/// Interpolation of a setting between its keys: the value of the last one, or linear.
enum class Interpolation { kLinear, kStep };
template <>
inline constexpr std::array<std::string_view, 2> kNames<Interpolation>{"linear", "step"};

/// Hold of a frame on a patch of a body: each vertex at its place in the frame, in full space, or their mean and the
/// rotation that fits them best, of a body in its modes; their mean alone; their mean by a spring and a damper.
enum class AttachmentKind { kFixed, kBall, kSpring };
template <>
inline constexpr std::array<std::string_view, 3> kNames<AttachmentKind>{"fixed", "ball", "spring"};

/// Lambda of the descriptors (docs/method.md, "Shape space"): the eigenvalues, or ones.
enum class Weighting { kEigenvalue, kNone };
template <>
inline constexpr std::array<std::string_view, 2> kNames<Weighting>{"eigenvalue", "none"};

/// Method that carries poses to the object. docs/alignment.md.
enum class AlignmentMethod { kAuto, kCoupled, kLandmarks, kMap };
template <>
inline constexpr std::array<std::string_view, 4> kNames<AlignmentMethod>{"auto", "coupled", "landmarks", "map"};

/// Frame of the examples: the object's (shared), any (free), or (auto) shared if the rest example stands in it.
enum class AlignmentFrame { kAuto, kShared, kFree };
template <>
inline constexpr std::array<std::string_view, 3> kNames<AlignmentFrame>{"auto", "shared", "free"};

/// Method that chooses cubature elements and their weights.
enum class CubatureMethod { kGreedySwap, kGreedy, kNnHtp, kAllElements };
template <>
inline constexpr std::array<std::string_view, 4> kNames<CubatureMethod>{"greedy_swap", "greedy", "nn_htp",
                                                                        "all_elements"};

}  // namespace exmat
