#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"

namespace exmat::test {

/// A bar along x clamped at x = 0, or free, cut into cubes of six tets.
struct BarOptions {
  std::array<int, 3> cells{6, 2, 2};
  std::array<double, 3> lengths{1.0, 0.25, 0.25};  ///< [m]
  double youngs_modulus = 1e5;                     ///< [Pa]
  double poisson_ratio = 0.35;
  MaterialModel material = MaterialModel::kStVenantKirchhoff;
  double density = 1000;        ///< [kg/m^3]
  double density_gradient = 0;  ///< density * (1 + density_gradient * x / length)
  bool free = false;            ///< not clamped: the six rigid modes are left out and /rigid is filled
  bool carried = false;         ///< clamped, and /rigid is filled
  int slot_start = -1;  ///< cells of the second layer in z from here to the end are left out: a bar with two prongs
  int linear_modes = 8;
  int eigenfunctions = 6;  ///< m
  int examples = 0;        ///< K, the rest pose counted: rest, bend, twist, stretch, then mixtures of them
};

/// An independent producer of the contract: dense matrices, no code of the precompute stage.
struct Bar {
  ReducedModel model;
  Eigen::MatrixXd mass;                         ///< 3n x 3n, consistent
  Eigen::MatrixXd stiffness;                    ///< 3n x 3n, linear elasticity
  std::vector<Eigen::VectorXd> example_fields;  ///< K, 3n
  double length = 0;                            ///< bounding-box diagonal [m]

  const RowMatrix& basis() const { return model.modal->basis; }
  Eigen::Index modes() const { return basis().cols(); }
};
Bar make_bar(const BarOptions& options = {});

/// Energy density and first Piola-Kirchhoff stress as the definitions have them, term by term.
double energy_density(MaterialModel model, const Eigen::Matrix3d& F, double youngs_modulus, double poisson_ratio);
Eigen::Matrix3d first_piola_kirchhoff(MaterialModel model, const Eigen::Matrix3d& F, double youngs_modulus,
                                      double poisson_ratio);

/// 3n internal force at the displacement u [3n], by nodes: f_i = V P grad N_i.
Eigen::VectorXd full_internal_force(const Bar& bar, const Eigen::VectorXd& displacement);

/// [3n] positions of all vertices of a free bar after `time` by the classical Runge-Kutta method, M x'' = -f_int, from
/// positions x and velocities v [3n].
Eigen::VectorXd runge_kutta_positions(const Bar& bar, Eigen::VectorXd x, Eigen::VectorXd v, double time, int steps);

/// Contact at all surface vertices, a third of the area of their triangles each.
ContactData surface_contact(const ReducedModel& model);

}  // namespace exmat::test
