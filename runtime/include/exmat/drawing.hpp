// drawing.h for C++20. A part of exmat.hpp, which includes it.
#ifndef EXMAT_DRAWING_HPP
#define EXMAT_DRAWING_HPP

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "exmat/exmat.hpp"

namespace exmat {

inline exmat_bundle_info bundle_info(const std::string& bundle) {
  exmat_bundle_info info;
  info.size = sizeof info;
  check(exmat_bundle_read_info(detail::c_text(bundle), &info));
  return info;
}

inline std::string bundle_region_name(const std::string& bundle, std::size_t region) {
  char name[256];
  check(exmat_bundle_read_region_name(detail::c_text(bundle), static_cast<std::int64_t>(region), name, sizeof name));
  return name;
}

/// Triangles that are drawn, and their points.
class Surface {
 public:
  explicit Surface(const Model& model, std::int32_t kind = EXMAT_SURFACE_AUTO) {
    exmat_surface* surface = nullptr;
    check(exmat_surface_create(model.get(), kind, &surface));
    handle_.reset(surface);
  }

  std::int32_t kind() const noexcept { return exmat_surface_kind(get()); }
  /// k
  std::size_t points() const noexcept { return static_cast<std::size_t>(exmat_points_count(handle())); }
  /// [3f]
  std::vector<std::int32_t> triangles() const {
    std::vector<std::int32_t> corners(3 * static_cast<std::size_t>(exmat_surface_triangles(get())));
    check(exmat_surface_read_triangles(get(), corners.data(), static_cast<std::int64_t>(corners.size())));
    return corners;
  }
  /// [k], of the object.
  std::vector<std::int64_t> vertices() const {
    std::vector<std::int64_t> ids(points());
    check(exmat_surface_read_vertices(get(), ids.data(), static_cast<std::int64_t>(ids.size())));
    return ids;
  }
  /// Reads unit normals [3k] at positions `xyz` [3k].
  void read_normals(std::span<const float> xyz, std::span<float> normals) const {
    if (xyz.size() != normals.size())
      throw Error(EXMAT_INVALID_ARGUMENT, "read_normals: expected as many positions as normals");
    check(exmat_surface_read_normals(get(), xyz.data(), normals.data(), detail::length(normals)));
  }
  /// [3k] X, at rest.
  std::vector<double> rest() const {
    std::vector<double> xyz(3 * points());
    check(exmat_points_read_rest(handle(), xyz.data(), static_cast<std::int64_t>(xyz.size())));
    return xyz;
  }
  /// [3k x r] U, of a model with so many modes.
  std::vector<float> basis(std::size_t modes) const {
    std::vector<float> rows(3 * points() * modes);
    check(exmat_points_read_basis(handle(), rows.data(), static_cast<std::int64_t>(rows.size())));
    return rows;
  }

  /// Its points, for functions of exmat.h.
  const exmat_points* handle() const noexcept { return exmat_surface_points(get()); }
  exmat_surface* get() const noexcept { return handle_.get(); }

 private:
  Owner<exmat_surface, exmat_surface_destroy> handle_;
};

inline Points Points::on_surface(const Surface& surface, std::span<const std::int64_t> triangles,
                                 std::span<const double> shares) {
  if (shares.size() != 3 * triangles.size())
    throw Error(EXMAT_INVALID_ARGUMENT, "on_surface: expected three shares for each triangle");
  exmat_points* points = nullptr;
  check(exmat_points_create_on_surface(surface.get(), triangles.data(), shares.data(), detail::length(triangles),
                                       &points));
  return Points(points);
}

inline void BodyRef::read_positions(const Surface& surface, std::span<float> xyz) {
  check(exmat_body_read_positions(get(), surface.handle(), xyz.data(), detail::length(xyz)));
}

inline void BodyRef::read_positions(const Surface& surface, std::span<double> xyz) const {
  check(exmat_body_read_positions_double(get(), surface.handle(), xyz.data(), detail::length(xyz)));
}

inline std::optional<RayHit> BodyRef::cast_ray(const Surface& surface, std::span<const double, 3> origin,
                                               std::span<const double, 3> direction, double most) const {
  RayHit hit;
  check(exmat_body_cast_ray(get(), surface.get(), origin.data(), direction.data(), most, &hit.triangle,
                            hit.shares.data(), &hit.distance, hit.normal.data()));
  return hit.triangle < 0 ? std::nullopt : std::optional(hit);
}

inline Elasticity Model::elasticity(std::span<const double> q) const {
  Elasticity at{0, std::vector<double>(q.size()), std::vector<double>(q.size() * q.size())};
  check(
      exmat_model_read_elasticity(get(), q.data(), detail::length(q), &at.energy, at.force.data(), at.tangent.data()));
  return at;
}

inline CompressedRows Model::matrix(std::int32_t kind) const {
  exmat_matrix* made = nullptr;
  check(exmat_matrix_create(get(), kind, &made));
  const Owner<exmat_matrix, exmat_matrix_destroy> matrix(made);
  const auto entries = static_cast<std::size_t>(exmat_matrix_entries(made));
  CompressedRows rows{std::vector<std::int64_t>(3 * vertices() + 1), std::vector<std::int64_t>(entries),
                      std::vector<double>(entries)};
  check(
      exmat_matrix_read(made, rows.starts.data(), rows.columns.data(), rows.values.data(), exmat_matrix_entries(made)));
  return rows;
}

inline void BodyRef::read_energy_density(Surface& surface, std::span<float> density) const {
  check(exmat_body_read_energy_density(get(), surface.get(), density.data(), detail::length(density)));
}

/// The share of a force's work that the modes of a model lose. `spread` [m] as in exmat_capacity_create().
class Capacity {
 public:
  Capacity(const Model& model, double spread) {
    exmat_capacity* capacity = nullptr;
    check(exmat_capacity_create(model.get(), spread, &capacity));
    handle_.reset(capacity);
  }

  double time_scale() const noexcept { return exmat_capacity_time_scale(get()); }
  /// In [0, 1], of `forces` [3k] on points.
  double lost(const BodyRef& body, const Points& points, std::span<const double> forces) const {
    double lost = 0;
    check(exmat_capacity_read_lost(get(), body.get(), points.get(), forces.data(), detail::length(forces), &lost));
    return lost;
  }
  double contact_lost(const BodyRef& body) const {
    double lost = 0;
    check(exmat_capacity_read_contact_lost(get(), body.get(), &lost));
    return lost;
  }

  const exmat_capacity* get() const noexcept { return handle_.get(); }

 private:
  Owner<exmat_capacity, exmat_capacity_destroy> handle_;
};

inline void BodyRef::set_capacity(const Capacity* capacity) {
  check(exmat_body_set_capacity(get(), capacity != nullptr ? capacity->get() : nullptr));
}

}  // namespace exmat

#endif
