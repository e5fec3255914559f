#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "runtime/sim/frame/skeleton.h"
#include "runtime/sim/step/attachment.h"
#include "runtime/sim/step/model.h"

namespace exmat::runtime {

/// State of one example force from step to step. K examples, d target coordinates.
struct ExampleState {
  Eigen::VectorXd weights;  ///< [K] of the last step, after the bias; (1, 0, ...) before the first
  Eigen::VectorXd target;   ///< [d] y of the last step, see TargetSolver; empty with a table
  bool has_target = false;
  bool target_converged = false;
};

/// Sleep of a body that may fall asleep.
struct SleepState {
  bool asleep = false;           ///< nothing has acted on it since it was put to sleep
  std::int64_t still_steps = 0;  ///< without a break, before it was
  std::uint64_t loads = 0;       ///< hash of what acted on it in the last step
};

/// Motion of the unknowns of a body: r reduced coordinates, or in full space the f coordinates of the vertices that
/// move.
struct Motion {
  Eigen::VectorXd q, v;                    ///< displacement, velocity
  Eigen::VectorXd q_previous, v_previous;  ///< one step earlier (BDF2)
  Eigen::VectorXd a;                       ///< acceleration (Newmark)
  Eigen::VectorXd applied_force;           ///< set by the caller, added to the scene's
  std::int64_t step = 0;                   ///< steps taken
  double time = 0;                         ///< step * time_step [s]
  double elastic_energy = 0;               ///< E(q) [J]
  bool begins_anew = true;                 ///< the last step was no smooth one: the first, or one near obstacles
};

/// A body in full space on a skeleton.
struct SkeletonMotion {
  BonePoses bones, next;                         ///< at the end of the last step and of the next
  bool anew = true;                              ///< the bones were put where they are: no motion has led there
  bool bound = true;                             ///< nobody has moved them yet
  Eigen::VectorXd own, own_previous;             ///< [f] displacement of the vertices that move beside their bones
  Eigen::VectorXd way_previous;                  ///< [f] that the bones alone made in the last step
  Eigen::VectorXd q, v, q_previous, v_previous;  ///< [3p] displacement and velocity of the fixed vertices
  Eigen::VectorXd weights;                       ///< [K] by which examples shift the body, in the last step
};

/// All of that as numbers, and back; sizes stay. write_numbers() returns their count, and writes none to null.
Eigen::VectorXd numbers_of(const SkeletonMotion& motion);
std::size_t write_numbers(const SkeletonMotion& motion, double* to) noexcept;
void set_numbers(std::span<const double> numbers, SkeletonMotion& motion) noexcept;

/// A body that steps in all vertices: q is the displacement of those that move from where they were meshed, world [m].
struct FullMotion : Motion {
  double alone = 0;  ///< since something acted on it that asks for this space [s]
  std::optional<SkeletonMotion> skeleton;
};

/// All that a body carries from step to step. r modes. Of a body in full space the reduced coordinates are those of the
/// modes nearest to it, and steps change them with it.
struct State : Motion {
  std::vector<ExampleState> examples;   ///< one for each of the model's example forces
  ContactState contacts;                ///< sized for its scene by prepare_contacts()
  SleepState sleep;                     ///< used where the scene lets bodies sleep
  FrameState frame;                     ///< state of the model's frame; empty for a clamped body
  std::optional<FullMotion> full;       ///< in full space
  Eigen::VectorXd vertex_force;         ///< [f] of the caller, world [N], of a body that may step in full space
  std::vector<Attachment> attachments;  ///< made by its host
};

/// Those of a free body.
inline FreeState& free_state(State& state) { return *std::get_if<FreeState>(&state.frame); }
inline const FreeState& free_state(const State& state) { return *std::get_if<FreeState>(&state.frame); }

/// Sets how a free body moves that touches nothing; its q and v stay. False, and nothing is done, for other bodies.
bool set_motion(const Model& model, const FrameMotion& motion, State& state);

/// Sizes what a state remembers of its contacts with so many obstacles; those that it has stay.
void prepare_contacts(const Model& model, std::size_t obstacles, State& state);

/// At rest at time 0.
State make_state(const Model& model);

/// At the pose q with the velocity v at time 0.
State make_state(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v);

}  // namespace exmat::runtime
