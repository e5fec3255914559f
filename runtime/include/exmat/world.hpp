// world.h for C++20. A part of exmat.hpp, which includes it.
#ifndef EXMAT_WORLD_HPP
#define EXMAT_WORLD_HPP

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "exmat/exmat.hpp"

namespace exmat {

inline exmat_contact_law default_contact_law() {
  exmat_contact_law law;
  detail::check(exmat_contact_law_default(&law, sizeof law));
  return law;
}

/// Bodies that touch each other. It owns them.
class World {
 public:
  World() : World(default_contact_law()) {}
  /// Sets law.size itself.
  explicit World(exmat_contact_law law) {
    law.size = sizeof law;
    exmat_world* world = nullptr;
    detail::check(exmat_world_create(&law, &world));
    handle_.reset(world);
  }
  /// Of a scene file of several bodies.
  static World from_scene(const std::string& scene) {
    exmat_world* world = nullptr;
    detail::check(exmat_world_create_from_scene(scene.c_str(), &world));
    return World(world);
  }
  /// Of the text of such a file, which `path` names.
  static World from_text(const std::string& scene, const std::string& path) {
    exmat_world* world = nullptr;
    detail::check(exmat_world_create_from_text(scene.c_str(), path.c_str(), &world));
    return World(world);
  }

  exmat_contact_law contact_law() const {
    exmat_contact_law law;
    law.size = sizeof law;
    detail::check(exmat_world_read_contact_law(get(), &law));
    return law;
  }
  void set_contact_law(exmat_contact_law law) {
    law.size = sizeof law;
    detail::check(exmat_world_set_contact_law(get(), &law));
  }

  /// Its id.
  std::int64_t add(Body body) {
    std::int64_t id = -1;
    detail::check(exmat_world_add_body(get(), body.get(), &id));
    body.release();
    return id;
  }
  Body remove(std::int64_t id) {
    exmat_body* body = nullptr;
    detail::check(exmat_world_remove_body(get(), id, &body));
    return Body(body);
  }
  std::size_t size() const noexcept { return static_cast<std::size_t>(exmat_world_bodies(get())); }
  std::vector<std::int64_t> ids() const {
    std::vector<std::int64_t> ids(size());
    detail::check(exmat_world_read_body_ids(get(), ids.data(), static_cast<std::int64_t>(ids.size())));
    return ids;
  }
  /// Of an id of ids().
  BodyRef body(std::int64_t id) const noexcept { return BodyRef(exmat_world_body(get(), id)); }
  std::string name(std::int64_t id) const { return exmat_world_body_name(get(), id); }
  std::int64_t kind(std::int64_t id) const noexcept { return exmat_world_body_kind(get(), id); }

  /// By up to `threads` threads, 0: as many as there are processors.
  exmat_world_report step(std::int64_t steps = 1, int threads = 0) {
    exmat_world_report report;
    report.size = sizeof report;
    detail::check(exmat_world_step(get(), steps, threads, &report));
    return report;
  }

  std::vector<exmat_body_contact> contacts() const {
    std::vector<exmat_body_contact> contacts(static_cast<std::size_t>(exmat_world_contacts(get())));
    detail::check(exmat_world_read_contacts(get(), contacts.data(), static_cast<std::int64_t>(contacts.size()),
                                            sizeof(exmat_body_contact)));
    return contacts;
  }
  exmat_energies energies() const {
    exmat_energies energies;
    energies.size = sizeof energies;
    detail::check(exmat_world_read_energies(get(), &energies));
    return energies;
  }
  std::uint64_t hash() const {
    std::uint64_t hash = 0;
    detail::check(exmat_world_hash(get(), &hash));
    return hash;
  }

  std::vector<double> state() const {
    std::vector<double> numbers(static_cast<std::size_t>(exmat_world_state_size(get())));
    detail::check(exmat_world_read_state(get(), numbers.data(), static_cast<std::int64_t>(numbers.size())));
    return numbers;
  }
  void set_state(std::span<const double> numbers) {
    detail::check(exmat_world_set_state(get(), numbers.data(), detail::length(numbers)));
  }

  exmat_world* get() const noexcept { return handle_.get(); }

 private:
  explicit World(exmat_world* world) : handle_(world) {}
  detail::Owner<exmat_world, exmat_world_destroy> handle_;
};

}  // namespace exmat

#endif
