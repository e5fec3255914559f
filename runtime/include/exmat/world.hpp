// world.h for C++20. A part of exmat.hpp, which includes it.
#ifndef EXMAT_WORLD_HPP
#define EXMAT_WORLD_HPP

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "exmat/exmat.hpp"

namespace exmat {

inline exmat_contact_law default_contact_law() {
  exmat_contact_law law;
  check(exmat_contact_law_default(&law, sizeof law));
  return law;
}

/// A world that something else owns: a World, or a body whose own it is. Copied as a reference is.
class WorldRef {
 public:
  explicit WorldRef(exmat_world* world) noexcept : world_(world) {}

  exmat_contact_law contact_law() const {
    exmat_contact_law law;
    law.size = sizeof law;
    check(exmat_world_read_contact_law(get(), &law));
    return law;
  }
  void set_contact_law(exmat_contact_law law) {
    law.size = sizeof law;
    check(exmat_world_set_contact_law(get(), &law));
  }

  void set_full_bodies(std::int32_t most) { check(exmat_world_set_full_bodies(get(), most)); }

  std::size_t size() const noexcept { return static_cast<std::size_t>(exmat_world_bodies(get())); }
  std::vector<std::int64_t> ids() const {
    std::vector<std::int64_t> ids(size());
    check(exmat_world_read_body_ids(get(), ids.data(), static_cast<std::int64_t>(ids.size())));
    return ids;
  }
  /// The body of an id of ids().
  BodyRef body(std::int64_t id) const noexcept { return BodyRef(exmat_world_body(get(), id)); }
  std::string name(std::int64_t id) const { return exmat_world_body_name(get(), id); }
  std::int64_t kind(std::int64_t id) const noexcept { return exmat_world_body_kind(get(), id); }

  /// All bodies at rest at time 0.
  void reset() { check(exmat_world_reset(get())); }

  /// By up to `threads` threads, 0: as many as there are processors.
  exmat_world_report step(std::int64_t steps = 1, int threads = 0) {
    exmat_world_report report;
    report.size = sizeof report;
    check(exmat_world_step(get(), steps, threads, &report));
    return report;
  }

  std::vector<exmat_body_contact> contacts() const {
    std::vector<exmat_body_contact> contacts(static_cast<std::size_t>(exmat_world_contacts(get())));
    check(exmat_world_read_contacts(get(), contacts.data(), static_cast<std::int64_t>(contacts.size()),
                                    sizeof(exmat_body_contact)));
    return contacts;
  }
  std::vector<exmat_touch> touches() const {
    std::vector<exmat_touch> touches(static_cast<std::size_t>(exmat_world_touches(get())));
    check(exmat_world_read_touches(get(), touches.data(), static_cast<std::int64_t>(touches.size()),
                                   sizeof(exmat_touch)));
    return touches;
  }
  /// The first triangle of all bodies that a ray from `origin` [m] along `direction` meets within `most` [m], from
  /// either side, or the obstacle that it enters before. Bodies have those of `surfaces` that are of their model.
  std::optional<RayHit> cast_ray(std::span<const Surface* const> surfaces, std::span<const double, 3> origin,
                                 std::span<const double, 3> direction,
                                 double most = std::numeric_limits<double>::infinity()) const {
    std::vector<const exmat_surface*> handles;
    for (const Surface* surface : surfaces) handles.push_back(surface->get());
    exmat_ray_hit hit;
    hit.size = sizeof hit;
    const auto count = static_cast<std::int64_t>(handles.size());
    check(exmat_world_cast_ray(get(), handles.data(), count, origin.data(), direction.data(), most, &hit));
    if (hit.body < 0 && hit.obstacle < 0) return std::nullopt;
    return RayHit{
        hit.triangle, std::to_array(hit.shares), hit.distance, std::to_array(hit.normal), hit.body, hit.surface,
        hit.obstacle};
  }
  exmat_energies energies() const {
    exmat_energies energies;
    energies.size = sizeof energies;
    check(exmat_world_read_energies(get(), &energies));
    return energies;
  }
  std::uint64_t hash() const {
    std::uint64_t hash = 0;
    check(exmat_world_hash(get(), &hash));
    return hash;
  }

  std::vector<double> state() const {
    std::vector<double> numbers(static_cast<std::size_t>(exmat_world_state_size(get())));
    check(exmat_world_read_state(get(), numbers.data(), static_cast<std::int64_t>(numbers.size())));
    return numbers;
  }
  void set_state(std::span<const double> numbers) {
    check(exmat_world_set_state(get(), numbers.data(), detail::length(numbers)));
  }

  /// Saves a snapshot for rollback, into memory that is used again: grown where it is too small.
  void save(std::vector<std::uint64_t>& snapshot) const {
    const std::size_t bytes = exmat_world_snapshot_size(get());
    if (snapshot.size() * sizeof(std::uint64_t) < bytes) snapshot.resize(2 * bytes / sizeof(std::uint64_t));
    check(exmat_world_save(get(), snapshot.data(), snapshot.size() * sizeof(std::uint64_t)));
  }
  void restore(std::span<const std::uint64_t> snapshot) {
    check(exmat_world_restore(get(), snapshot.data(), snapshot.size_bytes()));
  }

  /// Its id. Sets obstacle.size itself, as the functions below do.
  std::int64_t add_obstacle(exmat_obstacle obstacle) {
    obstacle.size = sizeof obstacle;
    std::int64_t id = -1;
    check(exmat_world_add_obstacle(get(), &obstacle, &id));
    return id;
  }
  /// Adds an obstacle of that shape with the law, point and orientation of `obstacle`.
  std::int64_t add_shape(const Shape& shape, exmat_obstacle obstacle) {
    obstacle.size = sizeof obstacle;
    std::int64_t id = -1;
    check(exmat_world_add_shape(get(), shape.get(), &obstacle, &id));
    return id;
  }
  void remove_obstacle(std::int64_t id) { check(exmat_world_remove_obstacle(get(), id)); }
  void move_obstacle(std::int64_t id, exmat_motion motion) {
    motion.size = sizeof motion;
    check(exmat_world_move_obstacle(get(), id, &motion));
  }
  void set_obstacle_law(std::int64_t id, double stiffness, double damping, double friction) {
    check(exmat_world_set_obstacle_law(get(), id, stiffness, damping, friction));
  }
  std::vector<std::int64_t> obstacle_ids() const {
    std::vector<std::int64_t> ids(static_cast<std::size_t>(exmat_world_obstacles(get())));
    check(exmat_world_read_obstacle_ids(get(), ids.data(), static_cast<std::int64_t>(ids.size())));
    return ids;
  }
  exmat_obstacle obstacle(std::int64_t id) const {
    exmat_obstacle obstacle;
    obstacle.size = sizeof obstacle;
    check(exmat_world_read_obstacle(get(), id, &obstacle, nullptr));
    return obstacle;
  }
  exmat_motion obstacle_motion(std::int64_t id) const {
    exmat_motion motion;
    motion.size = sizeof motion;
    check(exmat_world_read_obstacle(get(), id, nullptr, &motion));
    return motion;
  }
  /// [9f], three corners of each triangle of a mesh or of ground, in the obstacle's frame; empty of other shapes.
  std::vector<double> obstacle_triangles(std::int64_t id) const {
    const std::int64_t triangles = exmat_world_obstacle_triangles(get(), id);
    std::vector<double> corners(9 * static_cast<std::size_t>(triangles > 0 ? triangles : 0));
    check(exmat_world_read_obstacle_triangles(get(), id, corners.data(), static_cast<std::int64_t>(corners.size())));
    return corners;
  }
  /// Reads the load of all bodies' contacts on an obstacle; force and torque [3] each, either may be null.
  void read_obstacle_load(std::int64_t id, double* force, double* torque) const {
    check(exmat_world_read_obstacle_load(get(), id, force, torque));
  }
  double time() const noexcept { return exmat_world_time(get()); }
  void set_profiled(bool profiled) { check(exmat_world_set_profiled(get(), profiled ? 1 : 0)); }
  exmat_profile profile() const {
    exmat_profile profile;
    profile.size = sizeof profile;
    check(exmat_world_read_profile(get(), &profile));
    return profile;
  }

  exmat_world* get() const noexcept { return world_; }

 protected:
  exmat_world* world_;
};

/// Bodies that are stepped together. It owns them.
class World : public WorldRef {
 public:
  World() : World(default_contact_law()) {}
  /// Sets law.size itself.
  explicit World(exmat_contact_law law) : WorldRef(nullptr) {
    law.size = sizeof law;
    check(exmat_world_create(&law, &world_));
    handle_.reset(world_);
  }
  /// Loads a scene file.
  static World from_scene(const std::string& scene) {
    exmat_world* world = nullptr;
    check(exmat_world_create_from_scene(detail::c_text(scene), &world));
    return World(world);
  }
  /// Loads the text of such a file, which `path` names.
  static World from_text(const std::string& scene, const std::string& path, bool use_contact = false) {
    exmat_world* world = nullptr;
    check(exmat_world_create_from_text(detail::c_text(scene), detail::c_text(path), use_contact ? 1 : 0, &world));
    return World(world);
  }

  /// Its id.
  std::int64_t add(Body body) {
    std::int64_t id = -1;
    check(exmat_world_add_body(get(), body.get(), &id));
    body.release();
    return id;
  }
  Body remove(std::int64_t id) {
    exmat_body* body = nullptr;
    check(exmat_world_remove_body(get(), id, &body));
    return Body(body);
  }

  World(World&& other) noexcept : WorldRef(std::exchange(other.world_, nullptr)), handle_(std::move(other.handle_)) {}
  World& operator=(World&& other) noexcept {
    handle_ = std::move(other.handle_);
    world_ = std::exchange(other.world_, nullptr);
    return *this;
  }

 private:
  explicit World(exmat_world* world) : WorldRef(world), handle_(world) {}
  Owner<exmat_world, exmat_world_destroy> handle_;
};

inline WorldRef BodyRef::world() const noexcept { return WorldRef(exmat_body_world(get())); }

}  // namespace exmat

#endif
