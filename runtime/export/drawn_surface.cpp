#include "runtime/export/drawn_surface.h"

#include <algorithm>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/mesh/geometry.h"
#include "runtime/export/drawn_skin.h"
#include "runtime/export/surface_look.h"

namespace exmat::runtime {
namespace {

/// Request for the groups to draw that the bundle has.
BundleRequest request_of(const BundleSummary& summary) {
  BundleRequest request{.groups = {}, .step_only = true, .positions = true, .full_space = true, .look = true};
  for (const char* group : {"object", "modal", "rigid", "render", "skeleton"}) {
    const bool included = std::ranges::find(summary.groups, group) != summary.groups.end();
    request.groups.push_back({group, included, 0, "it is drawn"});
  }
  return request;
}

void add_render_mesh(const ReducedModel& model, DrawnSurface& surface) {
  const RenderData& render = *model.render;
  surface.source = "/render";
  surface.triangles = render.triangles;
  std::vector<Eigen::Triplet<double>> weights;
  for (Eigen::Index k = 0; k < render.tets.size(); ++k)
    for (int c = 0; c < 4; ++c)
      weights.emplace_back(k, model.object->mesh.tets(render.tets[k], c), render.barycentric(k, c));
  surface.of_vertices.resize(render.tets.size(), model.object->mesh.vertex_count());
  surface.of_vertices.setFromTriplets(weights.begin(), weights.end());
}

void add_surface_of_mesh(const ReducedModel& model, DrawnSurface& surface) {
  surface.source = "/object";
  surface.triangles = surface_triangles(model.object->mesh.tets);
  IndexVector place = IndexVector::Constant(model.object->mesh.vertex_count(), -1);
  std::vector<Eigen::Triplet<double>> weights;
  for (std::int32_t& vertex : surface.triangles.reshaped<Eigen::RowMajor>()) {
    if (place[vertex] < 0) {
      place[vertex] = static_cast<std::int32_t>(weights.size());
      weights.emplace_back(place[vertex], vertex, 1.0);
    }
    vertex = place[vertex];
  }
  surface.of_vertices.resize(std::ssize(weights), place.size());
  surface.of_vertices.setFromTriplets(weights.begin(), weights.end());
}

void add_vertices(const ReducedModel& model, DrawnSurface& surface) {
  const RowMatrix& basis = model.modal->basis;
  surface.vertices = surface.of_vertices * model.object->mesh.vertices;
  const Eigen::Index axes = 3 * basis.cols();  // numbers of a vertex, which stand together
  surface.modes.resize(3 * surface.vertex_count(), basis.cols());
  Eigen::Map<RowMatrix>(surface.modes.data(), surface.vertex_count(), axes) =
      surface.of_vertices * Eigen::Map<const RowMatrix>(basis.data(), model.object->mesh.vertex_count(), axes);
}

}  // namespace

DrawnSurface read_drawn_surface(const std::filesystem::path& bundle, bool mesh) {
  const BundleSummary summary = summarise_bundle(bundle);
  const ReducedModel model = read_bundle(bundle, request_of(summary));
  DrawnSurface surface;
  surface.name = summary.asset_name;
  if (model.render && !mesh) {
    add_render_mesh(model, surface);
    if (model.render->look.size() > 0)
      surface.look = std::make_shared<const SurfaceLook>(read_look(bundle.string(), *model.render));
    if (model.skeleton && model.render->bones.cols() > 0)
      surface.skin = std::make_shared<const DrawnSkin>(read_drawn_skin(*model.render, *model.skeleton));
  } else {
    add_surface_of_mesh(model, surface);
  }
  add_vertices(model, surface);
  surface.free = !summary.constrained && model.rigid;
  surface.origin = surface.free ? model.rigid->centre_of_mass : origin_near(surface.vertices);
  surface.vertices.rowwise() -= surface.origin.transpose();
  return surface;
}

}  // namespace exmat::runtime
