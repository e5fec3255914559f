#include "tests/support/synthetic_model.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"

namespace exmat::test {
namespace {

constexpr std::array<std::array<int, 3>, 6> kAxisOrders{
    {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};

TetMesh bar_mesh(const BarOptions& options) {
  const int nx = options.cells[0], ny = options.cells[1], nz = options.cells[2];
  const auto index = [&](int i, int j, int k) { return (i * (ny + 1) + j) * (nz + 1) + k; };
  TetMesh mesh;
  mesh.vertices.resize((nx + 1) * (ny + 1) * (nz + 1), 3);
  for (int i = 0; i <= nx; ++i)
    for (int j = 0; j <= ny; ++j)
      for (int k = 0; k <= nz; ++k)
        mesh.vertices.row(index(i, j, k)) << options.lengths[0] * i / nx, options.lengths[1] * j / ny,
            options.lengths[2] * k / nz;
  mesh.tets.resize(6 * nx * ny * nz, 4);
  Eigen::Index tet = 0;
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      for (int k = 0; k < nz; ++k) {
        if (options.slot_start >= 0 && i >= options.slot_start && k == 1) continue;
        for (const auto& order : kAxisOrders) {
          std::array<int, 3> at{i, j, k};
          mesh.tets(tet, 0) = index(at[0], at[1], at[2]);
          for (int corner = 1; corner < 4; ++corner) {
            ++at[order[corner - 1]];
            mesh.tets(tet, corner) = index(at[0], at[1], at[2]);
          }
          const auto x = tet_positions(mesh, tet);
          const Eigen::Matrix3d edges = x.bottomRows<3>().rowwise() - x.row(0);
          if (edges.determinant() < 0) std::swap(mesh.tets(tet, 2), mesh.tets(tet, 3));
          ++tet;
        }
      }
  mesh.tets.conservativeResize(tet, 4);
  return mesh;
}

/// [9 x 12] from the 12 displacements of a tet to H_ab at 3a + b.
Eigen::Matrix<double, 9, 12> tet_gradient(const TetMesh& mesh, Eigen::Index tet) {
  Eigen::Matrix4d affine;
  affine << Eigen::Vector4d::Ones(), tet_positions(mesh, tet);
  const Eigen::Matrix<double, 3, 4> shape = affine.inverse().bottomRows<3>();
  Eigen::Matrix<double, 9, 12> gradient = Eigen::Matrix<double, 9, 12>::Zero();
  for (int corner = 0; corner < 4; ++corner)
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) gradient(3 * a + b, 3 * corner + a) = shape(b, corner);
  return gradient;
}

/// mu, lambda.
std::pair<double, double> lame(double youngs_modulus, double poisson_ratio) {
  return {youngs_modulus / 2 / (1 + poisson_ratio),
          youngs_modulus * poisson_ratio / (1 + poisson_ratio) / (1 - 2 * poisson_ratio)};
}

/// Rotation of the polar decomposition, a proper one also where F is inverted.
Eigen::Matrix3d rotation(const Eigen::Matrix3d& F) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, F.determinant() < 0 ? -1 : 1);
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

struct FullMatrices {
  Eigen::MatrixXd scalar_mass, laplacian;  ///< n x n
  Eigen::MatrixXd mass, stiffness;         ///< 3n x 3n
};

FullMatrices assemble(const ObjectData& object) {
  const TetMesh& mesh = object.mesh;
  const Eigen::Index n = mesh.vertex_count();
  FullMatrices full{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(3 * n, 3 * n),
                    Eigen::MatrixXd::Zero(3 * n, 3 * n)};
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const auto [mu, lambda] = lame(object.materials.youngs_modulus[t], object.materials.poisson_ratio[t]);
    Eigen::Matrix<double, 9, 9> hooke = Eigen::Matrix<double, 9, 9>::Zero();
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        hooke(3 * a + b, 3 * a + b) += mu;
        hooke(3 * a + b, 3 * b + a) += mu;
        hooke(4 * a, 4 * b) += lambda;
      }
    const auto gradient = tet_gradient(mesh, t);
    const Eigen::Matrix<double, 12, 12> element = volumes[t] * gradient.transpose() * hooke * gradient;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const auto row = mesh.tets(t, i), column = mesh.tets(t, j);
        const double mass = volumes[t] / 20 * (i == j ? 2 : 1);
        full.scalar_mass(row, column) += mass;
        for (int b = 0; b < 3; ++b) full.laplacian(row, column) += volumes[t] * gradient(b, 3 * i) * gradient(b, 3 * j);
        full.mass.block<3, 3>(3 * row, 3 * column) += object.materials.density[t] * mass * Eigen::Matrix3d::Identity();
        full.stiffness.block<3, 3>(3 * row, 3 * column) += element.block<3, 3>(3 * i, 3 * j);
      }
  }
  return full;
}

/// Displacement of example k at the rest position x, zero at the clamp.
Eigen::Vector3d example_displacement(int k, const Eigen::Vector3d& x, const BarOptions& options) {
  const double s = x[0] / options.lengths[0];
  const Eigen::Vector3d bend(0, 0.2 * s * s, 0);
  const double angle = 0.3 * std::numbers::pi * s;
  const double y = x[1] - options.lengths[1] / 2, z = x[2] - options.lengths[2] / 2;
  const Eigen::Vector3d twist(0, std::cos(angle) * y - std::sin(angle) * z - y,
                              std::sin(angle) * y + std::cos(angle) * z - z);
  const Eigen::Vector3d stretch(0.15 * s, 0, 0);
  switch (k) {
    case 0:
      return Eigen::Vector3d::Zero();
    case 1:
      return bend;
    case 2:
      return twist;
    case 3:
      return stretch;
    default:
      return 0.5 * bend / (k - 2) + 0.4 * stretch;
  }
}

Eigen::VectorXd example_field(int k, const TetMesh& mesh, const BarOptions& options) {
  Eigen::VectorXd field(3 * mesh.vertex_count());
  for (Eigen::Index i = 0; i < mesh.vertex_count(); ++i)
    field.segment<3>(3 * i) = example_displacement(k, mesh.vertices.row(i), options);
  return field;
}

/// The lowest linear modes, then the example fields, mass-orthonormal, zero on fixed vertices.
ModalData modal_basis(const ObjectData& object, const FullMatrices& full, const std::vector<Eigen::VectorXd>& fields,
                      int linear_modes) {
  std::vector<int> free;
  for (int dof = 0; dof < static_cast<int>(full.mass.rows()); ++dof)
    if (object.fixed[dof / 3] == 0) free.push_back(dof);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(full.stiffness(free, free),
                                                                         full.mass(free, free));
  const int rigid = object.fixed.any() ? 0 : 6;
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(full.mass.rows(), linear_modes);
  for (int mode = 0; mode < linear_modes; ++mode) basis(free, mode) = solver.eigenvectors().col(rigid + mode);
  const Eigen::MatrixXd rigid_modes = solver.eigenvectors().leftCols(rigid);  // all coordinates are free then
  for (std::size_t k = 1; k < std::min<std::size_t>(fields.size(), 4); ++k) {
    Eigen::VectorXd column = fields[k];
    for (int pass = 0; pass < 3; ++pass) {
      if (rigid > 0) column -= rigid_modes * (rigid_modes.transpose() * (full.mass * column));
      column -= basis * (basis.transpose() * (full.mass * column));
      column /= std::sqrt(column.dot(full.mass * column));
    }
    basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
    basis.rightCols<1>() = column;
  }
  ModalData modal;
  modal.basis = basis;
  modal.frequencies = solver.eigenvalues().segment(rigid, linear_modes).cwiseSqrt() / (2 * std::numbers::pi);
  modal.gravity_load.resize(3, basis.cols());
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::VectorXd unit = Eigen::VectorXd::Zero(full.mass.rows());
    for (Eigen::Index i = axis; i < unit.size(); i += 3) unit[i] = 1;
    modal.gravity_load.row(axis) = basis.transpose() * (full.mass * unit);
  }
  return modal;
}

/// By vertices, from their definition.
RigidData rigid_data(const ObjectData& object, const FullMatrices& full, const ModalData& modal) {
  const Eigen::Index n = object.mesh.vertex_count(), r = modal.basis.cols();
  const Eigen::MatrixXd scalar = full.mass(Eigen::seqN(0, n, 3), Eigen::seqN(0, n, 3));
  const Eigen::VectorXd masses = scalar * Eigen::VectorXd::Ones(n);
  RigidData rigid;
  rigid.mass = masses.sum();
  rigid.centre_of_mass = object.mesh.vertices.transpose() * masses / rigid.mass;
  const VertexArray X = object.mesh.vertices.rowwise() - rigid.centre_of_mass.transpose();
  rigid.second_moments = X.transpose() * scalar * X;
  rigid.inertia = rigid.second_moments.trace() * Eigen::Matrix3d::Identity() - rigid.second_moments;
  rigid.linear_moments.resize(9, r);
  rigid.basis_moments.resize(9 * r, r);
  rigid.spin_load.setZero(3, r);
  for (Eigen::Index i = 0; i < n; ++i)  // (X_i x) by columns
    for (Eigen::Index j = 0; j < n; ++j)
      for (int axis = 0; axis < 3; ++axis)
        rigid.spin_load +=
            scalar(i, j) * Eigen::Vector3d(X.row(i)).cross(Eigen::Vector3d::Unit(axis)) * modal.basis.row(3 * j + axis);
  const auto rows = [&](int axis) { return Eigen::MatrixXd(modal.basis(Eigen::seqN(axis, n, 3), Eigen::all)); };
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      rigid.linear_moments.row(3 * a + b) =
          X.col(a).transpose() * scalar * rows(b) + X.col(b).transpose() * scalar * rows(a);
      rigid.basis_moments.middleRows((3 * a + b) * r, r) = rows(a).transpose() * scalar * rows(b);
    }
  return rigid;
}

CubatureData all_elements(const ObjectData& object, const ModalData& modal) {
  const Eigen::Index count = object.mesh.tet_count();
  CubatureData cubature;
  cubature.elements = IndexVector::LinSpaced(count, 0, static_cast<std::int32_t>(count - 1));
  cubature.weights = Eigen::VectorXd::Ones(count);
  cubature.volumes = tet_volumes(object.mesh);
  cubature.youngs_modulus = object.materials.youngs_modulus;
  cubature.poisson_ratio = object.materials.poisson_ratio;
  cubature.variance = RowMatrix::Zero(modal.basis.cols(), modal.basis.cols());
  cubature.heldout_poses.resize(0, modal.basis.cols());
  cubature.method = CubatureMethod::kGreedySwap;
  cubature.gradient.resize(9 * count, modal.basis.cols());
  for (Eigen::Index t = 0; t < count; ++t) {
    Eigen::MatrixXd rows(12, modal.basis.cols());
    for (int corner = 0; corner < 4; ++corner)
      rows.middleRows<3>(3 * corner) = modal.basis.middleRows<3>(3 * object.mesh.tets(t, corner));
    cubature.gradient.middleRows<9>(9 * t) = tet_gradient(object.mesh, t) * rows;
  }
  return cubature;
}

ShapeSpaceData shape_space(const ObjectData& object, const FullMatrices& full, int eigenfunctions) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(full.laplacian, full.scalar_mass);
  ShapeSpaceData space;
  space.volume = full.scalar_mass.sum();
  space.centroid = centroid(object.mesh);
  space.weighting = Weighting::kEigenvalue;
  space.eigenvalues = solver.eigenvalues().segment(1, eigenfunctions) * std::pow(space.volume, 2.0 / 3.0);
  space.eigenfunctions = solver.eigenvectors().middleCols(1, eigenfunctions) * std::sqrt(space.volume);
  const VertexArray normalised =
      (object.mesh.vertices.rowwise() - space.centroid.transpose()) / std::cbrt(space.volume);
  space.rest_descriptor = space.eigenvalues.asDiagonal() *
                          (space.eigenfunctions.transpose() * (full.scalar_mass * normalised)) / space.volume;
  return space;
}

/// Phi (x) I_3 [3n x 3m].
Eigen::MatrixXd times_identity(const RowMatrix& matrix) {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(3 * matrix.rows(), 3 * matrix.cols());
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j)
      product.block<3, 3>(3 * i, 3 * j) = matrix(i, j) * Eigen::Matrix3d::Identity();
  return product;
}

ProjectionData projection(const ShapeSpaceData& space, const FullMatrices& full, const ModalData& modal, bool uniform) {
  const double scale = std::cbrt(space.volume);
  const RowMatrix scalar_mass = full.scalar_mass;
  const Eigen::MatrixXd phi = times_identity(space.eigenfunctions);
  const Eigen::VectorXd weights = space.eigenvalues.replicate(1, 3).transpose().reshaped();
  ProjectionData data;
  data.shape_from_reduced =
      weights.asDiagonal() * (phi.transpose() * (times_identity(scalar_mass) * modal.basis)) / space.volume / scale;
  data.reduced_from_shape = modal.basis.transpose() * (full.mass * phi) * weights.cwiseInverse().asDiagonal() * scale;
  const Eigen::MatrixXd ones = Eigen::MatrixXd::Ones(full.mass.cols(), 1);
  if (!uniform) data.filter_scale = std::sqrt((full.mass * ones).sum() / 3) * scale * space.eigenvalues.cwiseInverse();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(data.reduced_from_shape);
  qr.setThreshold(1e-10);
  data.target_basis = Eigen::MatrixXd(qr.householderQ()).leftCols(qr.rank());
  return data;
}

ExampleSet example_set(const ShapeSpaceData& space, const ProjectionData& project, const FullMatrices& full,
                       const std::vector<Eigen::VectorXd>& fields) {
  const Eigen::VectorXd weights = space.eigenvalues.replicate(1, 3).transpose().reshaped();
  const RowMatrix scalar_mass = full.scalar_mass;
  const Eigen::MatrixXd to_shape = weights.asDiagonal() *
                                   (times_identity(space.eigenfunctions).transpose() * times_identity(scalar_mass)) /
                                   space.volume / std::cbrt(space.volume);
  const Eigen::VectorXd rest = space.rest_descriptor.reshaped<Eigen::RowMajor>();
  ExampleSet set;
  Eigen::MatrixXd descriptors(rest.size(), fields.size());
  for (std::size_t k = 0; k < fields.size(); ++k) {
    const Eigen::VectorXd change = to_shape * fields[k];
    descriptors.col(k) = rest + change;
    ExampleData example;
    example.name = k == 0 ? "rest" : "pose" + std::to_string(k);
    example.index = static_cast<std::int64_t>(k);
    example.is_rest = k == 0;
    example.method = "correspondence";
    example.descriptor = descriptors.col(k).reshaped<Eigen::RowMajor>(rest.size() / 3, 3);
    example.pose = example.reduced = project.reduced_from_shape * change;
    set.examples.push_back(example);
  }
  set.gram = descriptors.transpose() * descriptors;
  set.h0 = descriptors.transpose() * rest;
  set.hq = descriptors.transpose() * project.shape_from_reduced;
  return set;
}

ObjectData bar_object(const BarOptions& options) {
  ObjectData object;
  object.mesh = bar_mesh(options);
  object.surface = surface_triangles(object.mesh.tets);
  object.fixed = (object.mesh.vertices.col(0).array() < (options.free ? -1 : 1e-9)).cast<std::uint8_t>();
  const Eigen::Index tets = object.mesh.tet_count();
  object.materials.density.resize(tets);
  for (Eigen::Index t = 0; t < tets; ++t) {
    const double s = tet_positions(object.mesh, t).col(0).mean() / options.lengths[0];
    object.materials.density[t] = options.density * (1 + options.density_gradient * s);
  }
  object.materials.youngs_modulus = Eigen::VectorXd::Constant(tets, options.youngs_modulus);
  object.materials.poisson_ratio = Eigen::VectorXd::Constant(tets, options.poisson_ratio);
  object.materials.model = options.material;
  return object;
}

}  // namespace

Bar make_bar(const BarOptions& options) {
  Bar bar;
  ReducedModel& model = bar.model;
  model.asset_name = "bar";
  model.generator = "synthetic";
  model.input_sha256 = std::string(64, '0');
  model.object = bar_object(options);
  const FullMatrices full = assemble(*model.object);
  for (int k = 0; k < options.examples; ++k)
    bar.example_fields.push_back(example_field(k, model.object->mesh, options));
  model.modal = modal_basis(*model.object, full, bar.example_fields, options.linear_modes);
  model.cubature = all_elements(*model.object, *model.modal);
  if (options.free || options.carried) model.rigid = rigid_data(*model.object, full, *model.modal);
  if (options.examples > 0) {
    model.shape_space = shape_space(*model.object, full, options.eigenfunctions);
    model.projection = projection(*model.shape_space, full, *model.modal, options.density_gradient == 0);
    model.examples = example_set(*model.shape_space, *model.projection, full, bar.example_fields);
  }
  bar.mass = full.mass;
  bar.stiffness = full.stiffness;
  bar.length = bounding_box_diagonal(model.object->mesh.vertices);
  return bar;
}

double energy_density(MaterialModel model, const Eigen::Matrix3d& F, double youngs_modulus, double poisson_ratio) {
  const auto [mu, lambda] = lame(youngs_modulus, poisson_ratio);
  if (model == MaterialModel::kStableNeoHookean) {
    const double own_mu = 4 * mu / 3, own_lambda = lambda + 5 * mu / 6, alpha = 1 + 0.75 * own_mu / own_lambda;
    const double invariant = F.squaredNorm(), J = F.determinant() - alpha;
    return own_mu / 2 * (invariant - 3) + own_lambda / 2 * (J * J - (1 - alpha) * (1 - alpha)) -
           own_mu / 2 * std::log((invariant + 1) / 4);
  }
  const Eigen::Matrix3d strain = model == MaterialModel::kCorotational
                                     ? Eigen::Matrix3d(rotation(F).transpose() * F - Eigen::Matrix3d::Identity())
                                     : Eigen::Matrix3d(0.5 * (F.transpose() * F - Eigen::Matrix3d::Identity()));
  return mu * strain.squaredNorm() + lambda / 2 * strain.trace() * strain.trace();
}

Eigen::Matrix3d first_piola_kirchhoff(MaterialModel model, const Eigen::Matrix3d& F, double youngs_modulus,
                                      double poisson_ratio) {
  const auto [mu, lambda] = lame(youngs_modulus, poisson_ratio);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  if (model == MaterialModel::kStableNeoHookean) {
    const double own_mu = 4 * mu / 3, own_lambda = lambda + 5 * mu / 6, alpha = 1 + 0.75 * own_mu / own_lambda;
    Eigen::Matrix3d cofactor;
    for (int a = 0; a < 3; ++a) cofactor.row(a) = F.row((a + 1) % 3).cross(F.row((a + 2) % 3));
    return own_mu * (1 - 1 / (F.squaredNorm() + 1)) * F + own_lambda * (F.determinant() - alpha) * cofactor;
  }
  if (model == MaterialModel::kCorotational) {
    const Eigen::Matrix3d R = rotation(F);
    return 2 * mu * (F - R) + lambda * ((R.transpose() * F).trace() - 3) * R;
  }
  const Eigen::Matrix3d E = 0.5 * (F.transpose() * F - I);
  return F * (2 * mu * E + lambda * E.trace() * I);
}

Eigen::VectorXd full_internal_force(const Bar& bar, const Eigen::VectorXd& displacement) {
  const ObjectData& object = *bar.model.object;
  Eigen::VectorXd force = Eigen::VectorXd::Zero(displacement.size());
  for (Eigen::Index t = 0; t < object.mesh.tet_count(); ++t) {
    const double young = object.materials.youngs_modulus[t], poisson = object.materials.poisson_ratio[t];
    Eigen::Matrix3d rest, now;
    for (int c = 0; c < 3; ++c) {
      const auto vertex = object.mesh.tets(t, c + 1), origin = object.mesh.tets(t, 0);
      rest.col(c) = (object.mesh.vertices.row(vertex) - object.mesh.vertices.row(origin)).transpose();
      now.col(c) = rest.col(c) + displacement.segment<3>(3 * vertex) - displacement.segment<3>(3 * origin);
    }
    const Eigen::Matrix3d rest_inverse = rest.inverse();
    const Eigen::Matrix3d F = now * rest_inverse;
    const Eigen::Matrix3d P = first_piola_kirchhoff(object.materials.model, F, young, poisson);
    const Eigen::Matrix3d corner_forces = rest.determinant() / 6 * P * rest_inverse.transpose();
    for (int c = 0; c < 3; ++c) {
      force.segment<3>(3 * object.mesh.tets(t, c + 1)) += corner_forces.col(c);
      force.segment<3>(3 * object.mesh.tets(t, 0)) -= corner_forces.col(c);
    }
  }
  return force;
}

Eigen::VectorXd runge_kutta_positions(const Bar& bar, Eigen::VectorXd x, Eigen::VectorXd v, double time, int steps) {
  const Eigen::LLT<Eigen::MatrixXd> mass(bar.mass);
  const Eigen::VectorXd rest = bar.model.object->mesh.vertices.reshaped<Eigen::RowMajor>();
  const auto acceleration = [&](const Eigen::VectorXd& at) {
    return Eigen::VectorXd(-mass.solve(full_internal_force(bar, at - rest)));
  };
  const double h = time / steps;
  for (int i = 0; i < steps; ++i) {
    const Eigen::VectorXd a1 = acceleration(x), v2 = v + h / 2 * a1;
    const Eigen::VectorXd a2 = acceleration(x + h / 2 * v), v3 = v + h / 2 * a2;
    const Eigen::VectorXd a3 = acceleration(x + h / 2 * v2), v4 = v + h * a3;
    const Eigen::VectorXd a4 = acceleration(x + h * v3);
    x += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
    v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  return x;
}

ContactData surface_contact(const ReducedModel& model) {
  const ObjectData& object = *model.object;
  Eigen::VectorXd areas = Eigen::VectorXd::Zero(object.mesh.vertex_count());
  for (Eigen::Index t = 0; t < object.surface.rows(); ++t) {
    const auto corner = [&](int i) { return Eigen::Vector3d(object.mesh.vertices.row(object.surface(t, i))); };
    const double area = 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    for (int i = 0; i < 3; ++i) areas[object.surface(t, i)] += area / 3;
  }
  ContactData data;
  std::vector<std::int32_t> ids;
  for (Eigen::Index i = 0; i < areas.size(); ++i)
    if (areas[i] > 0) ids.push_back(static_cast<std::int32_t>(i));
  const auto count = static_cast<Eigen::Index>(ids.size());
  data.vertices = Eigen::Map<const IndexVector>(ids.data(), count);
  data.positions.resize(count, 3);
  data.areas.resize(count);
  data.basis.resize(3 * count, model.modal->basis.cols());
  for (Eigen::Index i = 0; i < count; ++i) {
    data.positions.row(i) = object.mesh.vertices.row(data.vertices[i]);
    data.areas[i] = areas[data.vertices[i]];
    data.basis.middleRows<3>(3 * i) = model.modal->basis.middleRows<3>(3 * data.vertices[i]);
  }
  return data;
}

}  // namespace exmat::test
