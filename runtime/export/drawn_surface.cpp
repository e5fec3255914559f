#include "runtime/export/drawn_surface.h"

#include <algorithm>

#include "common/bundle/bundle.h"
#include "common/mesh/geometry.h"
#include "runtime/export/surface_look.h"

namespace exmat::runtime {
namespace {

/// Request for the groups to draw that the bundle has.
BundleRequest request_of(const BundleSummary& summary) {
  BundleRequest request{.groups = {}, .step_only = true, .positions = true, .look = true};
  for (const char* group : {"object", "modal", "rigid", "render"}) {
    const bool included = std::ranges::find(summary.groups, group) != summary.groups.end();
    request.groups.push_back({group, included, 0, "it is drawn"});
  }
  return request;
}

void add_render_mesh(const ReducedModel& model, DrawnSurface& surface) {
  const RenderData& render = *model.render;
  const RowMatrix& basis = model.modal->basis;
  surface.source = "/render";
  surface.triangles = render.triangles;
  surface.vertices.setZero(render.tets.size(), 3);
  surface.modes.setZero(3 * render.tets.size(), basis.cols());
  for (Eigen::Index k = 0; k < render.tets.size(); ++k) {
    const auto corners = model.object->mesh.tets.row(render.tets[k]);
    for (int c = 0; c < 4; ++c) {
      const double weight = render.barycentric(k, c);
      surface.vertices.row(k) += weight * model.object->mesh.vertices.row(corners[c]);
      surface.modes.middleRows(3 * k, 3) += weight * basis.middleRows(3 * corners[c], 3);
    }
  }
}

void add_surface_of_mesh(const ReducedModel& model, DrawnSurface& surface) {
  surface.source = "/object";
  surface.triangles = surface_triangles(model.object->mesh.tets);
  IndexVector place = IndexVector::Constant(model.object->mesh.vertex_count(), -1);
  std::int32_t count = 0;
  for (std::int32_t& vertex : surface.triangles.reshaped<Eigen::RowMajor>()) {
    if (place[vertex] < 0) place[vertex] = count++;
    vertex = place[vertex];
  }
  surface.vertices.resize(count, 3);
  surface.modes.resize(3 * count, model.modal->basis.cols());
  for (Eigen::Index vertex = 0; vertex < place.size(); ++vertex) {
    if (place[vertex] < 0) continue;
    surface.vertices.row(place[vertex]) = model.object->mesh.vertices.row(vertex);
    surface.modes.middleRows(3 * place[vertex], 3) = model.modal->basis.middleRows(3 * vertex, 3);
  }
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
  } else {
    add_surface_of_mesh(model, surface);
  }
  surface.free = !summary.constrained && model.rigid;
  surface.origin = surface.free ? model.rigid->centre_of_mass : origin_near(surface.vertices);
  surface.vertices.rowwise() -= surface.origin.transpose();
  return surface;
}

}  // namespace exmat::runtime
