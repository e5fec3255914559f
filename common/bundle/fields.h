#pragma once

#include <Eigen/Core>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "common/hdf5/schema.h"
#include "common/model/reduced_model.h"

namespace exmat {

// The one list that binds every dataset and attribute of schemas/bundle.json to a member of ReducedModel. The writer,
// the reader and the drift test all visit it. A visitor has
//   void group(std::string_view schema_path, std::string_view path);  the fields that follow are in it
//   void attribute(std::string_view name, T& member);
//   void dataset(std::string_view name, T& member);

/// A place in the schema and in the file: where groups of one kind are held.
struct FieldPlace {
  std::string schema, file;
};
inline const FieldPlace kTopPlace{};

/// Enters a group of the same name in the schema and the file.
template <typename Visitor>
void enter(const FieldPlace& place, std::string_view group, Visitor& visit) {
  visit.group(place.schema + std::string(group), place.file + std::string(group));
}

template <typename Object, typename Visitor>
void visit_object(Object& object, Visitor& visit) {
  enter(kTopPlace, "/object", visit);
  visit.attribute("material", object.materials.model);
  visit.attribute("formulation", object.materials.formulation);
  visit.attribute("variance_factor", object.materials.variance_factor);
  visit.attribute("stiffness_ratio", object.stiffness_ratio);
  visit.attribute("worst_stiffness", object.worst_stiffness);
  visit.attribute("thin_share", object.thin_share);
  visit.dataset("vertices", object.mesh.vertices);
  visit.dataset("tets", object.mesh.tets);
  visit.dataset("surface", object.surface);
  visit.dataset("fixed", object.fixed);
  visit.dataset("part_names", object.part_names);
  visit.dataset("part_sets", object.part_sets);
  visit.dataset("vertex_parts", object.vertex_parts);
  visit.dataset("colours", object.colours);
  visit.dataset("density", object.materials.density);
  visit.dataset("youngs_modulus", object.materials.youngs_modulus);
  visit.dataset("poisson_ratio", object.materials.poisson_ratio);
}

template <typename ShapeSpace, typename Visitor>
void visit_shape_space(ShapeSpace& shape_space, Visitor& visit) {
  enter(kTopPlace, "/shape_space", visit);
  visit.attribute("volume", shape_space.volume);
  visit.attribute("centroid", shape_space.centroid);
  visit.attribute("weighting", shape_space.weighting);
  visit.attribute("splits_cluster", shape_space.splits_cluster);
  visit.dataset("eigenvalues", shape_space.eigenvalues);
  visit.dataset("eigenfunctions", shape_space.eigenfunctions);
  visit.dataset("rest_descriptor", shape_space.rest_descriptor);
}

template <typename Example, typename Visitor>
void visit_example(const FieldPlace& place, Example& example, Visitor& visit) {
  visit.group(place.schema + "/examples/{example}", place.file + "/examples/" + example.name);
  visit.attribute("index", example.index);
  visit.attribute("is_rest", example.is_rest);
  visit.attribute("rotation", example.rotation);
  visit.attribute("scale", example.scale);
  visit.attribute("source", example.source);
  visit.attribute("method", example.method);
  visit.attribute("alignment_residual", example.alignment_residual);
  visit.attribute("doubt", example.doubt);
  visit.attribute("inverted_fraction", example.inverted_fraction);
  visit.attribute("competing_maps", example.competing_maps);
  visit.attribute("surface_rms", example.surface_rms);
  visit.attribute("surface_farthest", example.surface_farthest);
  visit.attribute("surface_iterations", example.surface_iterations);
  visit.attribute("shape_space_error", example.shape_space_error);
  visit.attribute("basis_error", example.basis_error);
  visit.attribute("best_error", example.best_error);
  visit.attribute("settled_error", example.settled_error);
  visit.attribute("settled_distance", example.settled_distance);
  visit.attribute("settled_vertex", example.settled_vertex);
  visit.dataset("descriptor", example.descriptor);
  visit.dataset("reduced", example.reduced);
  visit.dataset("pose", example.pose);
}

template <typename Examples, typename Visitor>
void visit_examples(const FieldPlace& place, Examples& examples, Visitor& visit) {
  enter(place, "/examples", visit);
  visit.dataset("gram", examples.gram);
  visit.dataset("h0", examples.h0);
  visit.dataset("hq", examples.hq);
  for (auto& example : examples.examples) visit_example(place, example, visit);
}

template <typename Modal, typename Visitor>
void visit_modal(Modal& modal, Visitor& visit) {
  enter(kTopPlace, "/modal", visit);
  visit.dataset("basis", modal.basis);
  visit.dataset("frequencies", modal.frequencies);
  visit.dataset("gravity_load", modal.gravity_load);
}

template <typename Cubature, typename Visitor>
void visit_cubature(Cubature& cubature, Visitor& visit) {
  enter(kTopPlace, "/cubature", visit);
  visit.attribute("internal_force", cubature.internal_force);
  visit.attribute("internal_force_reason", cubature.internal_force_reason);
  visit.attribute("method", cubature.method);
  visit.attribute("training_error", cubature.training_error);
  visit.attribute("heldout_error", cubature.heldout_error);
  visit.attribute("heldout_energy_error", cubature.heldout_energy_error);
  visit.attribute("heldout_stiffness_error", cubature.heldout_stiffness_error);
  visit.dataset("elements", cubature.elements);
  visit.dataset("weights", cubature.weights);
  visit.dataset("volumes", cubature.volumes);
  visit.dataset("gradient", cubature.gradient);
  visit.dataset("youngs_modulus", cubature.youngs_modulus);
  visit.dataset("poisson_ratio", cubature.poisson_ratio);
  visit.dataset("variance", cubature.variance);
  visit.dataset("heldout_poses", cubature.heldout_poses);
}

template <typename Polynomial, typename Visitor>
void visit_polynomial(Polynomial& polynomial, Visitor& visit) {
  enter(kTopPlace, "/polynomial", visit);
  visit.dataset("stiffness", polynomial.stiffness);
  visit.dataset("cubic", polynomial.cubic);
  visit.dataset("quartic", polynomial.quartic);
}

template <typename Projection, typename Visitor>
void visit_projection(const FieldPlace& place, Projection& projection, Visitor& visit) {
  enter(place, "/projection", visit);
  visit.dataset("shape_from_reduced", projection.shape_from_reduced);
  visit.dataset("reduced_from_shape", projection.reduced_from_shape);
  visit.dataset("filter_scale", projection.filter_scale);
  visit.dataset("target_basis", projection.target_basis);
}

template <typename Targets, typename Visitor>
void visit_targets(const FieldPlace& place, Targets& targets, Visitor& visit) {
  enter(place, "/targets", visit);
  visit.attribute("degree", targets.degree);
  visit.attribute("error", targets.error);
  visit.attribute("energy_reference", targets.energy_reference);
  visit.attribute("is_pull", targets.is_pull);
  visit.attribute("compensated_stiffness", targets.compensated_stiffness);
  visit.attribute("compensated_gravity", targets.compensated_gravity);
  visit.dataset("exponents", targets.exponents);
  visit.dataset("control_points", targets.control_points);
  visit.dataset("knots", targets.knots);
}

template <typename Space, typename Visitor>
void visit_target_space(const FieldPlace& place, Space& space, Visitor& visit) {
  enter(place, "/target_space", visit);
  visit.attribute("energy_reference", space.energy_reference);
  visit.attribute("error", space.error);
  visit.attribute("element_error", space.element_error);
  visit.dataset("poses", space.poses);
  visit.dataset("pull", space.pull);
  visit.dataset("elements", space.elements);
  visit.dataset("weights", space.weights);
  visit.dataset("volumes", space.volumes);
  visit.dataset("gradient", space.gradient);
  visit.dataset("youngs_modulus", space.youngs_modulus);
  visit.dataset("poisson_ratio", space.poisson_ratio);
}

template <typename Elasticity, typename Visitor>
void visit_target_elasticity(const FieldPlace& place, Elasticity& elasticity, Visitor& visit) {
  enter(place, "/target_elasticity", visit);
  visit.attribute("heldout_error", elasticity.heldout_error);
  visit.dataset("elements", elasticity.elements);
  visit.dataset("weights", elasticity.weights);
  visit.dataset("volumes", elasticity.volumes);
  visit.dataset("gradient", elasticity.gradient);
  visit.dataset("target_gradient", elasticity.target_gradient);
  visit.dataset("youngs_modulus", elasticity.youngs_modulus);
  visit.dataset("poisson_ratio", elasticity.poisson_ratio);
  visit.dataset("control_points", elasticity.control_points);
}

template <typename FullSpace, typename Visitor>
void visit_full_space(const FieldPlace& place, FullSpace& full, Visitor& visit) {
  enter(place, "/full_space", visit);
  visit.dataset("filter", full.filter);
  visit.dataset("slopes", full.slopes);
  visit.dataset("control_points", full.control_points);
  visit.dataset("from_target", full.from_target);
  visit.dataset("shapes", full.shapes);
  visit.dataset("shifts", full.shifts);
}

template <typename Fidelity, typename Visitor>
void visit_fidelity(Fidelity& fidelity, Visitor& visit) {
  enter(kTopPlace, "/fidelity", visit);
  visit.attribute("loads", fidelity.loads);
  visit.attribute("reference", fidelity.reference);
  visit.attribute("basis", fidelity.basis);
  visit.attribute("advice", fidelity.advice);
  visit.attribute("training_runs", fidelity.training_runs);
  visit.attribute("heldout_runs", fidelity.heldout_runs);
  visit.attribute("position_error", fidelity.position_error);
  visit.attribute("shape_error", fidelity.shape_error);
  visit.attribute("end_error", fidelity.end_error);
  visit.attribute("settled_error", fidelity.settled_error);
  visit.attribute("all_elements_error", fidelity.all_elements_error);
  visit.attribute("modal_error", fidelity.modal_error);
  visit.attribute("captured_energy", fidelity.captured_energy);
  visit.attribute("target_error", fidelity.target_error);
  visit.attribute("worst_vertex", fidelity.worst_vertex);
  visit.attribute("worst_distance", fidelity.worst_distance);
}

template <typename Region, typename Visitor>
void visit_region(Region& region, Visitor& visit) {
  const FieldPlace place{"/regions/{region}", "/regions/" + region.name};
  enter(place, "", visit);
  visit.attribute("index", region.index);
  visit.dataset("vertices", region.vertices);
  visit.dataset("window", region.window);
  visit.dataset("band", region.band);
  visit_examples(place, region.examples, visit);
  visit_projection(place, region.projection, visit);
  if (region.targets) visit_targets(place, *region.targets, visit);
  if (region.target_space) visit_target_space(place, *region.target_space, visit);
  if (region.target_elasticity) visit_target_elasticity(place, *region.target_elasticity, visit);
  if (region.full_space) visit_full_space(place, *region.full_space, visit);
}

template <typename Regions, typename Visitor>
void visit_regions(Regions& regions, Visitor& visit) {
  enter(kTopPlace, "/regions", visit);
  for (auto& region : regions) visit_region(region, visit);
}

template <typename Rigid, typename Visitor>
void visit_rigid(Rigid& rigid, Visitor& visit) {
  enter(kTopPlace, "/rigid", visit);
  visit.dataset("mass", rigid.mass);
  visit.dataset("centre_of_mass", rigid.centre_of_mass);
  visit.dataset("inertia", rigid.inertia);
  visit.dataset("second_moments", rigid.second_moments);
  visit.dataset("linear_moments", rigid.linear_moments);
  visit.dataset("basis_moments", rigid.basis_moments);
  visit.dataset("spin_load", rigid.spin_load);
}

template <typename Contact, typename Visitor>
void visit_contact(Contact& contact, Visitor& visit) {
  enter(kTopPlace, "/contact", visit);
  visit.dataset("vertices", contact.vertices);
  visit.dataset("positions", contact.positions);
  visit.dataset("areas", contact.areas);
  visit.dataset("basis", contact.basis);
}

template <typename Render, typename Visitor>
void visit_render(Render& render, Visitor& visit) {
  enter(kTopPlace, "/render", visit);
  visit.attribute("outside", render.outside);
  visit.attribute("farthest", render.farthest);
  visit.dataset("vertices", render.vertices);
  visit.dataset("tets", render.tets);
  visit.dataset("barycentric", render.barycentric);
  visit.dataset("triangles", render.triangles);
  visit.dataset("look", render.look);
  visit.dataset("look_vertices", render.look_vertices);
  visit.dataset("look_frames", render.look_frames);
  visit.dataset("bones", render.bones);
  visit.dataset("bone_weights", render.bone_weights);
}

template <typename Skeleton, typename Visitor>
void visit_skeleton(Skeleton& skeleton, Visitor& visit) {
  enter(kTopPlace, "/skeleton", visit);
  visit.attribute("bones", skeleton.bones);
  visit.attribute("animations", skeleton.animations);
  visit.dataset("parents", skeleton.parents);
  visit.dataset("bind", skeleton.bind);
  visit.dataset("weights", skeleton.weights);
  visit.dataset("first_frames", skeleton.first_frames);
  visit.dataset("times", skeleton.times);
  visit.dataset("poses", skeleton.poses);
  visit.dataset("shifts", skeleton.shifts);
}

/// Visits the groups that the model holds, in bundle order. Model is ReducedModel or const ReducedModel.
template <typename Model, typename Visitor>
void visit_fields(Model& model, Visitor& visit) {
  visit.group("/", "/");
  visit.attribute("asset_name", model.asset_name);
  visit.attribute("generator", model.generator);
  visit.attribute("input_sha256", model.input_sha256);
  if (model.object) visit_object(*model.object, visit);
  if (model.shape_space) visit_shape_space(*model.shape_space, visit);
  if (model.examples) visit_examples(kTopPlace, *model.examples, visit);
  if (model.modal) visit_modal(*model.modal, visit);
  if (model.cubature) visit_cubature(*model.cubature, visit);
  if (model.polynomial) visit_polynomial(*model.polynomial, visit);
  if (model.projection) visit_projection(kTopPlace, *model.projection, visit);
  if (model.targets) visit_targets(kTopPlace, *model.targets, visit);
  if (model.target_space) visit_target_space(kTopPlace, *model.target_space, visit);
  if (model.target_elasticity) visit_target_elasticity(kTopPlace, *model.target_elasticity, visit);
  if (model.full_space) visit_full_space(kTopPlace, *model.full_space, visit);
  if (model.fidelity) visit_fidelity(*model.fidelity, visit);
  if (!model.regions.empty()) visit_regions(model.regions, visit);
  if (model.rigid) visit_rigid(*model.rigid, visit);
  if (model.contact) visit_contact(*model.contact, visit);
  if (model.render) visit_render(*model.render, visit);
  if (model.skeleton) visit_skeleton(*model.skeleton, visit);
}

/// Root attributes that are no members of the model; write_bundle and read_bundle know them by name.
inline constexpr std::string_view kHeaderAttributes[] = {"format", "format_version", "features", "constrained"};

/// Names of /examples that are not examples.
inline constexpr std::string_view kExampleDatasets[] = {"gram", "h0", "hq"};

/// Adds the empty group of that name ("object", ...) to a model; regions are the reader's to add. std::logic_error if
/// there is none.
void add_group(ReducedModel& model, std::string_view group);

/// Differences between the list above and a schema, one message each; empty where each schema entry is bound to a
/// member of its type.
std::vector<std::string> binding_faults(const FileSchema& schema);

/// A member as its dataset's memory: rows x cols, row-major.
struct ArrayView {
  ElementType type = ElementType::kFloat64;
  std::int64_t rows = 1;
  std::int64_t cols = 1;
  const void* data = nullptr;
};

inline ArrayView view_of(const double& value) { return {ElementType::kFloat64, 1, 1, &value}; }

template <typename Derived>
ArrayView view_of(const Eigen::PlainObjectBase<Derived>& array) {
  static_assert(Derived::IsRowMajor || Derived::IsVectorAtCompileTime, "datasets are row-major");
  return {kElementType<typename Derived::Scalar>, array.rows(), array.cols(), array.data()};
}

inline void* resized(double& value, std::int64_t, std::int64_t) { return &value; }

/// Makes the member rows x cols and returns its memory; sizes fixed in the type must agree (std::logic_error).
template <typename Derived>
void* resized(Eigen::PlainObjectBase<Derived>& array, std::int64_t rows, std::int64_t cols) {
  const bool fits = (Derived::RowsAtCompileTime == Eigen::Dynamic || Derived::RowsAtCompileTime == rows) &&
                    (Derived::ColsAtCompileTime == Eigen::Dynamic || Derived::ColsAtCompileTime == cols);
  if (!fits) throw std::logic_error("the schema's dims do not fit the member");
  array.resize(rows, cols);
  return array.data();
}

/// A member as an attribute: flags as 0 or 1, choices by their names, matrices row-major.
template <typename T>
AttributeValue to_attribute(const T& member) {
  if constexpr (std::is_same_v<T, bool>)
    return std::int64_t{member ? 1 : 0};
  else if constexpr (Named<T>)
    return std::string(name_of(member));
  else if constexpr (std::is_base_of_v<Eigen::MatrixBase<T>, T>) {
    const RowMatrix values = member;
    return std::vector<double>(values.data(), values.data() + values.size());
  } else
    return member;
}

/// The inverse; the value must have the type and size that to_attribute gives, and be one of the names.
template <typename T>
void from_attribute(const AttributeValue& value, T& member) {
  if constexpr (std::is_same_v<T, bool>)
    member = std::get<std::int64_t>(value) != 0;
  else if constexpr (Named<T>)
    member = from_name<T>(std::get<std::string>(value)).value();
  else if constexpr (std::is_base_of_v<Eigen::MatrixBase<T>, T>)
    member = Eigen::Map<const RowMatrix>(std::get<std::vector<double>>(value).data(), member.rows(), member.cols());
  else
    member = std::get<T>(value);
}

}  // namespace exmat
