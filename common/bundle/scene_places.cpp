#include "common/bundle/scene_places.h"

#include <algorithm>

#include "common/bundle/bundle.h"
#include "common/model/vertex_marks.h"

namespace exmat {

std::vector<VertexForceConfig> forces_on_vertices(const SceneConfig& config) {
  const auto is_known = [](const VertexForceConfig& force) { return !force.places; };
  if (std::ranges::all_of(config.forces, is_known)) return config.forces;
  const BundleRequest request{.groups = {{"object", true, 0, "forces act on places of it"}},
                              .step_only = true,
                              .positions = true,
                              .places = true};
  const ObjectData object = *read_bundle(config.bundle, request).object;
  const VertexMarks marks = marks_of(object);
  const bool has_marks = object.vertex_parts.size() > 0 || object.colours.rows() > 0;
  return forces_on_vertices(config, {.points = object.mesh.vertices,
                                     .marks = has_marks ? &marks : nullptr,
                                     .surface = "the surface of " + config.bundle.string()});
}

}  // namespace exmat
