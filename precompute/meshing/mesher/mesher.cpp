// The one source that sees CGAL, whose meshing packages are under the GPL: a module of its own, which the offline stage
// loads where it is there. It takes a minute to compile.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Polyhedral_mesh_domain_3.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>
#include <CGAL/make_mesh_3.h>
#include <CGAL/version.h>
#include <array>
#include <cstdint>
#include <exception>
#include <unordered_map>
#include <vector>

#include "precompute/meshing/mesher_interface.h"

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Wrap = CGAL::Surface_mesh<Kernel::Point_3>;
using Domain = CGAL::Polyhedral_mesh_domain_3<Wrap, Kernel>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, CGAL::Sequential_tag>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;
using exmat::precompute::MesherRequest;

// Distance of the surface's triangles from the wrap, over the offset: less than 1, so that tets enclose what the wrap
// encloses.
constexpr double kSurfaceDistance = 0.5;
// Smallest angle of a triangle on the surface [degree]; Mesh_3 ends for those below 30.
constexpr double kFacetAngle = 25;
// Circumscribed sphere over shortest edge; Mesh_3 ends for those above 2.
constexpr double kRadiusEdgeRatio = 2;
// Dihedral angles that perturbing and exuding seek [degree].
constexpr double kSliverBound = 14;

Wrap wrap_of(const MesherRequest& request) {
  std::vector<Kernel::Point_3> points;
  for (const auto& vertex : request.vertices.rowwise()) points.emplace_back(vertex[0], vertex[1], vertex[2]);
  std::vector<std::array<std::size_t, 3>> faces;
  for (const auto& corners : request.triangles.rowwise())
    faces.push_back({static_cast<std::size_t>(corners[0]), static_cast<std::size_t>(corners[1]),
                     static_cast<std::size_t>(corners[2])});
  Wrap wrap;
  CGAL::alpha_wrap_3(points, faces, request.alpha, request.offset, wrap);
  return wrap;
}

exmat::TetMesh tets_of(const Complex& complex) {
  std::unordered_map<Triangulation::Vertex_handle, std::int32_t, CGAL::Handle_hash_function> numbers;
  std::vector<std::array<double, 3>> positions;
  std::vector<std::array<std::int32_t, 4>> tets;
  for (auto cell = complex.cells_in_complex_begin(); cell != complex.cells_in_complex_end(); ++cell) {
    auto& tet = tets.emplace_back();
    for (int corner = 0; corner < 4; ++corner) {
      const auto vertex = cell->vertex(corner);
      const auto [found, is_new] = numbers.try_emplace(vertex, static_cast<std::int32_t>(positions.size()));
      if (is_new) {
        const auto& point = complex.triangulation().point(vertex).point();
        positions.push_back({CGAL::to_double(point.x()), CGAL::to_double(point.y()), CGAL::to_double(point.z())});
      }
      tet[static_cast<std::size_t>(corner)] = found->second;
    }
  }
  exmat::TetMesh mesh;
  mesh.vertices.resize(std::ssize(positions), 3);
  for (Eigen::Index v = 0; v < mesh.vertices.rows(); ++v)
    mesh.vertices.row(v) = Eigen::Map<const Eigen::RowVector3d>(positions[static_cast<std::size_t>(v)].data());
  mesh.tets.resize(std::ssize(tets), 4);
  for (Eigen::Index t = 0; t < mesh.tets.rows(); ++t)
    for (int corner = 0; corner < 4; ++corner)
      mesh.tets(t, corner) = tets[static_cast<std::size_t>(t)][static_cast<std::size_t>(corner)];
  return mesh;
}

exmat::TetMesh make_tets(const MesherRequest& request) {
  namespace params = CGAL::parameters;
  CGAL::Random random(request.seed);
  CGAL::get_default_random() = CGAL::Random(request.seed);
  const Wrap wrap = wrap_of(request);
  const Domain domain(wrap, &random);
  const Criteria criteria(params::facet_angle = kFacetAngle, params::facet_size = request.cell_size,
                          params::facet_distance = kSurfaceDistance * request.offset,
                          params::cell_radius_edge_ratio = kRadiusEdgeRatio, params::cell_size = request.cell_size);
  if (!request.improve)
    return tets_of(CGAL::make_mesh_3<Complex>(domain, criteria, params::no_perturb(), params::no_exude()));
  // No time limits: the mesh must not depend on the machine's speed.
  const Complex complex = CGAL::make_mesh_3<Complex>(
      domain, criteria, params::odt(params::max_iteration_number = 10, params::time_limit = 0),
      params::perturb(params::sliver_bound = kSliverBound, params::time_limit = 0),
      params::exude(params::sliver_bound = kSliverBound, params::time_limit = 0));
  return tets_of(complex);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) void exmat_make_tets(const MesherRequest& request,
                                                                       exmat::TetMesh& mesh, std::string& failure) {
  try {
    mesh = make_tets(request);
  } catch (const std::exception& error) {
    failure = error.what();
  }
}

extern "C" __attribute__((visibility("default"))) const char* exmat_mesher_version() {
  return "CGAL " CGAL_VERSION_STR;
}
