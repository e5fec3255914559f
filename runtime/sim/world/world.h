#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "runtime/sim/step/stepper.h"
#include "runtime/sim/world/island.h"

namespace exmat::runtime {

struct WorldBodyStart {
  BodyKind kind;
  State state;
};

/// What one step of a World did.
struct WorldReport {
  int pairs = 0;           ///< of bodies whose bounds overlap
  int touching_pairs = 0;  ///< of those, with vertices that may touch
  int islands = 0;         ///< of two bodies or more, solved together
  int largest_island = 0;  ///< bodies
  int unconverged_islands = 0;
  int newton_iterations = 0;  ///< most of an island
};

/// Bodies that touch each other, stepped together. Bodies that no other is near take the step of a single body
/// (stepper.h); those that touch are solved together, island by island, so that a stiff pile converges as one body
/// does. Linear and angular momentum of free bodies among themselves are conserved to rounding. Results do not depend
/// on the number of threads. docs/step_in_detail.md, "Bodies that touch".
class World {
 public:
  /// `law` between any two bodies and between parts of one whose surface meets itself.
  explicit World(const ContactLaw& law) : law_(law) {}
  /// Its bodies' states are its own. All with the same time step. Models and scenes outlive the world.
  World(std::vector<WorldBodyStart> bodies, const ContactLaw& law);

  /// Adds a body whose state and scratch are a host's and stay where they are; its number is the last. The time step is
  /// that of the others.
  void add(const BodyKind& kind, State& state, Workspace& workspace);
  /// The numbers after it are one less from now on.
  void remove(int body);
  /// To be called where a body was put elsewhere: it has no contacts with others, and what it overlaps now pushes it
  /// from whatever depth.
  void forget(int body);

  void set_law(const ContactLaw& law) noexcept { law_ = law; }

  int count() const noexcept { return static_cast<int>(bodies_.size()); }
  State& state(int body) noexcept { return at(body).state; }
  const State& state(int body) const noexcept { return at(body).state; }
  const Model& model(int body) const noexcept { return at(body).model; }
  const StepScene& scene(int body) const noexcept { return at(body).scene; }
  Workspace& workspace(int body) noexcept { return at(body).workspace; }
  const Workspace& workspace(int body) const noexcept { return at(body).workspace; }
  const StepReport& report(int body) const noexcept { return at(body).report; }

  /// One step of all bodies by so many threads, >= 1.
  WorldReport step(int threads);

  /// Of bodies that touch each other at the end of the last step, in ascending order.
  const std::vector<HeldPair>& held() const noexcept { return held_; }
  /// Whether no step has led to where a body is.
  bool is_anew(int body) const noexcept { return at(body).anew; }
  /// What held() and is_anew() gave of a world of such bodies: it goes on from there.
  void set_memory(std::vector<HeldPair> held, const std::vector<bool>& anew);

  /// Contacts at the end of the last step, in the order of pairs of bodies and of the vertices of each.
  void read_touches(std::vector<BodyTouch>& touches) const;

  /// Times the stages of steps, on the wall clock, if set; kOther stays what it is.
  void set_profile(WorldProfile* profile) noexcept { profile_ = profile; }

  /// Kinetic, elastic and potential energy of all bodies [J].
  Energies energies() const;

 private:
  WorldBody& at(int body) const noexcept { return *bodies_[static_cast<std::size_t>(body)]; }
  void resize();
  void find_pairs(int threads);
  double margin_between(int own, int other) const noexcept;
  void keep_pairs();
  void gather(int threads);
  void step_single_bodies(int threads);
  void step_islands(int threads);
  void make_islands();
  void remember();
  const HeldPair* held_of(int first, int second) const;

  struct Island {
    std::vector<WorldBody*> bodies;
    std::vector<PairContact*> pairs;
    std::vector<std::vector<Incidence>> incidences;  // of each body
    IslandWorkspace workspace;
    NewtonReport newton;
  };

  struct Owned {
    Owned(const BodyKind& kind, State its_start) : state(std::move(its_start)), workspace(*kind.model, *kind.scene) {}
    State state;
    Workspace workspace;
  };

  std::vector<std::unique_ptr<Owned>> owned_;
  std::vector<std::unique_ptr<WorldBody>> bodies_;
  ContactLaw law_;
  std::vector<HeldPair> held_, next_held_;
  WorldProfile* profile_ = nullptr;

  // Of one step.
  std::vector<DeformationTree::Ball> balls_;
  std::vector<double> margins_;  // how far each may go beyond its centre's straight way [m]
  std::vector<int> order_, parents_, island_of_, place_in_island_;
  std::vector<std::pair<int, int>> near_, last_near_;
  std::vector<std::unique_ptr<PairContact>> pairs_, last_pairs_;  // the first of them, those of near_
  std::vector<std::vector<Incidence>> against_;  // of each body: pairs in which its surface is met, and by which side
  std::vector<std::unique_ptr<Island>> islands_;
  std::size_t island_count_ = 0;
};

}  // namespace exmat::runtime
