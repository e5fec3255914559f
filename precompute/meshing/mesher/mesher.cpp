// The one source that sees CGAL, whose meshing packages are under the GPL: a module of its own, which the offline stage
// loads where it is there. It takes a minute to compile.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polyhedral_mesh_domain_3.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>
#include <CGAL/make_mesh_3.h>
#include <CGAL/version.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <set>
#include <unordered_map>
#include <vector>

#include "precompute/meshing/mesher_interface.h"

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Wrap = CGAL::Surface_mesh<Kernel::Point_3>;
using SurfaceDomain = CGAL::Polyhedral_mesh_domain_3<Wrap, Kernel>;

// Cells of a grid that points are in.
class Cells {
 public:
  explicit Cells(double size) : size_(size) {}

  /// True if none was there.
  bool add(double x, double y, double z) { return cells_.insert(cell_of(x, y, z)).second; }
  /// True if one is there or beside it: no farther than two sizes, and all that are no farther than one.
  bool has_near(double x, double y, double z) const {
    const auto [a, b, c] = cell_of(x, y, z);
    for (std::int64_t i = a - 1; i <= a + 1; ++i)
      for (std::int64_t j = b - 1; j <= b + 1; ++j)
        for (std::int64_t k = c - 1; k <= c + 1; ++k)
          if (cells_.count({i, j, k}) > 0) return true;
    return false;
  }

 private:
  std::array<std::int64_t, 3> cell_of(double x, double y, double z) const {
    const auto index = [&](double place) { return static_cast<std::int64_t>(std::floor(place / size_)); };
    return {index(x), index(y), index(z)};
  }

  double size_;
  std::set<std::array<std::int64_t, 3>> cells_;
};

// The domain is what the wrap encloses. Mesh_3 begins with points where random rays from the middle meet the surface,
// and may so miss what is thin and far from there. This one may begin with a vertex of the wrap in each cell of a grid.
class Domain : public SurfaceDomain {
 public:
  /// `grid`: the size of its cells; 0 begins as Mesh_3 does.
  Domain(const Wrap& wrap, double grid, CGAL::Random& random)
      : SurfaceDomain(wrap, &random), wrap_(wrap), grid_(grid) {}

  // NOLINTBEGIN(readability-identifier-naming): the names of CGAL's concept MeshDomain_3
  struct Construct_initial_points {
    const Domain& domain;
    template <typename Output>
    Output operator()(Output points, int count = 8) const {
      return domain.add_initial_points(points, count);
    }
  };
  Construct_initial_points construct_initial_points_object() const { return {*this}; }
  // NOLINTEND(readability-identifier-naming)

 private:
  template <typename Output>
  Output add_initial_points(Output points, int count) const {
    if (grid_ == 0) return SurfaceDomain::construct_initial_points_object()(points, count);
    Cells taken(grid_);
    for (const auto vertex : wrap_.vertices()) {
      const Kernel::Point_3& at = wrap_.point(vertex);
      if (taken.add(at.x(), at.y(), at.z()))
        *points++ = std::pair(at, index_from_surface_patch_index(make_surface_index()));
    }
    return points;
  }

  const Wrap& wrap_;
  double grid_;
};

using Triangulation = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, CGAL::Sequential_tag>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;
using exmat::precompute::MesherRequest;

// Smallest angle of a triangle on the surface [degree]; Mesh_3 ends for those below 30.
constexpr double kFacetAngle = 25;
// Circumscribed sphere over shortest edge; Mesh_3 ends for those above 2.
constexpr double kRadiusEdgeRatio = 2;
// Dihedral angles that perturbing and exuding seek [degree].
constexpr double kSliverBound = 14;
// Tets are nearer than this to the surface that they fill, over the cell size.
constexpr double kCovered = 1.25;

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

// A facet's circumscribed circle is no larger than a cell, so that a vertex of the tets is near each of the wrap.
bool covers(const exmat::TetMesh& mesh, const Wrap& wrap, double cell_size) {
  Cells cells(kCovered * cell_size);
  for (const auto& vertex : mesh.vertices.rowwise()) cells.add(vertex[0], vertex[1], vertex[2]);
  return std::ranges::all_of(wrap.vertices(), [&](const auto vertex) {
    const Kernel::Point_3& at = wrap.point(vertex);
    return cells.has_near(at.x(), at.y(), at.z());
  });
}

exmat::TetMesh fill(const Wrap& wrap, const MesherRequest& request, double grid) {
  namespace params = CGAL::parameters;
  CGAL::Random random(request.seed);
  CGAL::get_default_random() = CGAL::Random(request.seed);
  const Domain domain(wrap, grid, random);
  const Criteria criteria(params::facet_angle = kFacetAngle, params::facet_size = request.cell_size,
                          params::facet_distance = request.deviation, params::cell_radius_edge_ratio = kRadiusEdgeRatio,
                          params::cell_size = request.cell_size);
  if (!request.improve)
    return tets_of(CGAL::make_mesh_3<Complex>(domain, criteria, params::no_perturb(), params::no_exude()));
  // No time limits: the mesh must not depend on the machine's speed.
  const Complex complex = CGAL::make_mesh_3<Complex>(
      domain, criteria, params::odt(params::max_iteration_number = 10, params::time_limit = 0),
      params::perturb(params::sliver_bound = kSliverBound, params::time_limit = 0),
      params::exude(params::sliver_bound = kSliverBound, params::time_limit = 0));
  return tets_of(complex);
}

// The thickness of a plate that has the volume and the area of the wrap; a rod is twice as thick.
double thickness(const Wrap& wrap) {
  return 2 * CGAL::to_double(CGAL::Polygon_mesh_processing::volume(wrap)) /
         CGAL::to_double(CGAL::Polygon_mesh_processing::area(wrap));
}

exmat::TetMesh make_tets(const MesherRequest& request) {
  const Wrap wrap = wrap_of(request);
  // Tets that may deviate by more than the wrap stands off have nothing to fill in a sheet.
  if (request.offset < 2 * request.deviation && thickness(wrap) < 2 * request.deviation) return {};
  exmat::TetMesh mesh = fill(wrap, request, 0);
  return covers(mesh, wrap, request.cell_size) ? mesh : fill(wrap, request, request.cell_size);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) void exmat_make_tets(const MesherRequest& request,
                                                                       exmat::TetMesh& mesh, std::string& failure) {
  CGAL::set_warning_handler([](const char*, const char*, const char*, int, const char*) {});
  try {
    mesh = make_tets(request);
  } catch (const std::exception& error) {
    failure = error.what();
  }
}

extern "C" __attribute__((visibility("default"))) const char* exmat_mesher_version() {
  return "CGAL " CGAL_VERSION_STR;
}
