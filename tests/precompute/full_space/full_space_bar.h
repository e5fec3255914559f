#pragma once

#include <gtest/gtest.h>

#include "precompute/shape_space/filter_functions.h"
#include "precompute/shape_space/projection.h"
#include "tests/support/sparse_space/sparse_model.h"
#include "tests/support/synthetic_model.h"

namespace exmat::precompute {

/// The number of modes of a bar of a few cells that leave nothing out.
inline int all_modes(const test::BarOptions& options) {
  const auto [nx, ny, nz] = options.cells;
  const int section = 3 * (ny + 1) * (nz + 1);
  return options.free ? (nx + 1) * section - 6 : nx * section;
}

/// Brings examples, whose descriptors stay, into the modal basis.
inline void reduce_examples(ReducedModel& model, const ElasticSystem& system, const ExamplePoses& poses,
                            ProjectionData& projection, ExampleSet& set) {
  const RowMatrix map = (system.mass * system.restrict(model.modal->basis)).transpose() * poses.fields;
  fill_weights_problem(model.shape_space->rest_descriptor, projection, map, set);
  projection.target_basis = range_basis(map);
}

/// Adds a region of the flagged vertices with milder forms of the examples of the whole body, which bend a part more
/// than they bend all.
inline void add_region(ReducedModel& model, const std::string& name, const FlagVector& inside) {
  const ObjectData& object = *model.object;
  const ElasticSystem system = build_elastic_system(object.mesh, object.materials, object.fixed);
  RegionData region;
  region.name = name;
  region.index = std::ssize(model.regions);
  std::vector<std::int32_t> vertices;
  for (Eigen::Index v = 0; v < inside.size(); ++v)
    if (inside[v] != 0) vertices.push_back(static_cast<std::int32_t>(v));
  region.vertices = Eigen::Map<const IndexVector>(vertices.data(), std::ssize(vertices));
  region.examples = *model.examples;
  const RowMatrix& rest = model.shape_space->rest_descriptor;
  for (ExampleData& example : region.examples.examples) example.descriptor = rest + 0.1 * (example.descriptor - rest);
  model.regions.push_back(std::move(region));
  RegionData& added = model.regions.back();
  const LaplaceBasis basis = laplace_basis_of(model);
  const RegionView view(object.mesh, inside, object.fixed);
  added.window = view.window()(added.vertices);
  added.band = view.band()(added.vertices);
  added.projection = direct_projection(basis, descriptor_weights(basis, model.shape_space->weighting), system.full_mass,
                                       RowMatrix(view.see(model.modal->basis)));
  added.projection.filter_scale = filter_scale(basis, descriptor_weights(basis, model.shape_space->weighting),
                                               object.mesh, object.materials.density);
  const ExamplePoses poses = region_example_poses(model, system, {name}).front();
  reduce_examples(model, system, poses, added.projection, added.examples);
}

/// Flags of the vertices beyond three tenths of a bar, which are seen from a band, or of those in its first eight, some
/// of which are fixed where it is clamped.
inline FlagVector part_of_bar(const ReducedModel& model, bool outer) {
  const Eigen::ArrayXd x = model.object->mesh.vertices.col(0) / model.object->mesh.vertices.col(0).maxCoeff();
  return outer ? FlagVector((x > 0.3).cast<std::uint8_t>()) : FlagVector((x < 0.8).cast<std::uint8_t>());
}

/// A bar with all modes in its basis and the example poses that descriptors stand for on all vertices.
inline test::Bar complete_bar(test::BarOptions options) {
  options.linear_modes = all_modes(options) - std::max(0, std::min(options.examples, 4) - 1);
  test::Bar bar = test::make_bar(options);
  if (options.examples == 0) return bar;
  ReducedModel& model = bar.model;
  const ElasticSystem system = build_elastic_system(model.object->mesh, model.object->materials, model.object->fixed);
  reduce_examples(model, system, whole_body_example_poses(model, system), *model.projection, *model.examples);
  return bar;
}

/// /full_space of a bar whose basis holds all of its motion, so that Y is the basis; of its examples or of a region's.
inline FullSpaceData full_space_data_of(const ReducedModel& model, const RegionData* region = nullptr) {
  const ObjectData& object = *model.object;
  const LaplaceBasis basis = laplace_basis_of(model);
  const FilterFunctions functions(basis, object.mesh, object.materials.density);
  FullSpaceData data;
  data.filter = functions.root_over_analysis * functions.analysis;
  for (Eigen::Index v = 0; v < object.fixed.size(); ++v)
    if (object.fixed[v] != 0) data.filter.row(v).setZero();
  data.slopes = weight_slopes(basis, model.shape_space->weighting, region ? region->examples : *model.examples) /
                functions.root_over_analysis;
  data.from_target.resize(model.modal->basis.cols(), 3 * data.filter.cols());
  std::optional<RegionView> view;
  if (region != nullptr) {
    FlagVector inside = FlagVector::Zero(object.mesh.vertex_count());
    inside(region->vertices).setOnes();
    view.emplace(object.mesh, inside, object.fixed);
  }
  for (Eigen::Index i = 0; i < data.from_target.rows(); ++i) {
    Eigen::VectorXd mode = model.modal->basis.col(i);
    if (view) mode = view->see(mode);
    const Eigen::MatrixXd coefficients =
        data.filter.transpose() * mode.reshaped<Eigen::RowMajor>(object.mesh.vertex_count(), 3);
    data.from_target.row(i) = coefficients.reshaped<Eigen::RowMajor>().transpose();
  }
  if (view) data.filter = (view->window().asDiagonal() * data.filter).eval();
  return data;
}

/// Examples may pull elastically, by all elements.
inline void make_elastic(ReducedModel& model) {
  const CubatureData& all = *model.cubature;
  model.target_elasticity = {.weights = all.weights,
                             .volumes = all.volumes,
                             .gradient = all.gradient,
                             .target_gradient = all.gradient,
                             .youngs_modulus = all.youngs_modulus,
                             .poisson_ratio = all.poisson_ratio};
  model.full_space->shapes = model.modal->basis;
}

inline FullSpaceOptions targets_of(const test::BarOptions& options) { return {.whole_body = options.examples > 0}; }

/// Steps, and expects each one to be sound.
inline void run(const SparseModel& model, const FullSpaceScene& scene, FullSpaceState& state, int steps) {
  SparseWorkspace workspace(model);
  for (int i = 0; i < steps; ++i) ASSERT_EQ(step(model, scene, state, workspace).status, 0U) << i;
}

inline FullSpaceState at_rest(const SparseModel& model) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(model.rest.size());
  return make_full_space_state(model, zero, zero);
}

}  // namespace exmat::precompute
