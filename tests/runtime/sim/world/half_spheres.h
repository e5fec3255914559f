#pragma once

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "common/mesh/geometry.h"
#include "runtime/sim/world/world.h"
#include "tests/support/synthetic_model.h"

namespace exmat::runtime::test {

using namespace exmat::test;  // so that test:: is one

/// Half of a sphere about the z axis, from its equator to its pole, as a meridian of triangles turned about the axis.
struct HalfSphereOptions {
  double radius = 1;
  double youngs_modulus = 1e6, poisson_ratio = 0.3;
  double finest = 0.01;      ///< edges of the meridian at the pole [m]
  double fine_until = 0.12;  ///< distance from the pole up to which they are that fine [m]
  double growth = 1.3;       ///< ratio of an edge to the one before it, beyond
  int sectors = 24;          ///< sectors of the circle
};

/// Its meridian, in linear elasticity of motions that are the same all around: two coordinates for each node, away from
/// the axis and along it. What is pressed at the pole moves as a solution with all of these coordinates says.
class HalfSphere {
 public:
  explicit HalfSphere(const HalfSphereOptions& options) : options_(options) {
    make_nodes();
    make_elements();
    factorise();
  }

  const HalfSphereOptions& options() const { return options_; }

  /// The share of the surface that the vertex at the pole stands for [m^2].
  double pole_area() const {
    const Eigen::Vector3d pole = turned(0, 0), a = turned(1, 0) - pole, b = turned(1, 1) - pole;
    return a.cross(b).norm() / 6 * options_.sectors;
  }

  /// Displacements [2 nodes x rings] by forces along and away from the axis on each ring of the surface that is nearer
  /// to the axis than `reach` [m]: what any pressure there makes is a sum of them.
  Eigen::MatrixXd pressed_shapes(double reach) const {
    std::vector<int> loaded;
    for (int node : surface_)
      if (nodes_(node, 0) <= reach)
        for (int axis : {0, 1})
          if (place_of_[at(node, axis)] >= 0) loaded.push_back(place_of_[at(node, axis)]);
    Eigen::MatrixXd shapes = Eigen::MatrixXd::Zero(2 * nodes_.rows(), std::ssize(loaded));
    for (Eigen::Index i = 0; i < shapes.cols(); ++i) {
      const Eigen::VectorXd solution =
          solver_.solve(Eigen::VectorXd::Unit(free_count_, loaded[static_cast<std::size_t>(i)]));
      for (std::size_t c = 0; c < place_of_.size(); ++c)
        if (place_of_[c] >= 0) shapes(static_cast<Eigen::Index>(c), i) = solution[place_of_[c]];
    }
    return shapes;
  }

  /// A body with these shapes as its basis, its equator held in the plane z = `equator` and its pole above it, or
  /// below.
  ReducedModel body(const Eigen::MatrixXd& shapes, double equator, bool upwards) const {
    ReducedModel model;
    model.asset_name = "half_sphere";
    model.generator = "synthetic";
    model.input_sha256 = std::string(64, '0');
    ObjectData& object = model.object.emplace();
    std::vector<Eigen::Triplet<double>> turned;  // [3n x 2 nodes]
    make_mesh(equator, upwards ? 1 : -1, object.mesh, turned);
    object.surface = surface_triangles(object.mesh.tets);
    object.fixed.setZero(object.mesh.vertex_count());
    const Eigen::Index tets = object.mesh.tet_count();
    object.materials.density = Eigen::VectorXd::Constant(tets, 1000);
    object.materials.youngs_modulus = Eigen::VectorXd::Constant(tets, options_.youngs_modulus);
    object.materials.poisson_ratio = Eigen::VectorXd::Constant(tets, options_.poisson_ratio);
    object.materials.model = MaterialModel::kCorotational;
    Eigen::SparseMatrix<double> turn(3 * object.mesh.vertex_count(), shapes.rows());
    turn.setFromTriplets(turned.begin(), turned.end());
    set_basis(turn * shapes, model);
    set_elements(model);
    model.contact = exmat::test::surface_contact(model);
    return model;
  }

 private:
  struct Corner {
    int node = 0, side = 0;  // of a sector: 0 or 1
  };
  using Tet = std::array<Corner, 4>;

  static std::size_t at(int node, int axis) {
    return 2 * static_cast<std::size_t>(node) + static_cast<std::size_t>(axis);
  }

  /// Places in [0, 1], finest at 0, of a side of that length.
  std::vector<double> graded(double length) const {
    std::vector<double> places{0};
    double edge = options_.finest;
    while (places.back() < length) {
      if (places.back() >= options_.fine_until) edge *= options_.growth;
      places.push_back(places.back() + edge);
    }
    for (double& place : places) place /= places.back();
    return places;
  }

  /// Nodes of a quarter of a disk between its pole, its centre, the equator and the middle of its arc (Coons patch).
  void make_nodes() {
    const double R = options_.radius, quarter = std::numbers::pi / 4;
    const std::vector<double> along = graded(R * quarter), down = graded(R);
    columns_ = static_cast<int>(along.size());
    rows_ = static_cast<int>(down.size());
    nodes_.resize(columns_ * rows_, 2);
    const auto arc = [&](double angle) { return Eigen::RowVector2d(R * std::sin(angle), R * std::cos(angle)); };
    for (int j = 0; j < rows_; ++j)
      for (int i = 0; i < columns_; ++i) {
        const double u = along[static_cast<std::size_t>(i)], v = down[static_cast<std::size_t>(j)];
        const Eigen::RowVector2d top = arc(u * quarter), bottom(u * R, 0), left(0, (1 - v) * R),
                                 right = arc((1 + v) * quarter);
        const Eigen::RowVector2d corners =
            (1 - u) * (1 - v) * arc(0) + u * (1 - v) * arc(quarter) + u * v * arc(2 * quarter);
        nodes_.row(j * columns_ + i) = (1 - v) * top + v * bottom + (1 - u) * left + u * right - corners;
      }
    for (int j = 0; j < rows_; ++j) nodes_(j * columns_, 0) = 0;
    for (int i = 0; i < columns_; ++i) nodes_((rows_ - 1) * columns_ + i, 1) = 0;
    for (int i = 0; i < columns_; ++i) surface_.push_back(i);
  }

  bool on_axis(int node) const { return node % columns_ == 0; }
  bool on_equator(int node) const { return node / columns_ == rows_ - 1; }

  /// Tets of a sector between two meridians, as pairs of a node and its side.
  void make_elements() {
    const auto add_prism = [&](std::array<int, 3> corners) {
      std::ranges::sort(corners);
      const auto [a, b, c] = corners;
      for (const Tet& tet : {Tet{Corner{a, 0}, {b, 0}, {c, 0}, {c, 1}}, Tet{Corner{a, 0}, {b, 0}, {b, 1}, {c, 1}},
                             Tet{Corner{a, 0}, {a, 1}, {b, 1}, {c, 1}}}) {
        const auto same = [&](const Corner& one, const Corner& next) {
          return one.node == next.node && on_axis(one.node);
        };
        if (std::ranges::adjacent_find(tet, same) == tet.end()) sector_.push_back(tet);
      }
    };
    for (int j = 0; j + 1 < rows_; ++j)
      for (int i = 0; i + 1 < columns_; ++i) {
        const int first = j * columns_ + i;
        add_prism({first, first + 1, first + columns_});
        add_prism({first + 1, first + columns_ + 1, first + columns_});
      }
  }

  Eigen::Vector3d turned(int node, int sector) const {
    const double angle = 2 * std::numbers::pi * sector / options_.sectors;
    return {nodes_(node, 0) * std::cos(angle), nodes_(node, 0) * std::sin(angle), nodes_(node, 1)};
  }
  /// [3 x 2] how a node's coordinates move its vertex.
  static Eigen::Matrix<double, 3, 2> directions(double angle) {
    Eigen::Matrix<double, 3, 2> out;
    out << std::cos(angle), 0, std::sin(angle), 0, 0, 1;
    return out;
  }

  void factorise() {
    place_of_.assign(static_cast<std::size_t>(2 * nodes_.rows()), -1);
    for (int node = 0; node < nodes_.rows(); ++node) {
      if (!on_axis(node)) place_of_[at(node, 0)] = static_cast<int>(free_count_++);
      if (!on_equator(node)) place_of_[at(node, 1)] = static_cast<int>(free_count_++);
    }
    const double E = options_.youngs_modulus, nu = options_.poisson_ratio;
    const double mu = E / 2 / (1 + nu), lambda = E * nu / (1 + nu) / (1 - 2 * nu);
    std::vector<Eigen::Triplet<double>> entries;
    for (const auto& tet : sector_) {
      Eigen::Matrix<double, 4, 3> corners;
      for (int k = 0; k < 4; ++k)
        corners.row(k) = turned(tet[static_cast<std::size_t>(k)].node, tet[static_cast<std::size_t>(k)].side);
      const double volume = std::abs(tet_volume(corners)) * options_.sectors;
      const auto shape = shape_gradients(corners);
      Eigen::Matrix<double, 12, 8> moves = Eigen::Matrix<double, 12, 8>::Zero();
      Eigen::Matrix<double, 12, 12> full;
      for (int i = 0; i < 4; ++i) {
        moves.block<3, 2>(3 * i, 2 * i) =
            directions(2 * std::numbers::pi * tet[static_cast<std::size_t>(i)].side / options_.sectors);
        for (int j = 0; j < 4; ++j) {
          const Eigen::Vector3d a = shape.row(i), b = shape.row(j);
          full.block<3, 3>(3 * i, 3 * j) = volume * (lambda * a * b.transpose() + mu * b * a.transpose() +
                                                     mu * a.dot(b) * Eigen::Matrix3d::Identity());
        }
      }
      const Eigen::Matrix<double, 8, 8> element = moves.transpose() * full * moves;
      for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 8; ++j) {
          const int row = place_of_[at(tet[static_cast<std::size_t>(i / 2)].node, i % 2)],
                    column = place_of_[at(tet[static_cast<std::size_t>(j / 2)].node, j % 2)];
          if (row >= 0 && column >= 0) entries.emplace_back(row, column, element(i, j));
        }
    }
    Eigen::SparseMatrix<double> stiffness(free_count_, free_count_);
    stiffness.setFromTriplets(entries.begin(), entries.end());
    solver_.compute(stiffness);
  }

  static double tet_volume(const Eigen::Matrix<double, 4, 3>& corners) {
    const Eigen::Matrix3d edges = corners.bottomRows<3>().rowwise() - corners.row(0);
    return edges.determinant() / 6;
  }

  int vertex(int node, int sector) const {
    const auto at_node = static_cast<std::size_t>(node);
    return first_vertex_[at_node] + (on_axis(node) ? 0 : sector % options_.sectors);
  }

  void make_mesh(double equator, double up, TetMesh& mesh, std::vector<Eigen::Triplet<double>>& moves) const {
    first_vertex_.clear();
    int count = 0;
    for (int node = 0; node < nodes_.rows(); ++node) {
      first_vertex_.push_back(count);
      count += on_axis(node) ? 1 : options_.sectors;
    }
    mesh.vertices.resize(count, 3);
    for (int node = 0; node < nodes_.rows(); ++node)
      for (int sector = 0; sector < (on_axis(node) ? 1 : options_.sectors); ++sector) {
        const int v = vertex(node, sector);
        const Eigen::Vector3d x = turned(node, sector);
        mesh.vertices.row(v) << x[0], x[1], equator + up * x[2];
        const auto move = directions(2 * std::numbers::pi * sector / options_.sectors);
        for (int axis = 0; axis < 3; ++axis)
          for (int k = 0; k < 2; ++k)
            if (move(axis, k) != 0)
              moves.emplace_back(3 * v + axis, 2 * node + k, (axis == 2 ? up : 1) * move(axis, k));
      }
    mesh.tets.resize(std::ssize(sector_) * options_.sectors, 4);
    Eigen::Index t = 0;
    for (int sector = 0; sector < options_.sectors; ++sector)
      for (const auto& tet : sector_) {
        for (int k = 0; k < 4; ++k)
          mesh.tets(t, k) =
              vertex(tet[static_cast<std::size_t>(k)].node, sector + tet[static_cast<std::size_t>(k)].side);
        if (tet_volume(tet_positions(mesh, t)) < 0) std::swap(mesh.tets(t, 2), mesh.tets(t, 3));
        ++t;
      }
  }

  /// Mass-orthonormal, by the consistent mass.
  static void set_basis(const Eigen::MatrixXd& shapes, ReducedModel& model) {
    const ObjectData& object = *model.object;
    std::vector<Eigen::Triplet<double>> entries;
    const Eigen::VectorXd volumes = tet_volumes(object.mesh);
    for (Eigen::Index t = 0; t < object.mesh.tet_count(); ++t)
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
          for (int axis = 0; axis < 3; ++axis)
            entries.emplace_back(3 * object.mesh.tets(t, i) + axis, 3 * object.mesh.tets(t, j) + axis,
                                 object.materials.density[t] * volumes[t] / 20 * (i == j ? 2 : 1));
    Eigen::SparseMatrix<double> mass(shapes.rows(), shapes.rows());
    mass.setFromTriplets(entries.begin(), entries.end());
    Eigen::MatrixXd basis = shapes;
    for (int pass = 0; pass < 2; ++pass)
      for (Eigen::Index j = 0; j < basis.cols(); ++j) {
        Eigen::VectorXd column = basis.col(j);
        for (int again = 0; again < 2; ++again) {
          const Eigen::VectorXd products = basis.leftCols(j).transpose() * (mass * column);
          column -= basis.leftCols(j) * products;
        }
        basis.col(j) = column / std::sqrt(column.dot(mass * column));
      }
    ModalData& modal = model.modal.emplace();
    modal.basis = basis;
    modal.frequencies.resize(0);
    modal.gravity_load.setZero(3, basis.cols());
  }

  /// Those of one sector stand for all: the motions are the same all around.
  void set_elements(ReducedModel& model) const {
    const ObjectData& object = *model.object;
    const auto count = std::ssize(sector_);
    CubatureData& cubature = model.cubature.emplace();
    cubature.elements = IndexVector::LinSpaced(count, 0, static_cast<std::int32_t>(count - 1));
    cubature.weights = Eigen::VectorXd::Constant(count, options_.sectors);
    cubature.volumes = tet_volumes(object.mesh).head(count);
    cubature.youngs_modulus = object.materials.youngs_modulus.head(count);
    cubature.poisson_ratio = object.materials.poisson_ratio.head(count);
    cubature.heldout_poses.resize(0, model.modal->basis.cols());
    cubature.gradient.setZero(9 * count, model.modal->basis.cols());
    for (Eigen::Index t = 0; t < count; ++t) {
      const auto shape = shape_gradients(tet_positions(object.mesh, t));
      for (int k = 0; k < 4; ++k)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            cubature.gradient.row(9 * t + 3 * a + b) +=
                shape(k, b) * model.modal->basis.row(3 * object.mesh.tets(t, k) + a);
    }
  }

  HalfSphereOptions options_;
  int columns_ = 0, rows_ = 0;
  Eigen::Matrix<double, Eigen::Dynamic, 2> nodes_;  // from the axis, above the equator
  std::vector<int> surface_;                        // nodes of the upper half of the arc, from the pole
  std::vector<Tet> sector_;
  std::vector<int> place_of_;  // of a coordinate among the free ones; -1: held
  Eigen::Index free_count_ = 0;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver_;
  mutable std::vector<int> first_vertex_;
};

}  // namespace exmat::runtime::test
