#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exmat/exmat.h>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/core/fnv_hash.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

// Random calls of the C interface with hostile numbers. The bytes choose the first ones, their hash all that follow.
// Whatever is called: a failure has a message and leaves no handle, and after a step that is not refused the state has
// finite numbers, which the body takes again.

namespace {

using namespace exmat;  // NOLINT(google-build-using-namespace)

constexpr int kCalls = 100;
constexpr std::size_t kMostBodies = 6, kMostWorlds = 3, kMostOthers = 8, kStructBytes = 4096;

[[noreturn]] void fault(const char* what) {
  std::fprintf(stderr, "%s: %s\n", what, exmat_last_error());
  std::abort();
}

/// A struct of the interface with room for what a newer caller would have.
template <typename Struct>
union Padded {
  Padded() : bytes{} {}
  Struct value;
  std::array<unsigned char, kStructBytes> bytes;
};

class Choices {
 public:
  Choices(const std::uint8_t* data, std::size_t size) : data_(data), end_(data + size) {
    FnvHash hash;
    hash.add({reinterpret_cast<const char*>(data), size});
    random_.seed(hash.value());
  }

  std::size_t below(std::size_t count) {
    const std::size_t drawn = data_ != end_ ? *data_++ : random_() >> 8U;
    return drawn % count;
  }
  bool one_in(std::size_t count) { return below(count) == 0; }

  double number() {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();
    static constexpr std::array<double, 24> kHostile{0.0,   -0.0,  5e-324, 1e-310, 2.3e-308, 1e-160,  1e-30,     1e-9,
                                                     1e3,   1e6,   1e10,   1e19,   1e38,     1e39,    1e100,     1e153,
                                                     1e154, 1e155, 1e200,  1e300,  1e306,    DBL_MAX, kInfinity, NAN};
    if (!one_in(4)) return std::uniform_real_distribution(-1.0, 2.0)(random_);
    const double hostile = kHostile[below(kHostile.size())];
    return one_in(3) ? -hostile : hostile;
  }

  std::int64_t whole() {
    static constexpr std::array<std::int64_t, 10> kHostile{
        -1, 0, 1, 1000, INT32_MAX, INT32_MIN, std::int64_t{1} << 32U, INT64_MAX, INT64_MIN, UINT32_MAX};
    return one_in(4) ? kHostile[below(kHostile.size())] : static_cast<std::int64_t>(below(4));
  }
  std::int32_t small() { return static_cast<std::int32_t>(whole()); }

  /// Mostly the length that is right.
  std::int64_t length(std::int64_t right) {
    return one_in(12) ? (one_in(2) ? whole() : right + (one_in(2) ? 1 : -1)) : right;
  }

  std::vector<double> numbers(std::int64_t count) {
    std::vector<double> drawn(static_cast<std::size_t>(std::max<std::int64_t>(count, 1)));
    const bool sound = !one_in(3);
    for (double& number : drawn) number = sound ? std::uniform_real_distribution(-1.0, 1.0)(random_) : this->number();
    return drawn;
  }

  template <typename Struct>
  void size(Struct& made) {
    if (one_in(16)) made.size = one_in(2) ? below(kStructBytes) : static_cast<std::size_t>(whole());
  }

  template <typename Handle>
  Handle* of(const std::vector<Handle*>& handles) {
    return handles.empty() || one_in(40) ? nullptr : handles[below(handles.size())];
  }

 private:
  const std::uint8_t *data_, *end_;
  std::mt19937_64 random_;
};

/// Bundles and models, made once.
struct Stock {
  Stock() {
    const auto add = [&](const std::string& name, const test::BarOptions& options) {
      test::Bar bar = test::make_bar(options);
      bar.model.contact = test::surface_contact(bar.model);
      write_bundle(bar.model, folder / name);
      bundles.push_back(folder / name);
    };
    add("clamped.h5", {.cells = {2, 1, 1}, .linear_modes = 4, .eigenfunctions = 4, .examples = 3});
    add("free.h5", {.cells = {2, 1, 1}, .free = true, .linear_modes = 4, .eigenfunctions = 4, .examples = 2});
    for (const std::string& bundle : bundles)
      for (const int contact : {0, 1}) {
        exmat_settings settings;
        exmat_settings_default(&settings, sizeof settings);
        settings.time_step = 0.005;
        settings.use_contact = contact;
        settings.use_examples = 1;
        settings.example_stiffness = 100;
        settings.newton_iterations = 20;
        settings.gravity[1] = -9.81;
        models.emplace_back();
        if (exmat_model_create(bundle.c_str(), &settings, &models.back()) != EXMAT_OK) fault("model");
      }
  }
  ~Stock() {
    for (exmat_model* model : models) exmat_model_destroy(model);
  }
  Stock(const Stock&) = delete;
  Stock& operator=(const Stock&) = delete;

  test::TemporaryFolder folder;
  std::vector<std::string> bundles;
  std::vector<exmat_model*> models;
};

class Calls {
 public:
  Calls(Stock& stock, Choices& choices) : stock_(stock), choices_(choices), models_(stock.models) {}
  ~Calls() {
    for (exmat_capacity* capacity : capacities_) exmat_capacity_destroy(capacity);
    for (exmat_body* body : alone_) exmat_body_destroy(body);
    for (exmat_world* world : worlds_) exmat_world_destroy(world);
    for (exmat_points* points : points_) exmat_points_destroy(points);
    for (exmat_shape* shape : shapes_) exmat_shape_destroy(shape);
    for (exmat_surface* surface : surfaces_) exmat_surface_destroy(surface);
    for (std::size_t i = stock_.models.size(); i < models_.size(); ++i) exmat_model_destroy(models_[i]);
  }
  Calls(const Calls&) = delete;
  Calls& operator=(const Calls&) = delete;

  void call() {
    switch (choices_.below(8)) {
      case 0:
        return create();
      case 1:
        return destroy();
      case 2:
      case 3:
        return step();
      case 4:
        return set();
      case 5:
        return obstacle();
      case 6:
        return state();
      default:
        return read();
    }
  }

 private:
  exmat_status checked(exmat_status status) {
    if (status < EXMAT_OK || status > EXMAT_NON_FINITE) fault("a status that there is not");
    if (status != EXMAT_OK && exmat_last_error()[0] == 0) fault("a failure without a message");
    return status;
  }

  /// Keeps what was created.
  template <typename Handle, typename Create>
  void keep(std::vector<Handle*>& handles, std::size_t most, const Create& create) {
    if (handles.size() >= most) return;
    auto* made = reinterpret_cast<Handle*>(this);
    const exmat_status status = checked(create(&made));
    if ((status == EXMAT_OK) != (made != nullptr)) fault("a handle of a failure, or none of a success");
    if (made != nullptr) handles.push_back(made);
  }

  std::vector<exmat_world*> worlds() const {
    std::vector<exmat_world*> all = worlds_;
    for (const exmat_body* body : alone_) all.push_back(exmat_body_world(body));
    return all;
  }
  exmat_world* world() { return choices_.one_in(4) ? choices_.of(worlds()) : choices_.of(worlds_); }

  static std::vector<std::int64_t> ids_of(const exmat_world* world) {
    std::vector<std::int64_t> ids(static_cast<std::size_t>(std::max<std::int64_t>(exmat_world_bodies(world), 0)));
    exmat_world_read_body_ids(world, ids.data(), std::ssize(ids));
    return ids;
  }
  static std::vector<std::int64_t> obstacles_of(const exmat_world* world) {
    std::vector<std::int64_t> ids(static_cast<std::size_t>(std::max<std::int64_t>(exmat_world_obstacles(world), 0)));
    exmat_world_read_obstacle_ids(world, ids.data(), std::ssize(ids));
    return ids;
  }
  std::int64_t one_of(const std::vector<std::int64_t>& ids) {
    return ids.empty() || choices_.one_in(12) ? choices_.whole() : ids[choices_.below(ids.size())];
  }
  exmat_body* body() {
    std::vector<exmat_body*> all = alone_;
    for (const exmat_world* world : worlds_)
      for (const std::int64_t id : ids_of(world)) all.push_back(exmat_world_body(world, id));
    return choices_.of(all);
  }
  std::int64_t region(const exmat_body*) { return choices_.one_in(4) ? choices_.whole() : -1; }

  exmat_settings& settings(Padded<exmat_settings>& padded) {
    exmat_settings& made = padded.value;
    exmat_settings_default(&made, sizeof made);
    const std::array numbers{&made.time_step,         &made.gravity[0],        &made.gravity[2],
                             &made.mass_damping,      &made.stiffness_damping, &made.newton_tolerance,
                             &made.example_stiffness, &made.example_damping,   &made.example_bias,
                             &made.sleep_energy,      &made.sleep_time,        &made.space_release};
    const std::array counts{
        &made.newton_iterations, &made.integrator,       &made.internal_force, &made.use_examples, &made.example_target,
        &made.target_iterations, &made.energy_reference, &made.use_contact,    &made.precision,    &made.space};
    made.newton_iterations = 20;
    for (std::size_t changes = choices_.below(4); changes > 0; --changes) {
      *numbers[choices_.below(numbers.size())] = choices_.number();
      if (choices_.one_in(2)) *counts[choices_.below(counts.size())] = choices_.small();
    }
    choices_.size(made);
    return made;
  }

  exmat_contact_law& law(Padded<exmat_contact_law>& padded) {
    exmat_contact_law& made = padded.value;
    exmat_contact_law_default(&made, sizeof made);
    const std::array numbers{&made.stiffness, &made.damping, &made.friction, &made.release};
    for (std::size_t changes = choices_.below(3); changes > 0; --changes)
      *numbers[choices_.below(numbers.size())] = choices_.number();
    if (choices_.one_in(4)) made.self = choices_.small();
    if (choices_.one_in(8)) made.apart = choices_.small();
    choices_.size(made);
    return made;
  }

  exmat_motion& motion(Padded<exmat_motion>& padded) {
    exmat_motion& made = padded.value;
    made = {.size = sizeof made,
            .position = {},
            .orientation = {1, 0, 0, 0},
            .linear_velocity = {},
            .angular_velocity = {}};
    const std::array members{made.position, made.orientation, made.linear_velocity, made.angular_velocity};
    for (std::size_t changes = choices_.below(5); changes > 0; --changes)
      members[choices_.below(members.size())][choices_.below(3)] = choices_.number();
    choices_.size(made);
    return made;
  }

  exmat_obstacle& description(Padded<exmat_obstacle>& padded) {
    exmat_obstacle& made = padded.value;
    exmat_obstacle_default(&made, sizeof made);
    made.shape = static_cast<std::int32_t>(choices_.below(4));
    if (choices_.one_in(12)) made.shape = choices_.small();
    if (choices_.one_in(2)) made.point[1] = -0.5;
    const std::array vectors{made.point, made.direction, made.half_extents, made.orientation};
    const std::array numbers{&made.radius, &made.stiffness, &made.damping, &made.friction};
    for (std::size_t changes = choices_.below(4); changes > 0; --changes) {
      vectors[choices_.below(vectors.size())][choices_.below(3)] = choices_.number();
      *numbers[choices_.below(numbers.size())] = choices_.number();
    }
    if (choices_.one_in(4)) made.group = static_cast<std::uint32_t>(choices_.small());
    if (choices_.one_in(4)) made.mask = static_cast<std::uint32_t>(choices_.small());
    choices_.size(made);
    return made;
  }

  void create() {
    switch (choices_.below(12)) {
      case 0:
        if (!choices_.one_in(4)) return;  // it reads a file
        return keep(models_, stock_.models.size() + 1, [&](exmat_model** made) {
          Padded<exmat_settings> padded;
          const std::string& bundle = stock_.bundles[choices_.below(stock_.bundles.size())];
          return exmat_model_create(bundle.c_str(), &settings(padded), made);
        });
      case 1:
        return keep(worlds_, kMostWorlds, [&](exmat_world** made) {
          Padded<exmat_contact_law> padded;
          return exmat_world_create(choices_.one_in(4) ? nullptr : &law(padded), made);
        });
      case 2: {
        std::vector<std::int64_t> ids;
        for (std::size_t i = choices_.below(4); i > 0; --i) ids.push_back(choices_.whole());
        return keep(points_, kMostOthers, [&](exmat_points** made) {
          return exmat_points_create_vertices(choices_.of(models_), ids.data(), std::ssize(ids), made);
        });
      }
      case 3: {
        const std::vector<double> xyz = choices_.numbers(6);
        const std::int64_t count = choices_.one_in(4) ? std::min<std::int64_t>(choices_.whole(), 0) : 6;
        return keep(points_, kMostOthers, [&](exmat_points** made) {
          return exmat_points_create_at(choices_.of(models_), xyz.data(), std::min<std::int64_t>(count, 6), made);
        });
      }
      case 4:
        return keep(points_, kMostOthers, [&](exmat_points** made) {
          return choices_.one_in(2) ? exmat_points_create_all_vertices(choices_.of(models_), made)
                                    : exmat_points_create_elements(choices_.of(models_), made);
        });
      case 5:
        return keep(surfaces_, 2, [&](exmat_surface** made) {
          return exmat_surface_create(choices_.of(models_), choices_.small(), made);
        });
      case 6: {
        const std::array<std::int64_t, 2> triangles{choices_.whole(), choices_.whole()};
        std::vector<double> shares = choices_.numbers(6);
        if (choices_.one_in(2)) shares = {0.25, 0.25, 0.5, 1, 0, 0};
        return keep(points_, kMostOthers, [&](exmat_points** made) {
          return exmat_points_create_on_surface(choices_.of(surfaces_), triangles.data(), shares.data(),
                                                static_cast<std::int64_t>(choices_.below(3)), made);
        });
      }
      case 7: {
        std::vector<double> xyz{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
        std::vector<std::int32_t> corners{0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
        if (choices_.one_in(3)) xyz[choices_.below(12)] = choices_.number();
        if (choices_.one_in(3)) corners[choices_.below(12)] = choices_.small();
        const double thickness = choices_.one_in(2) ? 0 : choices_.number();
        return keep(shapes_, kMostOthers, [&](exmat_shape** made) {
          return exmat_shape_create_mesh(xyz.data(), std::min<std::int64_t>(choices_.length(12), 12), corners.data(),
                                         std::min<std::int64_t>(choices_.length(12), 12), thickness, made);
        });
      }
      case 8: {
        const std::vector<double> heights = choices_.numbers(6), spacing = choices_.numbers(2);
        const std::int64_t rows = choices_.one_in(6) ? std::min<std::int64_t>(choices_.whole(), 0) : 2;
        return keep(shapes_, kMostOthers, [&](exmat_shape** made) {
          return exmat_shape_create_height_field(heights.data(), std::min<std::int64_t>(rows, 2), 3, spacing.data(),
                                                 made);
        });
      }
      case 9:
        return keep(capacities_, 1, [&](exmat_capacity** made) {
          return exmat_capacity_create(choices_.of(models_), choices_.number(), made);
        });
      default:
        return keep(alone_, kMostBodies,
                    [&](exmat_body** made) { return exmat_body_create(choices_.of(models_), made); });
    }
  }

  template <typename Handle, typename Destroy>
  void drop(std::vector<Handle*>& handles, std::size_t first, const Destroy& destroy) {
    if (handles.size() <= first) return destroy(nullptr);
    const std::size_t place = first + choices_.below(handles.size() - first);
    destroy(handles[place]);
    handles.erase(handles.begin() + static_cast<std::ptrdiff_t>(place));
  }

  void destroy() {
    if (!choices_.one_in(3)) return join();
    switch (choices_.below(7)) {
      case 0:
        return drop(models_, stock_.models.size(), exmat_model_destroy);
      case 1:
        return drop(points_, 0, exmat_points_destroy);
      case 2:
        return drop(shapes_, 0, exmat_shape_destroy);
      case 3:
        return drop(surfaces_, 0, exmat_surface_destroy);
      case 4:
        return drop(capacities_, 0, exmat_capacity_destroy);
      case 5:
        return drop(worlds_, 0, exmat_world_destroy);
      default:
        return drop(alone_, 0, exmat_body_destroy);
    }
  }

  void join() {
    std::int64_t id = 0;
    if (choices_.one_in(3)) {
      exmat_world* from = world();
      exmat_body* left = nullptr;
      if (checked(exmat_world_remove_body(from, one_of(ids_of(from)), &left)) == EXMAT_OK) alone_.push_back(left);
      return;
    }
    exmat_body* joins = body();
    if (checked(exmat_world_add_body(world(), joins, &id)) == EXMAT_OK) std::erase(alone_, joins);
    if (choices_.one_in(8)) exmat_world_destroy(exmat_body_world(choices_.of(alone_)));  // a body's own: nothing
  }

  /// The state has finite numbers, and the body takes it again; one with numbers above 1e30, as of a body that flies
  /// off, it may refuse.
  void check_state(exmat_body* body) {
    std::vector<double> numbers(static_cast<std::size_t>(exmat_body_state_size(body)));
    if (exmat_body_read_state(body, numbers.data(), std::ssize(numbers)) != EXMAT_OK) fault("reading a state");
    const auto odd = std::ranges::find_if(numbers, [](double number) { return !std::isfinite(number); });
    if (odd != numbers.end()) {
      std::fprintf(stderr, "number %td of %zu: %g\n", odd - numbers.begin(), numbers.size(), *odd);
      fault("a state of numbers that are not finite");
    }
    const bool is_far = std::ranges::any_of(numbers, [](double number) { return std::abs(number) > 1e30; });
    if (exmat_body_set_state(body, numbers.data(), std::ssize(numbers)) != EXMAT_OK && !is_far)
      fault("taking a body's own state");
    exmat_energies energies{};
    energies.size = sizeof energies;
    if (exmat_body_read_energies(body, &energies) != EXMAT_OK) fault("reading energies");
  }

  void step() {
    const std::int64_t steps =
        choices_.one_in(8) ? std::min<std::int64_t>(choices_.whole(), 3) : static_cast<std::int64_t>(choices_.below(3));
    if (choices_.one_in(2)) {
      exmat_body* const one = choices_.of(alone_);
      Padded<exmat_report> report;
      report.value.size = sizeof report.value;
      choices_.size(report.value);
      const exmat_status status = checked(exmat_body_step(one, steps, choices_.one_in(4) ? nullptr : &report.value));
      if (status == EXMAT_OK && steps > 0) check_state(one);
      return;
    }
    exmat_world* const all = world();
    Padded<exmat_world_report> report;
    report.value.size = sizeof report.value;
    choices_.size(report.value);
    const exmat_status status = checked(
        exmat_world_step(all, steps, std::min(choices_.small(), 3), choices_.one_in(4) ? nullptr : &report.value));
    if (status == EXMAT_OK && steps > 0)
      for (const std::int64_t id : ids_of(all)) check_state(exmat_world_body(all, id));
  }

  void set() {
    exmat_body* const one = body();
    const std::int64_t modes = exmat_body_state_size(one) < 0 ? 1 : modes_of(one);
    switch (choices_.below(18)) {
      case 0: {
        const std::vector<double> q = choices_.numbers(modes), v = choices_.numbers(modes);
        checked(
            exmat_body_set_reduced(one, q.data(), choices_.one_in(12) ? nullptr : v.data(), choices_.length(modes)));
        return;
      }
      case 1:
      case 2: {
        exmat_points* const at = choices_.of(points_);
        const std::int64_t count = 3 * std::max<std::int64_t>(exmat_points_count(at), 0);
        const std::vector<double> forces = choices_.numbers(count);
        checked(choices_.one_in(4) ? exmat_body_apply_impulses(one, at, forces.data(), choices_.length(count))
                                   : exmat_body_apply_forces(one, at, forces.data(), choices_.length(count)));
        if (count == 3) checked(exmat_body_reach(one, at, forces.data(), count, nullptr));
        std::int64_t id = choices_.whole();
        if (choices_.one_in(2)) checked(exmat_body_add_forces(one, at, forces.data(), choices_.length(count), &id));
        if (choices_.one_in(2)) checked(exmat_body_set_forces(one, id, at, forces.data(), choices_.length(count)));
        if (choices_.one_in(2)) checked(exmat_body_remove_forces(one, choices_.one_in(2) ? id : choices_.whole()));
        return;
      }
      case 3:
      case 4: {
        Padded<exmat_motion> padded;
        checked(exmat_body_set_motion(one, &motion(padded)));
        return;
      }
      case 5:
        checked(exmat_body_set_gravity(one, choices_.numbers(3).data()));
        return;
      case 6:
        checked(exmat_body_set_damping(one, choices_.number(), choices_.number()));
        return;
      case 7:
        checked(exmat_body_set_integrator(one, choices_.small()));
        return;
      case 8:
        checked(exmat_body_set_space(one, choices_.small()));
        return;
      case 9:
        checked(exmat_body_set_example_stiffness(one, region(one), choices_.number()));
        return;
      case 10:
        checked(choices_.one_in(2) ? exmat_body_set_example_damping(one, region(one), choices_.number())
                                   : exmat_body_set_example_bias(one, region(one), choices_.number()));
        return;
      case 11: {
        std::vector<double> weights = choices_.numbers(3);
        if (choices_.one_in(2)) weights = {0.5, 0.5, 0};
        const std::int64_t count = std::min<std::int64_t>(choices_.one_in(2) ? 3 : choices_.whole(), 3);
        checked(exmat_body_set_example_weights(one, region(one), count == 0 ? nullptr : weights.data(), count));
        return;
      }
      case 12:
        checked(exmat_body_set_group(one, static_cast<std::uint32_t>(choices_.small()),
                                     static_cast<std::uint32_t>(choices_.small())));
        return;
      case 13:
        checked(choices_.one_in(2) ? exmat_body_reset(one) : exmat_body_restart_integrator(one));
        return;
      case 14: {
        Padded<exmat_contact_law> padded;
        checked(exmat_world_set_contact_law(world(), &law(padded)));
        return;
      }
      case 15: {
        exmat_attachment attachment;
        checked(exmat_attachment_default(&attachment, sizeof attachment));
        attachment.kind = choices_.one_in(2) ? 0 : choices_.small();
        if (choices_.one_in(2)) attachment.stiffness = choices_.number();
        if (choices_.one_in(2)) attachment.damping = choices_.number();
        if (choices_.one_in(4)) attachment.break_force = choices_.number();
        choices_.size(attachment);
        std::vector<std::int64_t> vertices(choices_.below(4) + 1);
        for (std::int64_t& vertex : vertices) vertex = choices_.one_in(2) ? choices_.whole() : 7 + choices_.whole();
        const auto right = static_cast<std::int64_t>(vertices.size());
        std::int64_t id = -1;
        checked(exmat_body_attach(one, vertices.data(), choices_.one_in(8) ? -right : right, &attachment,
                                  choices_.numbers(12).data(), choices_.one_in(12) ? nullptr : &id));
        checked(exmat_body_attach_to(one, vertices.data(), right, body(), vertices.data(), right, &attachment,
                                     choices_.one_in(12) ? nullptr : &id));
        return;
      }
      case 16: {
        const std::int64_t id = choices_.whole();
        std::array<double, 3> force{};
        checked(choices_.one_in(2)   ? exmat_body_move_attachment(one, id, choices_.numbers(12).data())
                : choices_.one_in(2) ? exmat_body_detach(one, id)
                                     : exmat_body_read_attachment_load(one, id, force.data(), nullptr, nullptr));
        checked(exmat_body_set_bones(one, choices_.numbers(12).data(), choices_.whole(), choices_.small()));
        return;
      }
      default:
        checked(choices_.one_in(2) ? exmat_body_clear_forces(one) : exmat_world_reset(world()));
        if (choices_.one_in(4)) checked(exmat_body_set_capacity(one, choices_.of(capacities_)));
    }
  }

  void obstacle() {
    exmat_world* const of = choices_.one_in(2) ? world() : exmat_body_world(body());
    const std::int64_t id = one_of(obstacles_of(of));
    Padded<exmat_obstacle> obstacle;
    Padded<exmat_motion> moved;
    std::int64_t added = 0;
    const bool room = exmat_world_obstacles(of) < 6;
    switch (choices_.below(8)) {
      case 0:
      case 1:
        if (room) checked(exmat_world_add_obstacle(of, &description(obstacle), &added));
        return;
      case 2:
        if (room) checked(exmat_world_add_shape(of, choices_.of(shapes_), &description(obstacle), &added));
        return;
      case 3:
        checked(exmat_world_remove_obstacle(of, id));
        return;
      case 4:
        checked(exmat_world_move_obstacle(of, id, &motion(moved)));
        return;
      case 5:
        checked(exmat_world_set_obstacle_law(of, id, choices_.number(), choices_.number(), choices_.number()));
        return;
      case 6: {
        obstacle.value.size = sizeof obstacle.value;
        moved.value.size = sizeof moved.value;
        choices_.size(obstacle.value);
        checked(exmat_world_read_obstacle(of, id, &obstacle.value, choices_.one_in(4) ? nullptr : &moved.value));
        std::array<double, 3> force{}, torque{};
        checked(exmat_world_read_obstacle_load(of, id, force.data(), torque.data()));
        return;
      }
      default: {
        const std::int64_t count = std::clamp<std::int64_t>(9 * exmat_world_obstacle_triangles(of, id), 0, 1000);
        std::vector<double> corners(static_cast<std::size_t>(count) + 1);
        checked(exmat_world_read_obstacle_triangles(of, id, corners.data(), choices_.length(count)));
      }
    }
  }

  void state() {
    exmat_body* const one = body();
    exmat_world* const all = world();
    const bool single = choices_.one_in(2);
    const std::int64_t size =
        std::max<std::int64_t>(single ? exmat_body_state_size(one) : exmat_world_state_size(all), 0);
    std::vector<double> numbers(static_cast<std::size_t>(size) + 2);
    const exmat_status status = checked(single ? exmat_body_read_state(one, numbers.data(), size)
                                               : exmat_world_read_state(all, numbers.data(), size));
    if (status != EXMAT_OK) return;
    for (std::size_t changes = choices_.below(3); changes > 0; --changes)
      numbers[choices_.below(numbers.size())] =
          choices_.one_in(2) ? choices_.number() : static_cast<double>(choices_.whole());
    const std::int64_t count = std::min(choices_.length(size), size + 2);
    checked(single ? exmat_body_set_state(one, numbers.data(), count)
                   : exmat_world_set_state(all, numbers.data(), count));
    std::vector<std::uint64_t> snapshot(exmat_world_snapshot_size(all) / sizeof(std::uint64_t));
    if (snapshot.empty()) return;
    checked(exmat_world_save(all, snapshot.data(), snapshot.size() * sizeof(std::uint64_t)));
    if (count != size) snapshot[static_cast<std::size_t>(size) % snapshot.size()] ^= 1;
    checked(exmat_world_restore(all, snapshot.data(), snapshot.size() * sizeof(std::uint64_t)));
  }

  static std::int64_t modes_of(const exmat_body* body) {
    exmat_model* model = nullptr;
    exmat_body_model(body, &model);
    const std::int64_t modes = exmat_model_modes(model);
    exmat_model_destroy(model);
    return modes;
  }

  void read() {
    const exmat_body* const one = body();
    const exmat_world* const all = world();
    const exmat_points* const at = choices_.of(points_);
    const std::int64_t k = std::max<std::int64_t>(exmat_points_count(at), 0);
    std::array<double, 4096> numbers{};
    std::array<float, 4096> floats{};
    const auto fits = [&](std::int64_t length) { return choices_.length(std::min<std::int64_t>(length, 4095)); };
    switch (choices_.below(12)) {
      case 0:
        checked(exmat_body_read_positions(const_cast<exmat_body*>(one), at, floats.data(), fits(3 * k)));
        return;
      case 1:
        if (one != nullptr) checked(exmat_body_read_reduced(one, numbers.data(), nullptr, fits(modes_of(one))));
        checked(exmat_points_distances(at, numbers.data(), fits(k)));
        return;
      case 2:
        checked(exmat_body_read_weights(one, numbers.data(), choices_.whole()));
        checked(exmat_body_read_region_weights(one, choices_.whole(), numbers.data(), choices_.whole()));
        return;
      case 3: {
        const std::int64_t count = std::clamp<std::int64_t>(exmat_body_contacts(one), 0, 20);
        std::vector<unsigned char> contacts(static_cast<std::size_t>(count + 1) * kStructBytes);
        const std::size_t size = choices_.one_in(8) ? choices_.below(kStructBytes) : sizeof(exmat_contact);
        checked(exmat_body_read_contacts(one, reinterpret_cast<exmat_contact*>(contacts.data()), choices_.length(count),
                                         size));
        return;
      }
      case 4: {
        const std::int64_t count = std::clamp<std::int64_t>(exmat_world_contacts(all), 0, 20);
        std::vector<unsigned char> contacts(static_cast<std::size_t>(count + 1) * kStructBytes);
        const std::size_t size = choices_.one_in(8) ? choices_.below(kStructBytes) : sizeof(exmat_body_contact);
        checked(exmat_world_read_contacts(all, reinterpret_cast<exmat_body_contact*>(contacts.data()),
                                          choices_.length(count), size));
        const std::int64_t touched = std::clamp<std::int64_t>(exmat_world_touches(all), 0, 20);
        std::vector<exmat_touch> touches(static_cast<std::size_t>(touched + 1));
        checked(exmat_world_read_touches(all, touches.data(), choices_.length(touched), sizeof(exmat_touch)));
        return;
      }
      case 5: {
        checked(exmat_body_read_contact_load(one, choices_.one_in(2) ? -1 : choices_.whole(), numbers.data(), nullptr));
        checked(exmat_body_read_placement(one, numbers.data()));
        checked(exmat_body_read_point_compliance(one, at, numbers.data()));
        checked(exmat_body_read_compliance(one, at, nullptr, nullptr, choices_.length(3 * k)));
        std::vector<double> sensitivity(static_cast<std::size_t>(6 * k));
        checked(exmat_body_read_sensitivity(one, -1, at, sensitivity.data(), 6 * k));
        return;
      }
      case 6: {
        Padded<exmat_energies> energies;
        energies.value.size = sizeof energies.value;
        choices_.size(energies.value);
        checked(choices_.one_in(2) ? exmat_body_read_energies(one, &energies.value)
                                   : exmat_world_read_energies(all, &energies.value));
        return;
      }
      case 7: {
        exmat_surface* const surface = choices_.of(surfaces_);
        const std::int64_t count = std::max<std::int64_t>(exmat_points_count(exmat_surface_points(surface)), 0);
        checked(exmat_body_read_energy_density(one, surface, floats.data(), fits(count)));
        std::int64_t hit = 0;
        const std::vector<double> ray = choices_.numbers(7);
        checked(exmat_body_cast_ray(one, surface, ray.data(), ray.data() + 3, ray[6], &hit, numbers.data(),
                                    numbers.data() + 3, numbers.data() + 4));
        const std::array<const exmat_surface*, 2> surfaces{surface, choices_.of(surfaces_)};
        Padded<exmat_ray_hit> met;
        met.value.size = sizeof met.value;
        choices_.size(met.value);
        checked(exmat_world_cast_ray(all, surfaces.data(), std::min<std::int64_t>(choices_.length(2), 2), ray.data(),
                                     ray.data() + 3, ray[6], &met.value));
        std::array<std::int32_t, 4096> triangles{};
        checked(exmat_surface_read_triangles(surface, triangles.data(),
                                             fits(std::max<std::int64_t>(3 * exmat_surface_triangles(surface), 0))));
        return;
      }
      case 8: {
        const exmat_model* const model = choices_.of(models_);
        const std::int64_t example = choices_.whole(), of = choices_.one_in(2) ? -1 : choices_.whole();
        exmat_model_example_name(model, of, example);
        checked(exmat_model_read_example_pose(model, of, example, numbers.data(),
                                              fits(std::max<std::int64_t>(exmat_model_modes(model), 0))));
        exmat_model_region_name(model, choices_.whole());
        checked(exmat_model_read_element_weights(model, numbers.data(),
                                                 fits(std::max<std::int64_t>(exmat_model_elements(model), 0))));
        return;
      }
      case 9: {
        std::uint64_t hash = 0;
        checked(choices_.one_in(2) ? exmat_world_hash(all, &hash)
                                   : exmat_bodies_hash(alone_.data(), std::ssize(alone_), &hash));
        return;
      }
      case 10: {
        Padded<exmat_motion> moved;
        moved.value.size = sizeof moved.value;
        choices_.size(moved.value);
        checked(exmat_body_read_motion(one, &moved.value));
        if (one != nullptr) checked(exmat_body_read_target(one, region(one), numbers.data(), fits(modes_of(one))));
        return;
      }
      default: {
        const std::vector<double> forces = choices_.numbers(3 * k);
        double lost = 0;
        checked(
            exmat_capacity_read_lost(choices_.of(capacities_), one, at, forces.data(), choices_.length(3 * k), &lost));
        checked(exmat_capacity_read_contact_lost(choices_.of(capacities_), one, &lost));
      }
    }
  }

  Stock& stock_;
  Choices& choices_;
  std::vector<exmat_model*> models_;
  std::vector<exmat_body*> alone_;  ///< in worlds of their own
  std::vector<exmat_world*> worlds_;
  std::vector<exmat_points*> points_;
  std::vector<exmat_shape*> shapes_;
  std::vector<exmat_surface*> surfaces_;
  std::vector<exmat_capacity*> capacities_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Stock stock;
  Choices choices(data, size);
  Calls calls(stock, choices);
  for (int i = 0; i < kCalls; ++i) calls.call();
  return 0;
}
