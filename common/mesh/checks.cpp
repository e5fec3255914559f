#include "common/mesh/checks.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numeric>

#include "common/core/disjoint_sets.h"
#include "common/core/error.h"
#include "common/mesh/geometry.h"

namespace exmat {
namespace {

using Index = Eigen::Index;
using Corners = std::array<std::int32_t, 4>;

// Largest volume of a degenerate tet over the cube of its longest edge.
constexpr double kDegenerateRatio = 1e-12;

std::string to_text(double value) {
  std::array<char, 32> text{};
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 6);
  return std::string(text.data(), end);
}

/// The faults of one kind: how many there are, and which one is named.
struct Faults {
  Index first = -1;
  Index count = 0;

  void add(Index item) {
    if (count++ == 0) first = item;
  }
  std::string place(const std::string& item, const std::string& items) const {
    return item + " " + std::to_string(first + 1) + " (1-based, " + std::to_string(count) + " such " +
           (count == 1 ? item : items) + ")";
  }
};

std::string drop_advice(const std::string& option) { return "drop them with \"drop\": [\"" + option + "\"] or remesh"; }

std::string corners_text(const TetMesh& mesh, Index tet) {
  std::string text;
  for (int corner = 0; corner < 4; ++corner)
    text += (corner == 0 ? "" : ", ") + std::to_string(std::int64_t{mesh.tets(tet, corner)} + 1);
  return text;
}

Corners sorted_corners(const TetMesh& mesh, Index tet) {
  Corners corners{mesh.tets(tet, 0), mesh.tets(tet, 1), mesh.tets(tet, 2), mesh.tets(tet, 3)};
  std::sort(corners.begin(), corners.end());
  return corners;
}

void require_content(const TetMesh& mesh, const std::string& file) {
  if (mesh.vertex_count() == 0) throw InputError({file, "", "vertices", "none", ""});
  if (mesh.tet_count() == 0) throw InputError({file, "", "tetrahedra", "none", ""});
}

void require_finite(const TetMesh& mesh, const std::string& file) {
  Faults faults;
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if (!mesh.vertices.row(v).allFinite()) faults.add(v);
  if (faults.count == 0) return;
  const auto x = mesh.vertices.row(faults.first);
  const std::string found = "(" + to_text(x[0]) + ", " + to_text(x[1]) + ", " + to_text(x[2]) + ")";
  throw InputError({file, faults.place("vertex", "vertices"), "finite coordinates", found, ""});
}

void require_indices_in_range(const TetMesh& mesh, const std::string& file) {
  Faults faults;
  for (Index t = 0; t < mesh.tet_count(); ++t)
    if (mesh.tets.row(t).minCoeff() < 0 || mesh.tets.row(t).maxCoeff() >= mesh.vertex_count()) faults.add(t);
  if (faults.count == 0) return;
  throw InputError({file, faults.place("tet", "tets"),
                    "corners from 1 to " + std::to_string(mesh.vertex_count()) + " (1-based)",
                    corners_text(mesh, faults.first), ""});
}

std::vector<char> referenced_vertices(const TetMesh& mesh) {
  std::vector<char> is_referenced(static_cast<std::size_t>(mesh.vertex_count()), 0);
  for (Index t = 0; t < mesh.tet_count(); ++t)
    for (int corner = 0; corner < 4; ++corner) is_referenced[static_cast<std::size_t>(mesh.tets(t, corner))] = 1;
  return is_referenced;
}

void require_referenced_vertices(const TetMesh& mesh, const std::string& file) {
  const auto is_referenced = referenced_vertices(mesh);
  Faults faults;
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    if (!is_referenced[static_cast<std::size_t>(v)]) faults.add(v);
  if (faults.count == 0) return;
  throw InputError({file, faults.place("vertex", "vertices"), "a vertex of some tet", "one of none",
                    drop_advice("unreferenced_vertices")});
}

/// Moves the kept tets to the front and forgets the others.
void keep_tets(TetMesh& mesh, MeshReport& report, const std::vector<char>& is_kept) {
  Index count = 0;
  for (Index t = 0; t < mesh.tet_count(); ++t) {
    if (!is_kept[static_cast<std::size_t>(t)]) continue;
    mesh.tets.row(count) = mesh.tets.row(t);
    report.kept_tets[static_cast<std::size_t>(count)] = report.kept_tets[static_cast<std::size_t>(t)];
    ++count;
  }
  mesh.tets.conservativeResize(count, 4);
  report.kept_tets.resize(static_cast<std::size_t>(count));
}

bool has_repeated_corner(const TetMesh& mesh, Index tet) {
  const Corners corners = sorted_corners(mesh, tet);
  return std::adjacent_find(corners.begin(), corners.end()) != corners.end();
}

double longest_edge(const TetMesh& mesh, Index tet) {
  const auto x = tet_positions(mesh, tet);
  double longest = 0;
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < a; ++b) longest = std::max(longest, (x.row(a) - x.row(b)).norm());
  return longest;
}

double volume_limit(const TetMesh& mesh, Index tet) { return kDegenerateRatio * std::pow(longest_edge(mesh, tet), 3); }

void mend_degenerate_tets(TetMesh& mesh, const std::string& file, bool drop, MeshReport& report) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  std::vector<char> is_kept(static_cast<std::size_t>(mesh.tet_count()), 1);
  Faults repeated, flat;
  for (Index t = 0; t < mesh.tet_count(); ++t) {
    const bool repeats = has_repeated_corner(mesh, t);
    // Not "<=": a volume that overflows is no better.
    const bool is_flat = !(std::abs(volumes[t]) > volume_limit(mesh, t));
    if (!repeats && !is_flat) continue;
    (repeats ? repeated : flat).add(t);
    is_kept[static_cast<std::size_t>(t)] = 0;
  }
  report.dropped_degenerate_tets = repeated.count + flat.count;
  if (report.dropped_degenerate_tets == 0) return;
  const std::string advice = drop_advice("degenerate_tets");
  if (!drop && repeated.count > 0)
    throw InputError({file, repeated.place("tet", "tets"), "four distinct corners",
                      corners_text(mesh, repeated.first) + " (1-based)", advice});
  if (!drop)
    throw InputError(
        {file, flat.place("tet", "tets"),
         "a volume above " + to_text(volume_limit(mesh, flat.first)) + " (1e-12 of its longest edge cubed)",
         to_text(std::abs(volumes[flat.first])), advice});
  keep_tets(mesh, report, is_kept);
  if (mesh.tet_count() == 0) throw InputError({file, "", "tets that are not degenerate", "none", "remesh"});
}

void reorient_inverted_tets(TetMesh& mesh, MeshReport& report) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  for (Index t = 0; t < mesh.tet_count(); ++t) {
    if (volumes[t] > 0) continue;
    std::swap(mesh.tets(t, 2), mesh.tets(t, 3));
    ++report.reoriented_tets;
  }
}

void require_distinct_tets(const TetMesh& mesh, const std::string& file, const MeshReport& report) {
  struct Entry {
    Corners corners;
    std::int32_t tet;
  };
  std::vector<Entry> entries(static_cast<std::size_t>(mesh.tet_count()));
  for (Index t = 0; t < mesh.tet_count(); ++t)
    entries[static_cast<std::size_t>(t)] = {sorted_corners(mesh, t), report.kept_tets[static_cast<std::size_t>(t)]};
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return a.corners != b.corners ? a.corners < b.corners : a.tet < b.tet;
  });
  Faults faults;
  Index twin = -1;
  for (std::size_t i = 1; i < entries.size(); ++i) {
    if (entries[i].corners != entries[i - 1].corners) continue;
    ++faults.count;
    if (faults.first >= 0 && entries[i].tet >= faults.first) continue;
    faults.first = entries[i].tet;
    twin = entries[i - 1].tet;
  }
  if (faults.count == 0) return;
  throw InputError({file, faults.place("tet", "tets"), "four corners of its own",
                    "those of tet " + std::to_string(twin + 1), "remove the repeated tets"});
}

/// Sets of tets, joined by their faces.
class TetComponents {
 public:
  explicit TetComponents(const TetMesh& mesh) : sets_(static_cast<std::size_t>(mesh.tet_count())) {
    const auto faces = sorted_faces(mesh);
    for (std::size_t i = 1; i < faces.size(); ++i)
      if (faces[i].corners == faces[i - 1].corners) sets_.join(faces[i].tet, faces[i - 1].tet);
  }

  /// The first tet of the component of `tet`.
  std::int32_t find(std::int32_t tet) { return sets_.root(tet); }

 private:
  struct Face {
    std::array<std::int32_t, 3> corners;
    std::int32_t tet;
  };

  static std::vector<Face> sorted_faces(const TetMesh& mesh) {
    std::vector<Face> faces;
    faces.reserve(4 * static_cast<std::size_t>(mesh.tet_count()));
    for (Index t = 0; t < mesh.tet_count(); ++t) {
      const auto [a, b, c, d] = sorted_corners(mesh, t);
      const auto tet = static_cast<std::int32_t>(t);
      faces.insert(faces.end(), {{{a, b, c}, tet}, {{a, b, d}, tet}, {{a, c, d}, tet}, {{b, c, d}, tet}});
    }
    std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.corners < b.corners; });
    return faces;
  }

  DisjointSets sets_;
};

/// For each tet the first tet of its component.
std::vector<std::int32_t> component_of_tets(const TetMesh& mesh) {
  TetComponents components(mesh);
  std::vector<std::int32_t> roots(static_cast<std::size_t>(mesh.tet_count()));
  for (std::size_t t = 0; t < roots.size(); ++t) roots[t] = components.find(static_cast<std::int32_t>(t));
  return roots;
}

std::int32_t largest_component(const TetMesh& mesh, const std::vector<std::int32_t>& roots) {
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  std::vector<double> volume_of_root(roots.size(), 0.0);
  for (std::size_t t = 0; t < roots.size(); ++t)
    volume_of_root[static_cast<std::size_t>(roots[t])] += volumes[static_cast<Index>(t)];
  return static_cast<std::int32_t>(std::max_element(volume_of_root.begin(), volume_of_root.end()) -
                                   volume_of_root.begin());
}

/// Vertices at exactly the place of another one, beyond the first there.
Index coincident_vertices(const TetMesh& mesh) {
  std::vector<std::array<double, 3>> places;
  for (const auto& x : mesh.vertices.rowwise()) places.push_back({x[0], x[1], x[2]});
  std::sort(places.begin(), places.end());
  return std::ssize(places) - std::distance(places.begin(), std::unique(places.begin(), places.end()));
}

void mend_components(TetMesh& mesh, const std::string& file, bool drop, MeshReport& report) {
  const auto roots = component_of_tets(mesh);
  const std::int32_t largest = largest_component(mesh, roots);
  std::vector<char> is_kept(roots.size(), 1);
  Index components = 0;
  Faults outside;
  for (std::size_t t = 0; t < roots.size(); ++t) {
    if (roots[t] == static_cast<std::int32_t>(t)) ++components;
    if (roots[t] == largest) continue;
    outside.add(report.kept_tets[t]);
    is_kept[t] = 0;
  }
  report.dropped_components = components - 1;
  if (components == 1) return;
  const Index coincident = drop ? 0 : coincident_vertices(mesh);
  if (coincident > 0)
    throw InputError({file, outside.place("tet", "tets"), "one component, its tets joined by faces",
                      std::to_string(components) + " components, and " + std::to_string(coincident) +
                          " vertices at places where another one is",
                      "merge vertices at the same place, as 'gmsh' does by Coherence Mesh"});
  if (!drop)
    throw InputError(
        {file, outside.place("tet", "tets"), "one component, its tets joined by faces",
         std::to_string(components) + " components",
         "drop the smaller ones with \"drop\": [\"smaller_components\"] or join them: tets that touch the rest "
         "only in an edge or a vertex are a component of their own"});
  keep_tets(mesh, report, is_kept);
}

void compact_vertices(TetMesh& mesh, MeshReport& report) {
  const auto is_referenced = referenced_vertices(mesh);
  std::vector<std::int32_t> new_index(is_referenced.size(), -1);
  for (std::size_t v = 0; v < is_referenced.size(); ++v) {
    if (!is_referenced[v]) continue;
    const auto index = static_cast<Index>(report.kept_vertices.size());
    new_index[v] = static_cast<std::int32_t>(index);
    mesh.vertices.row(index) = mesh.vertices.row(static_cast<Index>(v));
    report.kept_vertices.push_back(static_cast<std::int32_t>(v));
  }
  const auto count = static_cast<Index>(report.kept_vertices.size());
  report.dropped_vertices = mesh.vertex_count() - count;
  mesh.vertices.conservativeResize(count, 3);
  for (Index t = 0; t < mesh.tet_count(); ++t)
    for (int corner = 0; corner < 4; ++corner)
      mesh.tets(t, corner) = new_index[static_cast<std::size_t>(mesh.tets(t, corner))];
}

}  // namespace

void require_extent(const VertexArray& vertices, const std::string& file) {
  const double length = longest_box_edge(vertices);
  if (length >= 1e-100 && length <= 1e100) return;
  throw InputError({file, "vertices", "a longest edge of the bounding box from 1e-100 to 1e100 m", to_text(length),
                    "scale the mesh, as object.unit or object.scale of the asset does"});
}

MeshReport check_mesh(TetMesh& mesh, const std::string& file, const MeshCheckOptions& options) {
  require_content(mesh, file);
  require_finite(mesh, file);
  require_extent(mesh.vertices, file);
  require_indices_in_range(mesh, file);
  // Before tets are dropped: a vertex that only they use goes with them.
  if (!options.drop_unreferenced_vertices) require_referenced_vertices(mesh, file);

  MeshReport report;
  report.kept_tets.resize(static_cast<std::size_t>(mesh.tet_count()));
  std::iota(report.kept_tets.begin(), report.kept_tets.end(), 0);
  mend_degenerate_tets(mesh, file, options.drop_degenerate_tets, report);
  reorient_inverted_tets(mesh, report);
  require_distinct_tets(mesh, file, report);
  mend_components(mesh, file, options.drop_smaller_components, report);
  compact_vertices(mesh, report);
  return report;
}

}  // namespace exmat
