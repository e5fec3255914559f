#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/surface_tree.h"
#include "tests/support/articulated_bodies.h"

namespace exmat::test {
namespace {

using Eigen::Vector3d;
using precompute::SurfaceTree;

constexpr double kFine = 0.6;         // cell of the solid that is posed, over the body's
constexpr double kLeastVolume = 0.1;  // of its tets that a snapped surface leaves to each tet
constexpr int kSnappingSteps = 8;

struct Grid {
  TetMesh mesh;
  double cell = 0;
};

// The tets of a lattice over a box whose centre is wanted.
using Wanted = std::function<bool(const Vector3d&)>;

TetMesh cut(const TetMesh& mesh, const Wanted& wanted) {
  return without(mesh, [&](const Eigen::RowVector3d& x) { return !wanted(x.transpose()); });
}

// Six tets a cube; whole cubes are wanted.
TetMesh cubes(const Eigen::AlignedBox3d& box, double cell, const Wanted& wanted) {
  std::array<int, 3> cells{};
  std::array<double, 3> lengths{};
  for (std::size_t k = 0; k < 3; ++k) {
    cells[k] = static_cast<int>(std::ceil(box.sizes()[static_cast<Eigen::Index>(k)] / cell)) + 1;
    lengths[k] = cells[k] * cell;
  }
  TetMesh mesh = box_mesh(cells, lengths);
  mesh.vertices.rowwise() += box.min().transpose();
  return cut(mesh, [&](const Vector3d& x) {
    const Vector3d index = ((x - box.min()) / cell).array().floor();
    return wanted(box.min() + cell * (index + Vector3d::Constant(0.5)));
  });
}

// Four tets about each face between two cubes, of their centres and an edge of it.
TetMesh body_centred(const Eigen::AlignedBox3d& box, double cell, const Wanted& wanted) {
  const double edge = 1.26 * cell;  // as many tets a volume as six a cube
  Eigen::Array3i cells = (box.sizes() / edge).array().ceil().cast<int>() + 2;
  std::map<std::array<int, 3>, std::int32_t> numbers;  // places in half edges
  std::vector<Vector3d> vertices;
  const auto vertex = [&](const Eigen::Array3i& half) {
    const auto [found, is_new] =
        numbers.try_emplace({half[0], half[1], half[2]}, static_cast<std::int32_t>(vertices.size()));
    if (is_new) vertices.emplace_back(box.min() + 0.5 * edge * half.cast<double>().matrix());
    return found->second;
  };
  std::vector<Eigen::Vector4i> tets;
  for (int x = 0; x < cells[0]; ++x)
    for (int y = 0; y < cells[1]; ++y)
      for (int z = 0; z < cells[2]; ++z)
        for (int axis = 0; axis < 3; ++axis) {
          const Eigen::Array3i a(2 * x + 1, 2 * y + 1, 2 * z + 1);
          Eigen::Array3i b = a, u = Eigen::Array3i::Zero(), v = Eigen::Array3i::Zero();
          b[axis] += 2;
          u[(axis + 1) % 3] = 1;
          v[(axis + 2) % 3] = 1;
          const Eigen::Array3i face = (a + b) / 2;
          const std::array<Eigen::Array3i, 4> ring{face - u - v, face + u - v, face + u + v, face - u + v};
          for (std::size_t k = 0; k < 4; ++k)
            tets.emplace_back(vertex(a), vertex(ring[k]), vertex(ring[(k + 1) % 4]), vertex(b));
        }
  TetMesh mesh;
  mesh.vertices.resize(std::ssize(vertices), 3);
  for (std::size_t k = 0; k < vertices.size(); ++k)
    mesh.vertices.row(static_cast<Eigen::Index>(k)) = vertices[k].transpose();
  mesh.tets.resize(std::ssize(tets), 4);
  for (std::size_t k = 0; k < tets.size(); ++k)
    mesh.tets.row(static_cast<Eigen::Index>(k)) = tets[k].transpose().cast<std::int32_t>();
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    if (volumes[t] < 0) std::swap(mesh.tets(t, 0), mesh.tets(t, 1));
  return cut(mesh, wanted);
}

// Which points a mesh covers: its tets by the cells of a grid that their boxes touch.
class Cover {
 public:
  Cover(const TetMesh& mesh, double cell) : mesh_(mesh), cell_(cell) {
    for (const auto x : mesh.vertices.rowwise()) box_.extend(Vector3d(x.transpose()));
    cells_ = (box_.sizes() / cell).array().floor().cast<Eigen::Index>() + 1;
    tets_.resize(static_cast<std::size_t>(cells_.prod()));
    for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
      const auto x = tet_positions(mesh, t);
      const Place low = place(x.colwise().minCoeff().transpose()), high = place(x.colwise().maxCoeff().transpose());
      for (Eigen::Index i = low[0]; i <= high[0]; ++i)
        for (Eigen::Index j = low[1]; j <= high[1]; ++j)
          for (Eigen::Index k = low[2]; k <= high[2]; ++k) tets_[number({i, j, k})].push_back(t);
    }
  }

  bool operator()(const Vector3d& x) const {
    if (!box_.contains(x)) return false;
    return std::ranges::any_of(tets_[number(place(x))], [&](Eigen::Index t) { return holds(t, x); });
  }

 private:
  using Place = Eigen::Array<Eigen::Index, 3, 1>;

  Place place(const Vector3d& x) const { return ((x - box_.min()) / cell_).array().floor().cast<Eigen::Index>(); }
  std::size_t number(const Place& at) const {
    return static_cast<std::size_t>((at[0] * cells_[1] + at[1]) * cells_[2] + at[2]);
  }
  bool holds(Eigen::Index tet, const Vector3d& point) const {
    const auto x = tet_positions(mesh_, tet);
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = (x.row(k + 1) - x.row(0)).transpose();
    const Vector3d weights = edges.partialPivLu().solve(point - x.row(0).transpose());
    return weights.minCoeff() >= 0 && weights.sum() <= 1;
  }

  const TetMesh& mesh_;
  double cell_;
  Eigen::AlignedBox3d box_;
  Place cells_;
  std::vector<std::vector<Eigen::Index>> tets_;
};

TetMesh of_tets(const TetMesh& mesh, const std::vector<bool>& kept) {
  Eigen::Index at = 0;
  TetMesh result = mesh;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    if (kept[static_cast<std::size_t>(t)]) result.tets.row(at++) = mesh.tets.row(t);
  result.tets.conservativeResize(at, 4);
  return without(result, [](const Eigen::RowVector3d&) { return false; });
}

// The largest part that holds together by faces.
TetMesh largest_part(const TetMesh& mesh) {
  std::map<std::array<std::int32_t, 3>, std::int32_t> faces;
  std::vector<std::int32_t> root(static_cast<std::size_t>(mesh.tet_count()));
  for (std::size_t t = 0; t < root.size(); ++t) root[t] = static_cast<std::int32_t>(t);
  const auto find = [&](std::int32_t t) {
    while (root[static_cast<std::size_t>(t)] != t)
      t = root[static_cast<std::size_t>(t)] = root[static_cast<std::size_t>(root[static_cast<std::size_t>(t)])];
    return t;
  };
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for (int left_out = 0; left_out < 4; ++left_out) {
      std::array<std::int32_t, 3> face{};
      for (int k = 0, at = 0; k < 4; ++k)
        if (k != left_out) face[static_cast<std::size_t>(at++)] = mesh.tets(t, k);
      std::ranges::sort(face);
      const auto [found, is_new] = faces.try_emplace(face, static_cast<std::int32_t>(t));
      if (!is_new) root[static_cast<std::size_t>(find(static_cast<std::int32_t>(t)))] = find(found->second);
    }
  std::map<std::int32_t, int> sizes;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) ++sizes[find(static_cast<std::int32_t>(t))];
  const auto largest = std::ranges::max_element(sizes, {}, [](const auto& entry) { return entry.second; })->first;
  std::vector<bool> kept(root.size());
  for (std::size_t t = 0; t < kept.size(); ++t) kept[t] = find(static_cast<std::int32_t>(t)) == largest;
  return of_tets(mesh, kept);
}

std::vector<std::int32_t> surface_vertices(const TetMesh& mesh) {
  std::set<std::int32_t> ids;
  const TriangleArray triangles = surface_triangles(mesh.tets);
  for (const auto v : triangles.reshaped()) ids.insert(v);
  return {ids.begin(), ids.end()};
}

// Surface vertices move to their targets as far as tets keep a share of their volume: step by step, each alone.
void move_surface(const std::function<Vector3d(const Vector3d&)>& target, TetMesh& mesh) {
  std::vector<std::vector<Eigen::Index>> around(static_cast<std::size_t>(mesh.vertex_count()));
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for (const auto v : mesh.tets.row(t)) around[static_cast<std::size_t>(v)].push_back(t);
  const Eigen::VectorXd least = kLeastVolume * tet_volumes(mesh);
  const auto volume = [&](Eigen::Index t) {
    const auto x = tet_positions(mesh, t);
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.row(k) = x.row(k + 1) - x.row(0);
    return edges.determinant() / 6;
  };
  const auto ids = surface_vertices(mesh);
  std::vector<Vector3d> targets;
  for (const auto v : ids) targets.push_back(target(mesh.vertices.row(v).transpose()));
  for (int step = 0; step < kSnappingSteps; ++step)
    for (std::size_t k = 0; k < ids.size(); ++k) {
      const Vector3d before = mesh.vertices.row(ids[k]).transpose();
      const double share = 1.0 / (kSnappingSteps - step);
      mesh.vertices.row(ids[k]) = (before + share * (targets[k] - before)).transpose();
      const auto& tets = around[static_cast<std::size_t>(ids[k])];
      if (std::ranges::any_of(tets, [&](Eigen::Index t) { return volume(t) < least[t]; }))
        mesh.vertices.row(ids[k]) = before.transpose();
    }
}

// The body at rest, its surface on it.
TetMesh fine_solid(const PosableBody& body) {
  const double cell = kFine * body.cell;
  Eigen::AlignedBox3d box(body.bounds.min() - Vector3d::Constant(0.37 * cell), body.bounds.max());
  TetMesh mesh = largest_part(cubes(box, cell, [&](const Vector3d& x) { return body.distance(x) < 0; }));
  move_surface(
      [&](const Vector3d& x) {
        Vector3d gradient;
        for (int k = 0; k < 3; ++k) {
          const Vector3d step = 1e-4 * Vector3d::Unit(k);
          gradient[k] = (body.distance(x + step) - body.distance(x - step)) / 2e-4;
        }
        return Vector3d(x - body.distance(x) * gradient / std::max(0.5, gradient.squaredNorm()));
      },
      mesh);
  return mesh;
}

}  // namespace

TetMesh meshed(const PosableBody& body, const Pose& pose, const Meshing& meshing) {
  const TetMesh solid = posed(fine_solid(body), pose);
  const Cover wanted(solid, meshing.cell);
  std::mt19937 generator(meshing.seed);
  const auto random = [&] { return static_cast<double>(generator()) / 4294967295.0; };
  Eigen::AlignedBox3d box;
  for (const auto x : solid.vertices.rowwise()) box.extend(Vector3d(x.transpose()));
  box.min() -= meshing.cell * Vector3d(random(), random(), random());
  TetMesh mesh =
      meshing.kind == TetKind::kCubes ? cubes(box, meshing.cell, wanted) : body_centred(box, meshing.cell, wanted);
  const auto bite = [&](const Vector3d& place) {
    return
        [=, cell = meshing.cell](const Eigen::RowVector3d& x) { return (x.transpose() - place).norm() < 0.9 * cell; };
  };
  for (int hole = 0; hole < meshing.holes; ++hole) {
    const auto ids = surface_vertices(mesh);
    mesh = without(mesh, bite(mesh.vertices.row(ids[generator() % ids.size()]).transpose()));
  }
  mesh = largest_part(mesh);
  if (meshing.staircase) return mesh;
  const SurfaceTree surface(solid.vertices, surface_triangles(solid.tets));
  const double reach = 0.9 * meshing.cell;
  move_surface(
      [&](const Vector3d& x) {
        const Vector3d target = surface.nearest(x).position;
        const Vector3d shaken =
            meshing.noise * meshing.cell * Vector3d(random() - 0.5, random() - 0.5, random() - 0.5) * 2;
        return Vector3d((target - x).norm() < reach ? target + shaken : x + shaken);
      },
      mesh);
  return mesh;
}

}  // namespace exmat::test
