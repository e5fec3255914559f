#include "common/bundle/scene_places.h"

#include <algorithm>

#include "common/bundle/bundle.h"
#include "common/model/vertex_marks.h"

namespace exmat {
namespace {

/// Calls use() with the points of an object and their marks, if it has some.
template <typename Use>
auto with_points(const SceneConfig& config, const ObjectData& object, const Use& use) {
  const VertexMarks marks = marks_of(object);
  const bool has_marks = object.vertex_parts.size() > 0 || object.colours.rows() > 0;
  return use(SelectablePoints{.points = object.mesh.vertices,
                              .marks = has_marks ? &marks : nullptr,
                              .file = config.file.string(),
                              .surface = "the surface of " + config.bundle.string()});
}

}  // namespace

std::vector<VertexForceConfig> forces_on_vertices(const SceneConfig& config) {
  const auto is_known = [](const VertexForceConfig& force) { return !force.places; };
  if (std::ranges::all_of(config.forces, is_known)) return config.forces;
  const BundleRequest request{.groups = {{"object", true, 0, "forces act on places of it"}},
                              .step_only = true,
                              .positions = true,
                              .places = true};
  const ObjectData object = *read_bundle(config.bundle, request).object;
  return with_points(config, object,
                     [&](const SelectablePoints& points) { return forces_on_vertices(config, points); });
}

std::vector<std::int32_t> select_vertices(const SceneConfig& config, const ObjectData& object,
                                          const VertexSelection& selection, const std::string& place) {
  return with_points(config, object, [&](SelectablePoints points) {
    points.place = place;
    return select_points(points, selection);
  });
}

}  // namespace exmat
