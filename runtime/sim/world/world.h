#pragma once

#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "common/core/disjoint_sets.h"
#include "runtime/sim/step/stepper.h"
#include "runtime/sim/world/crowd.h"
#include "runtime/sim/world/island.h"

namespace exmat::runtime {

struct WorldBodyStart {
  BodyKind kind;
  State state;
};

/// Result of one step of a World.
struct WorldReport {
  int asleep = 0;          ///< bodies that slept through it
  int pairs = 0;           ///< pairs of bodies with overlapping bounds
  int touching_pairs = 0;  ///< pairs with vertices that may touch, or that are attached to each other
  int islands = 0;         ///< groups of touching bodies, each solved together
  int largest_island = 0;  ///< bodies
  int unconverged_islands = 0;
  int divided_islands = 0;    ///< taken in several smaller steps
  int newton_iterations = 0;  ///< most of an island
};

/// The one thing that is stepped: 1 to N bodies, each of which may touch obstacles, other bodies and itself. A step
/// asks who sleeps and who may touch whom. Bodies that touch or are attached to each other, directly or through others,
/// are an island, solved together, so that a stiff pile converges as one body does. All others go side by side or one
/// by one (Crowd). An island falls asleep as a whole, and wakes as a whole when something acts on one of its bodies or
/// comes near it. Linear and angular momentum of free bodies among themselves are conserved to rounding. Results do not
/// depend on the number of threads. docs/step_in_detail.md, "Bodies that touch".
class World {
 public:
  /// `law` between any two bodies and between parts of one whose surface meets itself.
  explicit World(const ContactLaw& law) : law_(law) {}
  /// Its bodies' states are its own. All with the same time step. Models and scenes outlive the world.
  World(std::vector<WorldBodyStart> bodies, const ContactLaw& law);

  /// Adds a body whose state is a host's and stays where it is; its number is the last. The time step is that of the
  /// others.
  void add(const BodyKind& kind, State& state);
  /// The numbers after it are one less from now on.
  void remove(int body);
  /// To be called after a body was put elsewhere: it has no contacts with others, and what it overlaps now pushes it
  /// from whatever depth. What it touched wakes.
  void forget(int body);
  /// To be called after its scene has other obstacles: scratch and state hold the contacts with these.
  void fit(int body);
  /// To be called after a host attached the body in its modes: scratch holds the attachments. Steps do it themselves.
  void fit_attachments(int body);
  /// True if the body and another are attached to each other.
  bool is_attached(int body) const noexcept;
  /// True if a body may touch others or itself.
  bool may_touch(int body) const noexcept { return at(body).touching != nullptr; }

  void set_law(const ContactLaw& law) noexcept { law_ = law; }

  int count() const noexcept { return static_cast<int>(bodies_.size()); }
  State& state(int body) noexcept { return *at(body).state; }
  const State& state(int body) const noexcept { return *at(body).state; }
  const Model& model(int body) const noexcept { return *at(body).kind.model; }
  const StepScene& scene(int body) const noexcept { return *at(body).kind.scene; }
  const StepReport& report(int body) const noexcept { return at(body).report; }

  /// Scratch that a body's steps are taken in, to be used between steps.
  Workspace& scratch(int body) noexcept;

  /// That of its steps in full space; null where it is not there.
  FullWorkspace* full_scratch(int body) noexcept { return at(body).full.get(); }

  /// After a host gave a body impulses between two steps: one of space `auto` is in full space from now on.
  void was_pushed(int body);

  /// Sizes scratch for steps by so many threads, which they else do themselves.
  void prepare(int threads);

  /// One step of all bodies by so many threads, >= 1.
  WorldReport step(int threads, StepObserver* observer = nullptr);

  /// Contacts of bodies that touched each other at the end of the last step, in ascending order.
  const std::vector<HeldPair>& held() const noexcept { return held_; }
  /// Goes on from what held() gave of a world of such bodies.
  void set_memory(std::vector<HeldPair> held);
  /// The same piece by piece, into the memory that is there; after all of it, and after the states of all bodies were
  /// set, take_states().
  std::vector<HeldPair>& held() noexcept { return held_; }
  void take_states();
  /// Contacts with obstacles in the last step of a body that touched no other: they keep one of space `auto` full.
  int lone_contacts(int body) const noexcept { return stepped_with_others(body) ? 0 : at(body).report.contacts; }
  /// Set between the two, in place of its last step.
  void set_lone_contacts(int body, int contacts) noexcept {
    at(body).report = {};
    at(body).report.contacts = contacts;
  }

  /// Contacts at the end of the last step, in the order of pairs of bodies and of the vertices of each.
  void read_touches(std::vector<BodyTouch>& touches) const;

  /// Bodies of space `auto` that may step in all vertices at once: those that the caller pushes hardest, then those
  /// that something acted on last. The rest step in their modes.
  void set_full_bodies(int most) noexcept { most_full_ = most; }
  int full_bodies() const noexcept { return most_full_; }

  /// Times the stages of steps, if set; kOther stays what it is.
  void set_profile(WorldProfile* profile) noexcept { profile_ = profile; }

  /// Energies of one body [J].
  Energies energies(int body) const noexcept;
  /// Kinetic, elastic and potential energy of all bodies, and that of contacts and springs between them [J].
  Energies energies() const;

 private:
  struct Member {
    BodyKind kind;
    State* state = nullptr;
    int crowd_kind = 0;
    StepReport report{};
    std::unique_ptr<WorldBody> touching{};  ///< present for a body that may touch others or itself
    bool asleep = false;                    ///< in this step
    std::unique_ptr<FullWorkspace> full{};  ///< present for a body in full space
    std::unique_ptr<Workspace> held{};      ///< present for a held body in its modes that touches no other
    bool is_bounded = false;                ///< its ball is that of where it is: it has slept since
  };

  /// An attachment of one body to another.
  struct Link {
    std::pair<int, int> bodies;  ///< in ascending order
    int side;                    ///< whose it is
    Attachment* attachment;
  };

  const Member& at(int body) const noexcept { return bodies_[static_cast<std::size_t>(body)]; }
  Member& at(int body) noexcept { return bodies_[static_cast<std::size_t>(body)]; }
  WorldBody& touching(int body) const noexcept { return *at(body).touching; }
  void wake_neighbours(int body);
  void move_attachments();
  std::span<const Link> links_of(const std::pair<int, int>& bodies) const noexcept;
  void find_sleepers(int threads);
  void find_contacts(int threads);
  void find_pairs(int threads);
  void bound(int body);
  double margin_between(int own, int other) const noexcept;
  void keep_pairs();
  void gather(int threads);
  bool begin_pair(std::size_t pair, const HeldPair* held);
  void gather_side(PairContact& pair, int side, int own, int other);
  void number_bodies(std::size_t pair);
  void make_islands(int threads);
  bool wake_islands();
  bool is_linked(std::size_t pair) const;
  void unite();
  void collect_islands();
  void choose_spaces();
  bool asks_for_full(int body);
  void enter_full(Member& member);
  void take_full_scratch(Member& member);
  void leave_full(Member& member) noexcept;
  void drop_full_scratch(Member& member) noexcept;
  void reserve_full(const BodyKind& kind);
  bool is_in_island(int body) const noexcept;
  bool stepped_with_others(int body) const noexcept;
  void step_crowd(int threads, StepObserver* observer);
  void remember();
  const HeldPair* held_of(int first, int second) const;

  struct Island {
    std::vector<WorldBody*> bodies;
    std::vector<int> numbers;  // of these bodies
    std::vector<PairContact*> pairs;
    std::vector<std::size_t> near;                   // their numbers in near_
    std::vector<std::vector<Incidence>> incidences;  // of each body
    std::vector<HeldPair> held;                      // of each pair, within a divided step
    IslandWorkspace workspace;
    NewtonReport newton;
    bool divided = false;  // the step
  };

  void gather_again(Island& island, bool at_start);
  void step_islands(int threads, StepObserver* observer);
  NewtonReport step_island(Island& island, int threads);
  NewtonReport step_in_parts(Island& island, int threads);

  std::vector<std::unique_ptr<State>> owned_;
  std::vector<Member> bodies_;
  Crowd crowd_;
  /// Scratch of steps in full space that no body has now, with the model that it is for; never fewer than those made.
  std::vector<std::pair<const FullModel*, std::unique_ptr<FullWorkspace>>> idle_full_;
  ContactLaw law_;
  int most_full_ = std::numeric_limits<int>::max();
  std::vector<int> asking_;  // bodies of space `auto` that ask for the full one
  std::vector<HeldPair> held_, next_held_;
  WorldProfile* profile_ = nullptr;

  std::vector<int> touching_;                 // bodies that may touch others or themselves, in ascending order
  std::vector<DeformationTree::Ball> balls_;  // of these
  std::vector<double> margins_;               // of each body: how far it may go beyond its centre's straight way [m]

  // State of one step.
  std::vector<Link> links_;  // in ascending order of the bodies
  bool found_contacts_ = false;
  std::vector<int> order_, island_of_, place_in_island_;
  DisjointSets linked_;  // bodies that step together
  std::vector<std::pair<int, int>> near_, last_near_;
  std::vector<std::unique_ptr<PairContact>> pairs_, last_pairs_;  // the first of them, those of near_
  std::vector<bool> is_gathered_;                                 // of each pair
  std::vector<std::vector<Incidence>> against_;  // of each body: pairs in which its surface is met, and by which side
  std::vector<std::unique_ptr<Island>> islands_;
  std::size_t island_count_ = 0;
};

}  // namespace exmat::runtime
