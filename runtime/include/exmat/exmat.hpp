// exmat.h for C++20: handles that own, exceptions instead of codes, spans instead of pointers and lengths. A thin
// header over the C interface; what the functions do is said there.
#ifndef EXMAT_EXMAT_HPP
#define EXMAT_EXMAT_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "exmat/exmat.h"

namespace exmat {

/// A status that a function of exmat.h returned, with its message.
class Error : public std::runtime_error {
 public:
  Error(exmat_status status, const char* message) : std::runtime_error(message), status_(status) {}
  exmat_status status() const noexcept { return status_; }

 private:
  exmat_status status_;
};

/// Throws an Error unless a function of exmat.h returned EXMAT_OK.
inline void check(exmat_status status) {
  if (status != EXMAT_OK) throw Error(status, exmat_last_error());
}

namespace detail {

/// As C takes it, which would end at a zero byte. Throws Error where there is one.
inline const char* c_text(const std::string& text) {
  if (text.find('\0') != std::string::npos)
    throw Error(EXMAT_INVALID_ARGUMENT, (std::string(text.c_str()) + ": expected text, found a zero byte").c_str());
  return text.c_str();
}

template <auto Destroy>
struct Destroyer {
  template <typename Handle>
  void operator()(Handle* handle) const noexcept {
    Destroy(handle);
  }
};

template <typename T>
std::int64_t length(std::span<T> numbers) noexcept {
  return static_cast<std::int64_t>(numbers.size());
}

}  // namespace detail

/// A handle that is destroyed by the matching function.
template <typename Handle, auto Destroy>
using Owner = std::unique_ptr<Handle, detail::Destroyer<Destroy>>;

inline exmat_settings default_settings() {
  exmat_settings settings;
  check(exmat_settings_default(&settings, sizeof settings));
  return settings;
}

inline exmat_attachment default_attachment() {
  exmat_attachment attachment;
  check(exmat_attachment_default(&attachment, sizeof attachment));
  return attachment;
}

inline exmat_reach default_reach() {
  exmat_reach reach;
  check(exmat_reach_default(&reach, sizeof reach));
  return reach;
}

/// On the frame of an attachment [N], about its origin [N m].
struct AttachmentLoad {
  std::array<double, 3> force{}, torque{};
  bool broken = false;
};

inline exmat_obstacle default_obstacle() {
  exmat_obstacle obstacle;
  check(exmat_obstacle_default(&obstacle, sizeof obstacle));
  return obstacle;
}

/// Energy [J], its derivative [r] and Hessian [r x r] by the reduced coordinates.
struct Elasticity {
  double energy = 0;
  std::vector<double> force, tangent;
};

/// A point of a surface, or of an obstacle, that a ray meets.
struct RayHit {
  std::int64_t triangle = -1;
  std::array<double, 3> shares{};  ///< of its corners, sum 1, as Points::on_surface() takes them
  double distance = 0;             ///< [m]
  std::array<double, 3> normal{};  ///< outward, of length 1
  std::int64_t body = -1;          ///< of a ray through a world: the id of the body that it meets
  std::int64_t surface = 0;        ///< likewise: the number of its surface among those that were given
  std::int64_t obstacle = -1;      ///< likewise: the id of the obstacle, of which triangle, body and surface are -1
};

/// A square sparse matrix: row i has the entries from starts[i] to starts[i + 1], their columns ascending.
struct CompressedRows {
  std::vector<std::int64_t> starts, columns;
  std::vector<double> values;
};

/// A bundle prepared for stepping. All of these are moved, not copied; one that was moved from is empty.
class Model {
 public:
  explicit Model(const std::string& bundle) : Model(bundle, default_settings()) {}
  Model(const std::string& bundle, const exmat_settings& settings) {
    exmat_model* model = nullptr;
    check(exmat_model_create(detail::c_text(bundle), &settings, &model));
    handle_.reset(model);
  }
  /// Loads a pack of a bundle; the library keeps a copy of it.
  static Model from_memory(std::span<const std::byte> pack, const exmat_settings& settings = default_settings()) {
    exmat_model* model = nullptr;
    check(exmat_model_create_from_memory(pack.data(), pack.size(), &settings, &model));
    return Model(model);
  }
  static Model from_scene(const std::string& scene) {
    exmat_model* model = nullptr;
    check(exmat_model_create_from_scene(detail::c_text(scene), &model));
    return Model(model);
  }

  /// Loads the text of a scene file; `path` names it.
  static Model from_text(const std::string& scene, const std::string& path, bool use_contact = false) {
    exmat_model* model = nullptr;
    check(exmat_model_create_from_text(detail::c_text(scene), detail::c_text(path), use_contact ? 1 : 0, &model));
    return Model(model);
  }

  std::size_t modes() const noexcept { return static_cast<std::size_t>(exmat_model_modes(get())); }
  std::size_t vertices() const noexcept { return static_cast<std::size_t>(exmat_model_vertices(get())); }
  std::size_t examples() const noexcept { return static_cast<std::size_t>(exmat_model_examples(get())); }
  std::size_t regions() const noexcept { return static_cast<std::size_t>(exmat_model_regions(get())); }
  /// Number of examples of region < regions().
  std::size_t region_examples(std::size_t region) const noexcept {
    return static_cast<std::size_t>(exmat_model_region_examples(get(), static_cast<std::int64_t>(region)));
  }
  std::string region_name(std::size_t region) const {
    return exmat_model_region_name(get(), static_cast<std::int64_t>(region));
  }
  /// Name of an example of the whole body, -1, or of a region.
  std::string example_name(std::int64_t region, std::size_t example) const {
    const char* name = exmat_model_example_name(get(), region, static_cast<std::int64_t>(example));
    return name != nullptr ? name : "";
  }
  /// [r]
  std::vector<double> example_pose(std::int64_t region, std::size_t example) const {
    std::vector<double> q(modes());
    check(exmat_model_read_example_pose(get(), region, static_cast<std::int64_t>(example), q.data(),
                                        static_cast<std::int64_t>(q.size())));
    return q;
  }
  /// [s], of the cubature elements.
  std::vector<double> element_weights() const {
    std::vector<double> weights(static_cast<std::size_t>(exmat_model_elements(get())));
    check(exmat_model_read_element_weights(get(), weights.data(), static_cast<std::int64_t>(weights.size())));
    return weights;
  }
  /// At `q` [r].
  Elasticity elasticity(std::span<const double> q) const;
  /// EXMAT_MASS or EXMAT_STIFFNESS.
  CompressedRows matrix(std::int32_t kind) const;
  /// Bones of the skeleton, and its animations; 0 of both without one.
  std::size_t bones() const noexcept { return static_cast<std::size_t>(exmat_model_bones(get())); }
  std::size_t animations() const noexcept { return static_cast<std::size_t>(exmat_model_animations(get())); }
  /// bone < bones(); parent -1 of a root.
  std::string bone_name(std::size_t bone) const {
    return exmat_model_bone_name(get(), static_cast<std::int64_t>(bone));
  }
  std::int64_t bone_parent(std::size_t bone) const noexcept {
    return exmat_model_bone_parent(get(), static_cast<std::int64_t>(bone));
  }
  /// [12 bones()] where the mesh is at rest.
  std::vector<double> bound_bones() const {
    std::vector<double> transforms(12 * bones());
    check(exmat_model_read_bones(get(), transforms.data(), static_cast<std::int64_t>(transforms.size())));
    return transforms;
  }
  /// animation < animations(); its name, its duration [s] and its bones [12 bones()] at a time.
  std::string animation_name(std::size_t animation) const {
    return exmat_model_animation_name(get(), static_cast<std::int64_t>(animation));
  }
  double animation_duration(std::size_t animation) const noexcept {
    return exmat_model_animation_duration(get(), static_cast<std::int64_t>(animation));
  }
  std::vector<double> animated_bones(std::size_t animation, double time) const {
    std::vector<double> transforms(12 * bones());
    check(exmat_model_read_animation(get(), static_cast<std::int64_t>(animation), time, transforms.data(),
                                     static_cast<std::int64_t>(transforms.size())));
    return transforms;
  }
  double time_step() const noexcept { return exmat_model_time_step(get()); }
  std::string input_sha256() const { return exmat_model_input_sha256(get()); }

  const exmat_model* get() const noexcept { return handle_.get(); }

  /// Takes it over.
  explicit Model(exmat_model* model) noexcept : handle_(model) {}

 private:
  Owner<exmat_model, exmat_model_destroy> handle_;
};

class Surface;
class Capacity;
class WorldRef;

/// k material points of a model's body.
class Points {
 public:
  static Points vertices(const Model& model, std::span<const std::int64_t> ids) {
    exmat_points* points = nullptr;
    check(exmat_points_create_vertices(model.get(), ids.data(), detail::length(ids), &points));
    return Points(points);
  }
  /// To be read, not to be pushed.
  static Points all_vertices(const Model& model) {
    exmat_points* points = nullptr;
    check(exmat_points_create_all_vertices(model.get(), &points));
    return Points(points);
  }
  /// `xyz` [3k], in the rest shape.
  static Points at(const Model& model, std::span<const double> xyz) {
    exmat_points* points = nullptr;
    check(exmat_points_create_at(model.get(), xyz.data(), detail::length(xyz), &points));
    return Points(points);
  }

  /// On `triangles` [k] of a surface, with the `shares` [3k] of their corners.
  static Points on_surface(const Surface& surface, std::span<const std::int64_t> triangles,
                           std::span<const double> shares);
  /// Centroids of the cubature elements.
  static Points elements(const Model& model) {
    exmat_points* points = nullptr;
    check(exmat_points_create_elements(model.get(), &points));
    return Points(points);
  }

  std::size_t size() const noexcept { return static_cast<std::size_t>(exmat_points_count(get())); }
  /// [3k] X, at rest.
  std::vector<double> rest() const {
    std::vector<double> xyz(3 * size());
    check(exmat_points_read_rest(get(), xyz.data(), static_cast<std::int64_t>(xyz.size())));
    return xyz;
  }
  /// [3k x r] U, of a model with so many modes.
  std::vector<float> basis(std::size_t modes) const {
    std::vector<float> rows(3 * size() * modes);
    check(exmat_points_read_basis(get(), rows.data(), static_cast<std::int64_t>(rows.size())));
    return rows;
  }
  /// [k], from the object at rest.
  std::vector<double> distances() const {
    std::vector<double> distances(size());
    check(exmat_points_distances(get(), distances.data(), static_cast<std::int64_t>(distances.size())));
    return distances;
  }

  const exmat_points* get() const noexcept { return handle_.get(); }

 private:
  explicit Points(exmat_points* points) : handle_(points) {}
  Owner<exmat_points, exmat_points_destroy> handle_;
};

/// A mesh or a height field made of arrays, which any number of obstacles share.
class Shape {
 public:
  /// Closed, or with a thickness > 0 [m] a shell: `vertices` [3k] [m], `triangles` [3f].
  static Shape mesh(std::span<const double> vertices, std::span<const std::int32_t> triangles, double thickness = 0) {
    exmat_shape* shape = nullptr;
    check(exmat_shape_create_mesh(vertices.data(), detail::length(vertices), triangles.data(),
                                  detail::length(triangles), thickness, &shape));
    return Shape(shape);
  }
  /// `heights` [rows x columns] [m], `spacing` of columns and of rows [m].
  static Shape height_field(std::span<const double> heights, std::int64_t columns, std::array<double, 2> spacing) {
    exmat_shape* shape = nullptr;
    const std::int64_t rows = columns > 0 ? detail::length(heights) / columns : 0;
    check(exmat_shape_create_height_field(heights.data(), rows, columns, spacing.data(), &shape));
    return Shape(shape);
  }

  const exmat_shape* get() const noexcept { return handle_.get(); }

 private:
  explicit Shape(exmat_shape* shape) : handle_(shape) {}
  Owner<exmat_shape, exmat_shape_destroy> handle_;
};

/// A body that something else owns: a Body, or a World. Copied as a reference is.
class BodyRef {
 public:
  explicit BodyRef(exmat_body* body) noexcept : body_(body) {}

  Model model() const {
    exmat_model* model = nullptr;
    check(exmat_body_model(get(), &model));
    return Model(model);
  }

  /// The world that it is in: its own, where it is in no other.
  WorldRef world() const noexcept;
  void set_group(std::uint32_t group, std::uint32_t mask) { check(exmat_body_set_group(get(), group, mask)); }

  void reset() { check(exmat_body_reset(get())); }
  void set_reduced(std::span<const double> q, std::span<const double> v) {
    if (q.size() != v.size()) throw Error(EXMAT_INVALID_ARGUMENT, "set_reduced: q and v differ in length");
    check(exmat_body_set_reduced(get(), q.data(), v.data(), detail::length(q)));
  }

  exmat_report step(std::int64_t steps = 1) {
    exmat_report report;
    report.size = sizeof report;
    check(exmat_body_step(get(), steps, &report));
    return report;
  }
  /// Report of the last steps, also where they threw.
  exmat_report report() const {
    exmat_report report;
    report.size = sizeof report;
    check(exmat_body_read_report(get(), &report));
    return report;
  }

  /// `forces` [3k].
  void apply_forces(const Points& points, std::span<const double> forces) {
    check(exmat_body_apply_forces(get(), points.get(), forces.data(), detail::length(forces)));
  }
  void clear_forces() { check(exmat_body_clear_forces(get())); }
  /// Adds forces [3k] [N] that can be changed and removed. Returns their id.
  std::int64_t add_forces(const Points& points, std::span<const double> forces) {
    std::int64_t id = -1;
    check(exmat_body_add_forces(get(), points.get(), forces.data(), detail::length(forces), &id));
    return id;
  }
  void set_forces(std::int64_t id, const Points& points, std::span<const double> forces) {
    check(exmat_body_set_forces(get(), id, points.get(), forces.data(), detail::length(forces)));
  }
  void remove_forces(std::int64_t id) { check(exmat_body_remove_forces(get(), id)); }
  void restart_integrator() { check(exmat_body_restart_integrator(get())); }

  exmat_motion motion() const {
    exmat_motion motion;
    motion.size = sizeof motion;
    check(exmat_body_read_motion(get(), &motion));
    return motion;
  }
  /// Sets motion.size itself.
  void set_motion(exmat_motion motion) {
    motion.size = sizeof motion;
    check(exmat_body_set_motion(get(), &motion));
  }

  /// `xyz` [3k].
  double point_compliance(const Points& points) const {
    double compliance = 0;
    check(exmat_body_read_point_compliance(get(), points.get(), &compliance));
    return compliance;
  }
  void read_positions(const Points& points, std::span<float> xyz) {
    check(exmat_body_read_positions(get(), points.get(), xyz.data(), detail::length(xyz)));
  }
  void read_positions(const Points& points, std::span<double> xyz) const {
    check(exmat_body_read_positions_double(get(), points.get(), xyz.data(), detail::length(xyz)));
  }
  void read_positions(const Surface& surface, std::span<float> xyz);
  void read_positions(const Surface& surface, std::span<double> xyz) const;
  /// [12] three rows of a rotation and a shift.
  void read_placement(std::span<double, 12> placement) const {
    check(exmat_body_read_placement(get(), placement.data()));
  }
  /// The first triangle that a ray from `origin` [m] along `direction` meets within `most` [m], from either side.
  std::optional<RayHit> cast_ray(const Surface& surface, std::span<const double, 3> origin,
                                 std::span<const double, 3> direction,
                                 double most = std::numeric_limits<double>::infinity()) const;
  /// `density` [k] [J/m^3].
  void read_energy_density(Surface& surface, std::span<float> density) const;
  /// `q` [r].
  void read_target(std::span<double> q, std::int64_t region = -1) const {
    check(exmat_body_read_target(get(), region, q.data(), detail::length(q)));
  }
  /// `q` [r].
  void read_displacement(std::span<double> q) const {
    check(exmat_body_read_reduced(get(), q.data(), nullptr, detail::length(q)));
  }
  /// `v` [r].
  void read_velocity(std::span<double> v) const {
    check(exmat_body_read_reduced(get(), nullptr, v.data(), detail::length(v)));
  }
  /// `weights` [K].
  void read_weights(std::span<double> weights) const {
    check(exmat_body_read_weights(get(), weights.data(), detail::length(weights)));
  }
  /// `weights` [K of the region].
  void read_region_weights(std::size_t region, std::span<double> weights) const {
    const auto index = static_cast<std::int64_t>(region);
    check(exmat_body_read_region_weights(get(), index, weights.data(), detail::length(weights)));
  }
  exmat_energies energies() const {
    exmat_energies energies;
    energies.size = sizeof energies;
    check(exmat_body_read_energies(get(), &energies));
    return energies;
  }
  double time() const noexcept { return exmat_body_time(get()); }

  /// Views of the body's numbers, which change with it. `modes` is the model's r, `examples` its K.
  std::span<const double> displacement(std::size_t modes) const noexcept {
    return {exmat_body_displacement(get()), modes};
  }
  std::span<const double> velocity(std::size_t modes) const noexcept { return {exmat_body_velocity(get()), modes}; }
  std::span<const double> weights(std::size_t examples) const noexcept { return {exmat_body_weights(get()), examples}; }

  void set_gravity(std::span<const double, 3> gravity) { check(exmat_body_set_gravity(get(), gravity.data())); }
  void set_damping(double alpha, double beta) { check(exmat_body_set_damping(get(), alpha, beta)); }
  void set_integrator(std::int32_t integrator) { check(exmat_body_set_integrator(get(), integrator)); }
  /// EXMAT_SPACE_...; and which of the two the last step was in.
  void set_space(std::int32_t space) { check(exmat_body_set_space(get(), space)); }
  std::int32_t space() const { return exmat_body_space(get()); }
  /// Holds vertices by a frame [12]; its id.
  std::int64_t attach(std::span<const std::int64_t> vertices, std::span<const double, 12> frame,
                      const exmat_attachment& attachment = default_attachment()) {
    std::int64_t id = 0;
    check(exmat_body_attach(get(), vertices.data(), static_cast<std::int64_t>(vertices.size()), &attachment,
                            frame.data(), &id));
    return id;
  }
  std::int64_t attach_to(std::span<const std::int64_t> vertices, const BodyRef& other,
                         std::span<const std::int64_t> other_vertices,
                         const exmat_attachment& attachment = default_attachment()) {
    std::int64_t id = 0;
    check(exmat_body_attach_to(get(), vertices.data(), static_cast<std::int64_t>(vertices.size()), other.get(),
                               other_vertices.data(), static_cast<std::int64_t>(other_vertices.size()), &attachment,
                               &id));
    return id;
  }
  void move_attachment(std::int64_t id, std::span<const double, 12> frame) {
    check(exmat_body_move_attachment(get(), id, frame.data()));
  }
  void detach(std::int64_t id) { check(exmat_body_detach(get(), id)); }
  /// `velocity` [3k], `compliance` [3k x 3k] by rows.
  void read_compliance(const Points& points, std::span<double> velocity, std::span<double> compliance) const {
    if (compliance.size() != velocity.size() * velocity.size())
      throw Error(EXMAT_INVALID_ARGUMENT, "compliance: expected the square of the length of velocity");
    check(
        exmat_body_read_compliance(get(), points.get(), velocity.data(), compliance.data(), detail::length(velocity)));
  }
  /// `impulses` [3k].
  void apply_impulses(const Points& points, std::span<const double> impulses) {
    check(exmat_body_apply_impulses(get(), points.get(), impulses.data(), detail::length(impulses)));
  }
  AttachmentLoad attachment_load(std::int64_t id) const {
    AttachmentLoad load;
    std::int32_t broken = 0;
    check(exmat_body_read_attachment_load(get(), id, load.force.data(), load.torque.data(), &broken));
    load.broken = broken != 0;
    return load;
  }
  /// [12 bones] of the model's bones, at the end of the next step; `teleport`: at once. And those of the last step.
  void set_bones(std::span<const double> transforms, bool teleport = false) {
    check(exmat_body_set_bones(get(), transforms.data(), static_cast<std::int64_t>(transforms.size() / 12),
                               teleport ? 1 : 0));
  }
  std::vector<double> bones(std::size_t count) const {
    std::vector<double> transforms(12 * count);
    check(exmat_body_read_bones(get(), transforms.data(), static_cast<std::int64_t>(transforms.size())));
    return transforms;
  }
  /// `region` -1: the whole body.
  void set_example_stiffness(double kappa, std::int64_t region = -1) {
    check(exmat_body_set_example_stiffness(get(), region, kappa));
  }
  void set_example_damping(double c_kappa, std::int64_t region = -1) {
    check(exmat_body_set_example_damping(get(), region, c_kappa));
  }
  void set_example_bias(double bias, std::int64_t region = -1) {
    check(exmat_body_set_example_bias(get(), region, bias));
  }
  /// Empty: those of the pose again.
  void set_example_weights(std::span<const double> weights, std::int64_t region = -1) {
    check(exmat_body_set_example_weights(get(), region, weights.data(), detail::length(weights)));
  }
  /// Brings points to `targets` [3k] by the weights of examples.
  void reach(const Points& points, std::span<const double> targets, const exmat_reach& settings = default_reach()) {
    check(exmat_body_reach(get(), points.get(), targets.data(), detail::length(targets), &settings));
  }
  void stop_reaching() { check(exmat_body_reach(get(), nullptr, nullptr, 0, nullptr)); }
  /// [3k x K] by rows.
  void read_sensitivity(const Points& points, std::span<double> sensitivity, std::int64_t region = -1) const {
    check(exmat_body_read_sensitivity(get(), region, points.get(), sensitivity.data(), detail::length(sensitivity)));
  }

  std::vector<exmat_contact> contacts() const {
    std::vector<exmat_contact> contacts(static_cast<std::size_t>(exmat_body_contacts(get())));
    check(exmat_body_read_contacts(get(), contacts.data(), static_cast<std::int64_t>(contacts.size()),
                                   sizeof(exmat_contact)));
    return contacts;
  }
  /// Reports hold lost work from now on; null: no longer.
  void set_capacity(const Capacity* capacity);
  /// On an obstacle of its world, or, -1, on the body; force and torque [3] each, either may be null.
  void read_contact_load(std::int64_t id, double* force, double* torque) const {
    check(exmat_body_read_contact_load(get(), id, force, torque));
  }

  std::vector<double> state() const {
    std::vector<double> numbers(static_cast<std::size_t>(exmat_body_state_size(get())));
    check(exmat_body_read_state(get(), numbers.data(), static_cast<std::int64_t>(numbers.size())));
    return numbers;
  }
  void set_state(std::span<const double> numbers) {
    check(exmat_body_set_state(get(), numbers.data(), detail::length(numbers)));
  }

  exmat_body* get() const noexcept { return body_; }

 protected:
  exmat_body* body_;
};

class Body : public BodyRef {
 public:
  explicit Body(const Model& model) : BodyRef(nullptr) {
    check(exmat_body_create(model.get(), &body_));
    handle_.reset(body_);
  }
  /// Takes it over.
  explicit Body(exmat_body* body) noexcept : BodyRef(body), handle_(body) {}

  Body(Body&& other) noexcept : BodyRef(std::exchange(other.body_, nullptr)), handle_(std::move(other.handle_)) {}
  Body& operator=(Body&& other) noexcept {
    handle_ = std::move(other.handle_);
    body_ = std::exchange(other.body_, nullptr);
    return *this;
  }

  /// Gives it away.
  exmat_body* release() noexcept {
    body_ = nullptr;
    return handle_.release();
  }

 private:
  Owner<exmat_body, exmat_body_destroy> handle_;
};

}  // namespace exmat

#include "exmat/drawing.hpp"
#include "exmat/world.hpp"

#endif
