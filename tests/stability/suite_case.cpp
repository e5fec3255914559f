#include "tests/stability/suite_case.h"

#include <algorithm>
#include <fmt/format.h>
#include <iterator>
#include <set>

namespace exmat::precompute {
namespace {

constexpr std::array kIntegrators{Integrator::kBdf2, Integrator::kBackwardEuler, Integrator::kNewmark};
constexpr std::array kMaterials{MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                MaterialModel::kCorotational};
constexpr double kGravity = 9.81;
constexpr double kFrame = 1.0 / 60, kThirtieth = 1.0 / 30;
const Eigen::Vector3d kDown(0, 0, -1), kInward(-1, 0, 0);

using Cases = std::vector<StabilityCase>;

/// Every integrator.
void add(StabilityCase test, Cases& cases) {
  for (const Integrator integrator : kIntegrators) {
    test.integrator = integrator;
    cases.push_back(test);
  }
}

/// Every material, clamped and free, every integrator.
void add_all(StabilityCase test, Cases& cases) {
  for (const MaterialModel material : kMaterials)
    for (const bool free : {false, true}) {
      test.body.material = material;
      test.body.free = free;
      add(test, cases);
    }
}

/// A body let go under its weight; a free one is struck as well.
StabilityCase let_go(const std::string& group, const BodySpec& body, double time_step) {
  StabilityCase test{.group = group, .body = body, .time_step = time_step, .gravity = kGravity};
  if (body.free) {
    test.start = Start::kImpulse;
    test.impulse = 0.1 * kDown;
  }
  test.extreme =
      fmt::format("E {:g} Pa, nu {:g}, density {:g} kg/m^3", body.youngs_modulus, body.poisson_ratio, body.density);
  return test;
}

void add_let_go(BodySpec body, double time_step, Cases& cases) {
  for (const MaterialModel material : kMaterials)
    for (const bool free : {false, true}) {
      body.material = material;
      body.free = free;
      add(let_go("stiffness", body, time_step), cases);
    }
}

// The ends of the ranges of E, nu and density, at three time steps each.
void add_stiffness(Cases& cases) {
  struct Numbers {
    double youngs_modulus, poisson_ratio, density;
  };
  for (const auto& [E, nu, density] :
       {Numbers{1e3, 0, 1e5}, {1e3, 0.4999, 1}, {1e6, 0.4999, 1e3}, {1e12, 0.4999, 1}, {1e12, 0, 1e5}})
    for (const double time_step : {1e-4, 1e-3, kThirtieth})
      add_let_go({.youngs_modulus = E, .poisson_ratio = nu, .density = density}, time_step, cases);
}

void add_loads(Cases& cases) {
  for (const double time_step : {1e-3, kThirtieth}) {
    StabilityCase test{.group = "loads", .time_step = time_step};
    test.extreme = "100 times the load that bends it by L/10";
    test.tip_load = 10 * kDown;
    add_all(test, cases);
    test.extreme = "10 times the load that shortens it by L, along its axis";
    test.tip_load = 10 * kInward;
    add_all(test, cases);
    test.extreme = "100 times gravity";
    test.tip_load.setZero();
    test.gravity = 100 * kGravity;
    add_all(test, cases);
    test.gravity = 0;
    test.start = Start::kImpulse;
    for (const double size : {1.0, 10.0}) {
      test.extreme = fmt::format("impulse sideways that takes it {:g} L far", size);
      test.impulse = size * kDown;
      add_all(test, cases);
    }
    test.extreme = "impulse along the axis that takes it 10 L far";
    test.impulse = 10 * kInward;
    add_all(test, cases);
  }
}

void add_starts(Cases& cases) {
  for (const double time_step : {1e-3, kThirtieth}) {
    StabilityCase test{.group = "starts", .time_step = time_step};
    test.extreme = "compressed into a plane";
    test.start = Start::kFlattened;
    add_all(test, cases);
    test.extreme = "collapsed into a point";
    test.start = Start::kCollapsed;
    add_all(test, cases);
    test.extreme = "inverted";
    test.start = Start::kInverted;
    add_all(test, cases);
    test.start = Start::kTangled;
    for (const double reach : {1.0, 10.0}) {
      test.extreme = fmt::format("random coordinates, displaced by {:g} L", reach);
      test.reach = reach;
      add_all(test, cases);
    }
  }
}

void add_spins(Cases& cases) {
  for (const double youngs_modulus : {1e6, 1e9})
    for (const double spin : {10.0, 1000.0})
      for (const double time_step : {1e-4, 1e-3, kThirtieth}) {
        StabilityCase test{.group = "spin", .time_step = time_step};
        test.extreme = fmt::format("spin {:g} rad/s about an inclined axis, E {:g} Pa", spin, youngs_modulus);
        test.body = {.youngs_modulus = youngs_modulus, .free = true};
        test.spin = spin;
        for (const MaterialModel material : kMaterials) {
          test.body.material = material;
          test.principal_axis = false;
          add(test, cases);
          test.principal_axis = true;
          test.extreme = fmt::format("spin {:g} rad/s about its axis of most inertia, E {:g} Pa", spin, youngs_modulus);
          add(test, cases);
          test.extreme = fmt::format("spin {:g} rad/s about an inclined axis, E {:g} Pa", spin, youngs_modulus);
        }
      }
}

void add_contacts(Cases& cases) {
  for (const double time_step : {1e-3, kThirtieth})
    for (const double stiffness : {1e4, 1e7, 1e10}) {
      StabilityCase test{.group = "contact", .time_step = time_step, .gravity = kGravity};
      test.ground = Ground::kPlane;
      test.contact_stiffness = stiffness;
      test.friction = 0.5;
      for (const bool free : {false, true}) {
        test.body.free = free;
        test.velocity = free ? 5 : 0;
        test.extreme = fmt::format("contact stiffness {:g} N/m^3", stiffness);
        test.ground = Ground::kPlane;
        add(test, cases);
        test.velocity = 0;
        test.extreme = fmt::format("pressed flat, contact stiffness {:g} N/m^3", stiffness);
        test.ground = Ground::kPress;
        for (const MaterialModel material : kMaterials) {
          test.body.material = material;
          add(test, cases);
        }
        test.body.material = MaterialModel::kStVenantKirchhoff;
      }
    }
}

/// Onto obstacles of all shapes, at 1/30 s also faster than they are thick; what is as stiff as 1e10 N/m^3 then turns
/// by more than a radian in a step, on planes as well.
void add_grounds(Cases& cases) {
  for (const double time_step : {1e-3, kThirtieth})
    for (const double stiffness : {1e4, 1e7, 1e10})
      for (const double velocity : {5.0, 50.0}) {
        if (velocity > 5 && (time_step < kThirtieth || stiffness > 1e7)) continue;
        StabilityCase test{.group = "contact", .body = {.free = true}, .time_step = time_step, .gravity = kGravity};
        test.contact_stiffness = stiffness;
        test.friction = 0.5;
        test.velocity = velocity;
        for (const auto& [ground, name] : {std::pair(Ground::kMesh, "a slab of triangles"),
                                           {Ground::kHills, "a height field"},
                                           {Ground::kBox, "a box"},
                                           {Ground::kSphere, "a sphere"},
                                           {Ground::kCapsule, "a capsule"}}) {
          test.ground = ground;
          test.extreme = fmt::format("onto {} at {:g} m/s, {:g} N/m^3", name, velocity, stiffness);
          add(test, cases);
        }
      }
}

void add_examples(Cases& cases) {
  const auto add_forces = [&](BodyExamples examples, bool table, const std::string& what) {
    for (const bool free : {false, true})
      for (const double time_step : {1e-3, kThirtieth})
        for (const double kappa : {1e3, 1e10}) {
          StabilityCase test{.group = "examples", .time_step = time_step};
          test.body = {.free = free, .examples = examples, .target_table = table};
          test.extreme = fmt::format("{}, kappa {:g} 1/s^2", what, kappa);
          test.examples = {.stiffness = kappa, .damping = 2, .bias = 0.5};
          test.start = Start::kImpulse;
          test.impulse = kDown;
          add(test, cases);
        }
  };
  add_forces(BodyExamples::kBendAndTwist, true, "bend and twist by a table");
  add_forces(BodyExamples::kBendAndTwist, false, "bend and twist solved for");
  add_forces(BodyExamples::kNearDuplicates, false, "examples that differ by 1e-7 rad");
  add_forces(BodyExamples::kDuplicates, false, "the same example twice");
  add_forces(BodyExamples::kRestAlone, false, "the rest pose alone");
  // Elastic ones, whose stiffness is a factor on that of the material, and those of a region.
  for (const bool free : {false, true})
    for (const double time_step : {1e-3, kThirtieth})
      for (const double size : {1.0, 1e3}) {
        StabilityCase test{.group = "examples", .time_step = time_step};
        test.start = Start::kImpulse;
        test.impulse = kDown;
        test.body = {.free = free, .examples = BodyExamples::kBendAndTwist, .elastic = true};
        test.examples = {.stiffness = size, .damping = 2, .bias = 0.5, .elastic = true};
        for (const EnergyReference reference : {EnergyReference::kExample, EnergyReference::kRest}) {
          test.body.energy_reference = reference;
          test.extreme = fmt::format("elastic, energy relative to the {}, factor {:g}", name_of(reference), size);
          add(test, cases);
        }
        test.body = {.free = free, .examples = BodyExamples::kBendAndTwist, .region = true};
        test.examples = {.stiffness = size == 1 ? 1e3 : 1e10, .damping = 2, .bias = 0.5};
        test.extreme = fmt::format("of a region, kappa {:g} 1/s^2", test.examples.stiffness);
        add(test, cases);
      }
}

/// Free bodies that are pulled to a pose while they touch the ground.
void add_examples_on_ground(const std::vector<double>& time_steps, const std::vector<double>& stiffnesses,
                            const std::vector<double>& kappas, Cases& cases) {
  for (const double time_step : time_steps)
    for (const double stiffness : stiffnesses)
      for (const double kappa : kappas) {
        StabilityCase test{.group = "examples on the ground", .time_step = time_step, .gravity = kGravity};
        test.body = {.free = true, .examples = BodyExamples::kBendAndTwist, .target_table = true};
        test.examples = {.stiffness = kappa, .damping = 2, .bias = 0.5};
        test.velocity = 5;
        test.ground = Ground::kPlane;
        test.contact_stiffness = stiffness;
        test.friction = 0.5;
        test.extreme = fmt::format("kappa {:g} 1/s^2, contact stiffness {:g} N/m^3", kappa, stiffness);
        add(test, cases);
      }
}

/// Bodies on bodies: of all that is exact of one body it is asked of all together. Newmark's method takes backward
/// Euler's steps where bodies touch.
void add_worlds(const std::vector<double>& time_steps, const std::vector<double>& stiffnesses, bool all_integrators,
                Cases& cases) {
  for (const double time_step : time_steps)
    for (const double stiffness : stiffnesses) {
      StabilityCase test{.group = "bodies", .time_step = time_step};
      test.contact_stiffness = stiffness;
      test.friction = 0.5;
      const auto add_company = [&](Company company, const std::string& what) {
        test.company = company;
        test.extreme = fmt::format("{}, contact stiffness {:g} N/m^3", what, stiffness);
        if (all_integrators)
          add(test, cases);
        else
          cases.push_back(test);
      };
      test.body.free = true;
      test.velocity = 5;
      add_company(Company::kPair, "two that meet at 5 m/s");
      test.velocity = 50;
      add_company(Company::kPair, "two that meet at 50 m/s");
      test.velocity = 0;
      add_company(Company::kCarried, "one that is swung through another");
      test.gravity = kGravity;
      test.ground = Ground::kPlane;
      test.velocity = 2;
      add_company(Company::kPile, "a pile of three");
      test.body.examples = BodyExamples::kBendAndTwist;
      test.body.target_table = true;
      test.examples = {.stiffness = 1e4, .damping = 2, .bias = 0.5};
      add_company(Company::kPile, "a pile of three that are pulled to poses");
      test.body.examples = BodyExamples::kNone;
      test.body.target_table = false;
      test.gravity = test.velocity = 0;
      test.ground = Ground::kNone;
      test.reach = 1;
      test.start = Start::kTangled;
      for (const bool free : {false, true}) {
        test.body.free = free;
        add_company(Company::kItself, "touches itself, random coordinates, displaced by L");
      }
    }
}

/// The exact force in place of that of elements.
void add_polynomial(Cases& cases) {
  for (const double time_step : {1e-3, kThirtieth})
    for (const bool free : {false, true}) {
      StabilityCase test{.group = "polynomial", .body = {.free = free, .polynomial = true}, .time_step = time_step};
      test.extreme = "100 times the load that bends it by L/10";
      test.tip_load = 10 * kDown;
      add(test, cases);
      test.tip_load.setZero();
      for (const auto& [start, name] : {std::pair(Start::kFlattened, "compressed into a plane"),
                                        {Start::kInverted, "inverted"},
                                        {Start::kTangled, "random coordinates"}}) {
        test.start = start;
        test.reach = 10;
        test.extreme = name;
        add(test, cases);
      }
      test.start = Start::kRest;
      test.gravity = kGravity;
      test.ground = Ground::kPress;
      test.contact_stiffness = 1e10;
      test.extreme = "pressed flat, contact stiffness 1e10 N/m^3";
      add(test, cases);
    }
}

void add_slivers(Cases& cases) {
  for (const double time_step : {1e-3, kThirtieth}) {
    StabilityCase test{.group = "slivers", .body = {.slivers = true}, .time_step = time_step, .gravity = kGravity};
    test.extreme = "dihedral angles of one degree";
    add_all(test, cases);
    test.extreme = "dihedral angles of one degree, 100 times the load that bends it by L/10";
    test.tip_load = 10 * kDown;
    add_all(test, cases);
    test.extreme = "dihedral angles of one degree, random coordinates, displaced by L";
    test.tip_load.setZero();
    test.start = Start::kTangled;
    add_all(test, cases);
  }
}

void add_nothing(Cases& cases) {
  for (const double time_step : {1e-3, kThirtieth}) {
    StabilityCase test{.group = "no damping", .time_step = time_step, .damping = 0};
    test.extreme = "nothing acts";
    add_all(test, cases);
    test.extreme = "zero damping, released under its weight";
    test.gravity = kGravity;
    add_all(test, cases);
    test.extreme = "zero gravity and damping, impulse that takes it L far";
    test.gravity = 0;
    test.start = Start::kImpulse;
    test.impulse = kDown;
    add_all(test, cases);
    test.extreme = "zero gravity and damping, inverted";
    test.start = Start::kInverted;
    add_all(test, cases);
  }
}

// The full product of the first group's numbers.
void add_product(Cases& cases) {
  for (const double E : {1e3, 1e6, 1e9, 1e12})
    for (const double nu : {0.0, 0.3, 0.45, 0.499, 0.4999})
      for (const double density : {1.0, 1e3, 1e5})
        for (const double time_step : {1e-4, 1e-3, kFrame, kThirtieth})
          add_let_go({.youngs_modulus = E, .poisson_ratio = nu, .density = density}, time_step, cases);
}

/// True if lanes take it: one body by elements that touches nothing, whose examples pull linearly.
bool goes_in_lanes(const StabilityCase& test) {
  return test.ground == Ground::kNone && test.company == Company::kNone && !test.body.polynomial && !test.body.elastic;
}

/// The same cases in mixed precision, where that applies.
void add_mixed(Cases& cases) {
  Cases mixed;
  for (const StabilityCase& test : cases) {
    if (!goes_in_lanes(test)) continue;
    StabilityCase& added = mixed.emplace_back(test);
    added.group += ", mixed";
    added.precision = Precision::kMixed;
  }
  std::ranges::move(mixed, std::back_inserter(cases));
}

/// The same cases of some groups in all vertices of the mesh, and those that a body goes there for by itself.
void add_full(Cases& cases) {
  Cases full;
  const std::set<std::string_view> groups{"stiffness", "loads", "starts", "contact", "slivers", "no damping"};
  for (const StabilityCase& test : cases) {
    if (!groups.contains(test.group) || test.integrator == Integrator::kNewmark) continue;
    StabilityCase& added = full.emplace_back(test);
    added.group += ", full";
    added.space = Space::kFull;
    if (test.tip_load.isZero(0) && test.ground == Ground::kNone) continue;
    StabilityCase& entering = full.emplace_back(test);
    entering.group += ", auto";
    entering.space = Space::kAuto;
  }
  std::ranges::move(full, std::back_inserter(cases));
}

}  // namespace

std::string describe(const StabilityCase& test) {
  return fmt::format("{}: {}; {}, {}, {}, dt {:.4g} s", test.group, test.extreme, exmat::name_of(test.body.material),
                     test.body.free ? "free" : "clamped", name_of(test.integrator), test.time_step);
}

std::vector<StabilityCase> short_stability_suite() {
  Cases cases;
  add_stiffness(cases);
  add_loads(cases);
  add_starts(cases);
  add_spins(cases);
  add_contacts(cases);
  add_grounds(cases);
  add_examples(cases);
  add_examples_on_ground({1e-3, kThirtieth}, {1e4, 1e10}, {1e3, 1e10}, cases);
  add_worlds({1e-3, kThirtieth}, {1e4, 1e10}, /*all_integrators=*/false, cases);
  add_polynomial(cases);
  add_slivers(cases);
  add_nothing(cases);
  add_mixed(cases);
  add_full(cases);
  return cases;
}

std::vector<StabilityCase> long_stability_suite() {
  Cases cases;
  add_product(cases);
  for (StabilityCase& test : short_stability_suite())
    if (test.group != "stiffness" && test.group != "examples on the ground" && test.group != "bodies")
      cases.push_back(std::move(test));
  add_examples_on_ground({1e-4, 1e-3, kFrame, kThirtieth}, {1e4, 1e6, 1e8, 1e10}, {1e3, 1e6, 1e10}, cases);
  add_worlds({1e-4, 1e-3, kFrame, kThirtieth}, {1e4, 1e6, 1e8, 1e10}, /*all_integrators=*/true, cases);
  return cases;
}

}  // namespace exmat::precompute
