#include "tests/common/bundle/small_model.h"

#include <fstream>
#include <iterator>
#include <stdexcept>
#include <stdlib.h>

namespace exmat::test {
namespace {

constexpr Eigen::Index kVertices = 5, kTets = 2, kEigenfunctions = 2, kExamples = 3, kModes = 2, kElements = 2;

// Distinct numbers, none of them zero.
RowMatrix numbers(Eigen::Index rows, Eigen::Index cols, double first) {
  RowMatrix matrix(rows, cols);
  for (Eigen::Index i = 0; i < matrix.size(); ++i) matrix.data()[i] = first + 0.125 * static_cast<double>(i);
  return matrix;
}

ObjectData small_object(bool constrained) {
  ObjectData object;
  object.mesh.vertices.resize(kVertices, 3);
  object.mesh.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1;
  object.mesh.tets.resize(kTets, 4);
  object.mesh.tets << 0, 1, 2, 3, 1, 4, 2, 3;
  object.surface.resize(6, 3);
  object.surface << 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 4, 3, 1, 2, 4, 2, 3, 4;
  object.fixed = FlagVector::Zero(kVertices);
  object.part_names = FlagVector{{97, 0, 98, 99, 0}};
  object.part_sets.resize(3, 2);
  object.part_sets << 0, 1, 1, 1, 1, 0;
  object.vertex_parts = IndexVector::LinSpaced(kVertices, 0, kVertices - 1).unaryExpr([](int v) { return v % 3; });
  object.colours = VertexArray::Constant(kVertices, 3, 0.25);
  if (constrained) object.fixed[0] = 1;
  object.materials.density = numbers(kTets, 1, 1000);
  object.materials.youngs_modulus = numbers(kTets, 1, 1e5);
  object.materials.poisson_ratio = numbers(kTets, 1, 0.3);
  object.materials.model = MaterialModel::kCorotational;
  object.stiffness_ratio = 1.25;
  object.worst_stiffness = 1.5;
  object.thin_share = 0.125;
  return object;
}

ShapeSpaceData small_shape_space() {
  return {.eigenvalues = numbers(kEigenfunctions, 1, 10),
          .eigenfunctions = numbers(kVertices, kEigenfunctions, -1.5),
          .rest_descriptor = numbers(kEigenfunctions, 3, 0.25),
          .volume = 0.5,
          .centroid = {0.5, 0.25, 0.125},
          .weighting = Weighting::kEigenvalue,
          .splits_cluster = 1};
}

ExampleData small_example(const std::string& name, std::int64_t index) {
  ExampleData example;
  example.name = name;
  example.index = index;
  example.is_rest = index == 0;
  example.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  example.scale = 1.5;
  example.source = "fr\xc3\xb6hlich/";
  example.method = "spectral";
  example.alignment_residual = 0.01;
  example.inverted_fraction = 0.02;
  example.competing_maps = 3;
  example.surface_rms = 0.003;
  example.surface_farthest = 0.02;
  example.surface_iterations = 41;
  example.doubt = 0.25;
  example.shape_space_error = 0.125;
  example.basis_error = 0.0625;
  example.best_error = 0.07;
  example.settled_error = 0.08;
  example.settled_distance = 0.0125;
  example.settled_vertex = 3;
  example.descriptor = numbers(kEigenfunctions, 3, static_cast<double>(index));
  example.reduced = numbers(kModes, 1, static_cast<double>(index));
  example.pose = 2 * example.reduced;
  return example;
}

// The names' order is not the indices'.
ExampleSet small_examples() {
  ExampleSet set;
  set.examples = {small_example("z rest", 0), small_example("bend", 1), small_example("twist \xc3\xa9", 2)};
  const RowMatrix factor = numbers(kExamples, kExamples, 0.5);
  set.gram = factor * factor.transpose();
  set.h0 = numbers(kExamples, 1, 2);
  set.hq = numbers(kExamples, kModes, -3);
  return set;
}

ModalData small_modal(bool constrained) {
  ModalData modal{numbers(3 * kVertices, kModes, 0.1), numbers(3, 1, 20), numbers(3, kModes, -1)};
  if (constrained) modal.basis.topRows(3).setZero();
  return modal;
}

CubatureData small_cubature() {
  CubatureData cubature;
  cubature.elements.resize(kElements);
  cubature.elements << 0, 1;
  cubature.weights = numbers(kElements, 1, 1);
  cubature.volumes = numbers(kElements, 1, 0.25);
  cubature.gradient = numbers(9 * kElements, kModes, -2);
  cubature.youngs_modulus = numbers(kElements, 1, 1e5);
  cubature.poisson_ratio = numbers(kElements, 1, 0.3);
  const RowMatrix factor = numbers(kModes, kModes, 1);
  cubature.variance = factor * factor.transpose();
  cubature.heldout_poses = numbers(4, kModes, -0.75);
  cubature.internal_force = ForceMethod::kPolynomial;
  cubature.internal_force_reason = "faster";
  cubature.method = CubatureMethod::kGreedy;
  cubature.training_error = 0.01;
  cubature.heldout_error = 0.02;
  cubature.heldout_energy_error = 0.03;
  cubature.heldout_stiffness_error = 0.04;
  return cubature;
}

PolynomialData small_polynomial() {
  const RowMatrix factor = numbers(kModes, kModes, 2);
  return {factor * factor.transpose(), numbers(3, kModes, -4), numbers(6, 1, 9)};
}

TargetTableData small_targets() {
  TargetTableData targets;
  targets.degree = 2;
  targets.error = 1e-5;
  targets.energy_reference = EnergyReference::kRest;
  targets.exponents.resize(6, kExamples);
  targets.exponents << 2, 0, 0, 1, 1, 0, 1, 0, 1, 0, 2, 0, 0, 1, 1, 0, 0, 2;
  targets.control_points = numbers(6, kModes, 3);
  targets.compensated_stiffness = 400;
  targets.compensated_gravity = {0.5, -9.5, 0.25};
  return targets;
}

TargetSpaceData small_target_space(Eigen::Index examples) {
  TargetSpaceData space;
  space.energy_reference = EnergyReference::kRest;
  space.error = 1e-6;
  space.element_error = 1e-3;
  space.poses = numbers(examples, 1, 2);
  space.pull = numbers(kModes, 1, 4);
  space.elements = IndexVector{{0, 1}};
  space.weights = Eigen::Vector2d(0.5, 1.5);
  space.volumes = Eigen::Vector2d(0.25, 0.75);
  space.gradient = numbers(18, 1, 3);
  space.youngs_modulus = Eigen::Vector2d(1e5, 2e5);
  space.poisson_ratio = Eigen::Vector2d(0.3, 0.4);
  return space;
}

TargetElasticityData small_target_elasticity(Eigen::Index control_points) {
  TargetElasticityData elasticity;
  elasticity.heldout_error = 0.02;
  elasticity.elements = IndexVector{{0, 1}};
  elasticity.weights = Eigen::Vector2d(0.75, 1.25);
  elasticity.volumes = Eigen::Vector2d(0.25, 0.75);
  elasticity.gradient = numbers(18, kModes, 5);
  elasticity.target_gradient = numbers(18, 1, 6);
  elasticity.youngs_modulus = Eigen::Vector2d(1e5, 2e5);
  elasticity.poisson_ratio = Eigen::Vector2d(0.3, 0.4);
  elasticity.control_points = numbers(control_points, 1, 7);
  return elasticity;
}

FidelityData small_fidelity() {
  FidelityData fidelity;
  fidelity.loads = kLoadsOfScene;
  fidelity.reference = "full_space";
  fidelity.basis = "trained";
  fidelity.advice = "none";
  fidelity.training_runs = 8;
  fidelity.heldout_runs = 2;
  fidelity.position_error = fidelity.shape_error = 0.01;
  fidelity.captured_energy = 0.99;
  fidelity.worst_vertex = 3;
  return fidelity;
}

RigidData small_rigid() {
  const RowMatrix3 factor = numbers(3, 3, 0.5);
  return {.mass = 125,
          .centre_of_mass = {0.25, 0.5, 0.75},
          .inertia = factor * factor.transpose(),
          .second_moments = 2 * factor * factor.transpose(),
          .linear_moments = numbers(9, kModes, 4),
          .basis_moments = numbers(9 * kModes, kModes, 5),
          .spin_load = numbers(3, kModes, 6)};
}

// Vertices 1 and 3.
ContactData small_contact(const ReducedModel& model) {
  ContactData contact;
  contact.vertices.resize(2);
  contact.vertices << 1, 3;
  contact.positions = model.object->mesh.vertices(contact.vertices, Eigen::all);
  contact.areas = numbers(2, 1, 0.5);
  contact.basis.resize(6, kModes);
  contact.basis << model.modal->basis.middleRows(3, 3), model.modal->basis.middleRows(9, 3);
  return contact;
}

// The middle of a tet, and a vertex outside.
RenderData small_render() {
  RenderData render;
  render.vertices.resize(3, 3);
  render.vertices << 0.25, 0.25, 0.25, 1, 1, 1, -1, 0, 0;
  render.tets = IndexVector{{0, 1, 0}};
  render.barycentric.resize(3, 4);
  render.barycentric << 0.25, 0.25, 0.25, 0.25, 0, 1, 0, 0, 2, -1, 0, 0;
  render.triangles.resize(1, 3);
  render.triangles << 0, 2, 1;
  render.outside = 1;
  render.farthest = 1;
  render.look = FlagVector{{103, 108, 84, 70}};
  render.look_vertices = IndexVector{{1, 0}};
  render.look_frames = RowMatrix::Identity(6, 3);
  render.bones = IndexMatrix::Zero(3, 2);
  render.bones(1, 1) = 1;
  render.bone_weights = RowMatrix::Zero(3, 2);
  render.bone_weights.col(0) << 1, 0.25, 1;
  render.bone_weights(1, 1) = 0.75;
  return render;
}

// The second with an example less and no targets, and nothing for steps in all vertices.
std::vector<RegionData> small_regions(const ReducedModel& model) {
  std::vector<RegionData> regions(2);
  regions[0] = {.name = "left",
                .index = 0,
                .vertices = IndexVector{{0, 2}},
                .examples = *model.examples,
                .window = Eigen::Vector2d(0.25, 1),
                .band = Eigen::Vector2d(1, 0),
                .projection = *model.projection,
                .targets = model.targets,
                .target_space = model.target_space,
                .target_elasticity = model.target_elasticity,
                .full_space = model.full_space};
  regions[1] = {.name = "far right",
                .index = 1,
                .vertices = IndexVector{{1}},
                .examples = *model.examples,
                .window = Eigen::VectorXd::Ones(1),
                .band = Eigen::VectorXd::Zero(1),
                .projection = *model.projection,
                .targets = std::nullopt,
                .target_space = small_target_space(2),
                .target_elasticity = small_target_elasticity(2),
                .full_space = std::nullopt};
  ExampleSet& fewer = regions[1].examples;
  fewer.examples.pop_back();
  fewer.gram = RowMatrix(fewer.gram.topLeftCorner(2, 2));
  fewer.h0 = Eigen::VectorXd(fewer.h0.head(2));
  fewer.hq = RowMatrix(fewer.hq.topRows(2));
  return regions;
}

SkeletonData small_skeleton() {
  SkeletonData skeleton;
  skeleton.bones = {"hip", "head"};
  skeleton.animations = {"nod", "still"};
  skeleton.parents = IndexVector{{-1, 0}};
  skeleton.bind.resize(6, 4);
  skeleton.bind << 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 2, 0, 1, -2, 0, 0, 0, 0, 0, 2, 0;
  skeleton.weights.resize(5, 2);
  skeleton.weights << 1, 0, 1, 0, 0.5, 0.5, 0.25, 0.75, 0, 1;
  skeleton.first_frames = IndexVector{{0, 2, 3}};
  skeleton.times = Eigen::VectorXd{{0, 0.5, 0}};
  skeleton.poses = RowMatrix::Zero(6, 7);
  skeleton.poses.col(0).setLinSpaced(0, 1);
  skeleton.poses.col(3).setOnes();
  skeleton.poses.row(3) << 0, 1, 0, 0.6, 0, 0, 0.8;
  return skeleton;
}

}  // namespace

ReducedModel small_model(bool constrained, bool with_examples) {
  ReducedModel model;
  model.asset_name = "small";
  model.generator = "exmat test";
  model.input_sha256 = std::string(64, 'a');
  model.object = small_object(constrained);
  model.modal = small_modal(constrained);
  model.cubature = small_cubature();
  model.polynomial = small_polynomial();
  if (with_examples) {
    model.shape_space = small_shape_space();
    model.examples = small_examples();
    model.projection = ProjectionData{numbers(3 * kEigenfunctions, kModes, 6), numbers(kModes, 3 * kEigenfunctions, 7),
                                      Eigen::VectorXd::Constant(kEigenfunctions, 3), numbers(kModes, 1, 8)};
    model.targets = small_targets();
    model.target_space = small_target_space(kExamples);
    model.target_elasticity = small_target_elasticity(6);
    model.full_space = FullSpaceData{numbers(5, kEigenfunctions, 9), numbers(kExamples, 3 * kEigenfunctions, 10),
                                     numbers(6, 3 * kEigenfunctions, 11), numbers(1, 3 * kEigenfunctions, 12)};
    model.regions = small_regions(model);
  }
  model.fidelity = small_fidelity();
  if (!constrained) model.rigid = small_rigid();
  model.contact = small_contact(model);
  model.render = small_render();
  model.skeleton = small_skeleton();
  if (with_examples) {
    model.full_space->shifts = numbers(kExamples, 3 * kEigenfunctions, 13);
    model.skeleton->shifts = numbers(kExamples * 5, 3, 14);
  }
  return model;
}

}  // namespace exmat::test
