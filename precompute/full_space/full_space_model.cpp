#include "precompute/full_space/full_space_model.h"

#include <Eigen/Geometry>
#include <string>

#include "common/core/error.h"
#include "common/core/log.h"

namespace exmat::precompute {
namespace {

VertexArray as_rows(const Eigen::VectorXd& field) { return field.reshaped<Eigen::RowMajor>(field.size() / 3, 3); }

void add_examples(const ReducedModel& model, const FullSpaceOptions& options, FullSpaceModel& full) {
  const auto add = [&](const ExamplePoses& poses, EnergyReference reference, const std::string& owner) {
    const auto& added = full.examples.emplace_back(model, full.system, poses, reference);
    if (const Eigen::Index left_out = added.left_out_elements(); left_out > 0)
      log::warning(owner + ": the energies of the target leave out " + std::to_string(left_out) + " of " +
                   std::to_string(full.elasticity.elements()) + " elements, which an example turns inside out");
  };
  const bool known = !options.coordinates.empty();
  if (options.whole_body)
    add(known ? known_example_poses(model, "", options.coordinates.front())
              : whole_body_example_poses(model, full.system),
        options.energy_reference, model.asset_name);
  if (options.regions.empty()) return;
  std::vector<std::string> names;
  for (const auto& region : options.regions) names.push_back(region.name);
  std::vector<ExamplePoses> poses;
  if (!known) poses = region_example_poses(model, full.system, names);
  for (std::size_t i = 0; known && i < names.size(); ++i)
    poses.push_back(known_example_poses(model, names[i], options.coordinates[i + (options.whole_body ? 1 : 0)]));
  for (std::size_t i = 0; i < poses.size(); ++i)
    add(poses[i], options.regions[i].energy_reference, model.asset_name + ", region " + names[i]);
}

void add_space(const ReducedModel& data, FullSpaceModel& full) {
  const ObjectData& object = *data.object;
  RowMatrix functions(full.rest.rows(), 0);
  std::vector<runtime::FullExamples> groups;
  for (const FullSpaceExamples& examples : full.examples) {
    const FullSpaceExamples::Root root = examples.root();
    runtime::FullExamples& own = groups.emplace_back();
    runtime::append_functions(root.filter, root.band, full.rest, own, functions);
    own.is_elastic = true;
  }
  full.matrix_free = runtime::FullModel(runtime::FullSpace(object.mesh, object.materials, object.fixed, functions));
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (const auto& shares = full.examples[i].tet_shares())
      groups[i].shares = full.matrix_free.space.element_means(object.mesh, object.materials, *shares);
  full.matrix_free.examples = std::move(groups);
  if (data.contact) full.matrix_free.contacts.emplace(*data.contact, full.matrix_free.space);
  if (!full.system.constrained()) full.matrix_free.rigid.emplace(full.matrix_free.space, full.rest);
  full.matrix_free.set_frame_of_functions();
}

}  // namespace

FullSpaceModel build_full_space_model(const ReducedModel& model, const FullSpaceOptions& options) {
  if (!model.object) throw InputError({"", "/object", "this group", "none", "precompute the bundle again"});
  const ObjectData& object = *model.object;
  FullSpaceModel full;
  full.rest = object.mesh.vertices;
  full.system = build_elastic_system(object.mesh, object.materials, object.fixed);
  full.elasticity = MeshElasticity(object.mesh, object.materials, full.system.free_dofs);
  full.gravity_load = full.system.restrict(full.system.unit_weights());
  if (!full.system.constrained()) full.frame.emplace(object.mesh, scalar_mass(object.mesh, object.materials.density));
  add_examples(model, options, full);
  add_space(model, full);
  return full;
}

FullSpaceState make_full_space_state(const FullSpaceModel& model, const Eigen::VectorXd& displacement,
                                     const Eigen::VectorXd& velocity) {
  FullSpaceState state;
  state.q = state.q_previous = model.system.restrict(displacement);
  state.v = state.v_previous = model.system.restrict(velocity);
  state.a = state.applied_force = Eigen::VectorXd::Zero(model.size());
  state.elastic_energy = model.elasticity.energy(state.q);
  for (const FullSpaceExamples& examples : model.examples)
    state.examples.push_back(
        {Eigen::VectorXd::Unit(examples.count(), 0), Eigen::VectorXd::Zero(examples.pose_basis().cols())});
  return state;
}

FullSpaceState make_full_space_state(const FullSpaceModel& model, const Eigen::VectorXd& deformation,
                                     const runtime::FrameMotion& motion) {
  if (!model.frame)
    throw InputError({"", "/body", "a free body, since it is to move", "a body with fixed vertices", ""});
  const Eigen::Vector3d centre = model.frame->centre_at_rest();
  const Eigen::Matrix3d rotation = motion.orientation.toRotationMatrix();
  Eigen::VectorXd displacement(deformation.size()), velocity(deformation.size());
  for (Eigen::Index i = 0; i < model.rest.rows(); ++i) {
    const Eigen::Vector3d rest = model.rest.row(i).transpose();
    const Eigen::Vector3d arm = rotation * (rest - centre + deformation.segment<3>(3 * i));
    displacement.segment<3>(3 * i) = centre + motion.position + arm - rest;
    velocity.segment<3>(3 * i) = motion.linear_velocity + motion.angular_velocity.cross(arm);
  }
  return make_full_space_state(model, displacement, velocity);
}

Eigen::VectorXd deformation(const FullSpaceModel& model, const Eigen::VectorXd& q) {
  return model.frame ? model.frame->deformation(model.frame->place(q)) : q;
}

VertexArray world_positions(const FullSpaceModel& model, const FullSpaceState& state) {
  return model.rest + as_rows(model.system.extend(state.q));
}

VertexArray world_velocities(const FullSpaceModel& model, const FullSpaceState& state) {
  return as_rows(model.system.extend(state.v));
}

}  // namespace exmat::precompute
