#include "runtime/viewer/simulation/body_shape.h"

#include <algorithm>
#include <cmath>

namespace exmat::viewer {
namespace {

/// By the kinetic energy at 1 m/s; 0 of a body that is not free.
double mass_of(const Model& model) {
  Body body(model);
  exmat_motion motion = body.motion();
  motion.linear_velocity[0] = 1;
  for (double& rate : motion.angular_velocity) rate = 0;
  motion.linear_velocity[1] = motion.linear_velocity[2] = 0;
  motion.size = sizeof motion;
  if (exmat_body_set_motion(body.get(), &motion) != EXMAT_OK) return 0;
  return 2 * body.energies().kinetic;
}

std::vector<float> element_sizes(const Model& model) {
  const std::vector<double> weights = model.element_weights();
  const double most = weights.empty() ? 1 : std::max(1e-300, *std::ranges::max_element(weights));
  std::vector<float> sizes;
  for (const double weight : weights) sizes.push_back(static_cast<float>(std::cbrt(weight / most)));
  return sizes;
}

void add_examples(const Model& model, std::int64_t region, std::size_t count, BodyShape& shape) {
  const std::string name = region < 0 ? "" : model.region_name(static_cast<std::size_t>(region));
  for (std::size_t i = 0; i < count; ++i) {
    const std::vector<double> pose = model.example_pose(region, i);
    shape.examples.push_back({name, model.example_name(region, i), {pose.begin(), pose.end()}});
  }
}

}  // namespace

BodyShape make_shape(const Model& model, const Surface& surface) {
  BodyShape shape;
  shape.modes = model.modes();
  shape.rest = surface.rest();
  shape.basis = surface.basis(shape.modes);
  shape.triangles = surface.triangles();
  shape.vertices = surface.vertices();
  shape.render_mesh = surface.kind() == EXMAT_SURFACE_RENDER;
  shape.element_sizes = element_sizes(model);
  add_examples(model, -1, model.examples(), shape);
  for (std::size_t region = 0; region < model.regions(); ++region)
    add_examples(model, static_cast<std::int64_t>(region), model.region_examples(region), shape);
  for (std::size_t i = 0; i + 2 < shape.rest.size(); i += 3)
    shape.bounds.add(Eigen::Map<const Eigen::Vector3d>(shape.rest.data() + i));
  shape.mass = mass_of(model);
  for (std::size_t bone = 0; bone < model.bones(); ++bone) {
    shape.bones.push_back(model.bone_name(bone));
    shape.bone_parents.push_back(model.bone_parent(bone));
  }
  return shape;
}

}  // namespace exmat::viewer
