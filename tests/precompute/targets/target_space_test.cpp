#include "precompute/targets/target_space.h"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <omp.h>
#include <random>

#include "precompute/targets/element_forces.h"
#include "runtime/sim/examples/target_table.h"
#include "runtime/sim/step/model.h"
#include "tests/precompute/full_space/full_space_bar.h"
#include "tests/support/random.h"

// Against the minimum over all tets in all poses, solved by itself at weights that nothing here has seen.

namespace exmat::precompute {
namespace {

using runtime::TargetSolver;

struct Case {
  int examples = 2;
  EnergyReference reference = EnergyReference::kExample;
  MaterialModel material = MaterialModel::kStVenantKirchhoff;
  bool free = false;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << "K " << c.examples << " " << name_of(c.reference) << " " << name_of(c.material) << (c.free ? " free" : "");
}

// Poses so mild that p*(w) has one minimum: see target_table_test.cpp.
double strength(const Case& c) {
  if (c.reference == EnergyReference::kRest) return c.examples > 3 ? 0.15 : 0.3;
  return c.examples > 2 ? 0.5 : 1;
}

class Body {
 public:
  explicit Body(const Case& options)
      : reference_(options.reference),
        bar_(test::make_bar({.cells = {4, 1, 1},
                             .material = options.material,
                             .free = options.free,
                             .linear_modes = 12,
                             .eigenfunctions = 5,
                             .examples = options.examples})) {
    ReducedModel& model = bar_.model;
    const RowMatrix& rest = model.shape_space->rest_descriptor;
    for (ExampleData& example : model.examples->examples)
      example.descriptor = rest + strength(options) * (example.descriptor - rest);
    system_ = build_elastic_system(model.object->mesh, model.object->materials, model.object->fixed);
    poses_ = whole_body_example_poses(model, system_);
    range_ = pose_range(system_.mass, poses_.fields, descriptor_changes(rest, *model.examples));
    whole_ = mesh_target(*model.object, system_, range_, reference_);
  }

  TargetSpace build(double tolerance) const {
    return build_target_space(*bar_.model.object, system_, range_,
                              {.energy_reference = reference_, .tolerance = tolerance});
  }

  /// As of a mesh of many tets: the steps that a sample of these takes and the forces of all.
  TargetSpace build_by_sample(double tolerance, Eigen::Index sample) const {
    return build_target_space(
        *bar_.model.object, system_, range_,
        {.energy_reference = reference_, .tolerance = tolerance, .most_elements = 0, .sample = sample});
  }

  /// The displacement [f] of the target, and of the largest example.
  Eigen::VectorXd target(const Eigen::VectorXd& w) const {
    auto workspace = whole_.solver.make_workspace();
    Eigen::VectorXd y(whole_.solver.dimension());
    whole_.solver.start(w, y);
    EXPECT_LE(whole_.solver.solve(w, workspace, y).residual, 1e-8 * scale());
    return range_.basis * (whole_.solver.basis() * y);
  }
  double energy_norm(const Eigen::VectorXd& u) const { return std::sqrt(u.dot(system_.stiffness * u)); }
  double scale() const {
    double largest = 0;
    for (const auto& pose : range_.poses.colwise()) largest = std::max(largest, energy_norm(range_.basis * pose));
    return largest;
  }

  EnergyReference reference_;
  test::Bar bar_;
  ElasticSystem system_;
  ExamplePoses poses_;
  PoseCoordinates range_;
  MeshTarget whole_;
};

std::vector<Eigen::VectorXd> random_weights(int examples, int count) {
  std::mt19937 generator(11);
  std::exponential_distribution<double> share;
  std::vector<Eigen::VectorXd> all;
  for (int i = 0; i < count; ++i) {
    Eigen::VectorXd w(examples);
    for (double& entry : w) entry = share(generator);
    all.push_back(w / w.sum());
  }
  return all;
}

class TargetSpaceOf : public ::testing::TestWithParam<Case> {
 protected:
  static constexpr double kTolerance = 1e-4;  // the asset's default

  TargetSpaceOf() : body_(GetParam()) {}
  void expect_near(const TargetSpace& space) const;

  Body body_;
};

INSTANTIATE_TEST_SUITE_P(
    Cases, TargetSpaceOf,
    ::testing::Values(Case{2}, Case{2, EnergyReference::kRest}, Case{3}, Case{4, EnergyReference::kRest}, Case{6},
                      Case{2, EnergyReference::kExample, MaterialModel::kStableNeoHookean},
                      Case{2, EnergyReference::kExample, MaterialModel::kStVenantKirchhoff, true}));

// The table is as near as it says, for the targets of the whole mesh; the tolerance is the asset's default. The kinds
// of random weights are many more than the checks', so that a little more may turn up between these: a tenth, of more
// than four examples four tenths. Of these the tolerance is a hundred times that, and of two at once.
TEST_P(TargetSpaceOf, TableIsNearTheTargetsOfTheWholeMesh) { expect_near(body_.build(kTolerance)); }

// Half of the tets alone give targets that are off by a tenth.
TEST_P(TargetSpaceOf, TableOfASampleIsNearTheTargetsOfTheWholeMesh) {
  const Eigen::Index tets = body_.bar_.model.object->mesh.tet_count();
  const TargetSpace space = body_.build_by_sample(kTolerance, tets / 2);
  expect_near(space);
  EXPECT_EQ(space.left_out, body_.build(kTolerance).left_out);
}

// By the vertices against the kernels' sum over tets. A tet's numbers are summed in another order: rounding.
TEST_P(TargetSpaceOf, ForcesOfTetsAreTheDerivativeOfTheirEnergies) {
  const ElementForces forces(*body_.bar_.model.object, body_.system_, body_.range_, body_.reference_);
  const runtime::TargetSolver& solver = body_.whole_.solver;
  EXPECT_EQ(forces.members(), body_.whole_.elements);
  auto workspace = solver.make_workspace();
  for (const Eigen::VectorXd& w : random_weights(GetParam().examples, 5)) {
    Eigen::VectorXd y(solver.dimension()), expected(solver.dimension());
    solver.start(w, y);
    y += 0.1 * y.norm() * test::random_vector(y.size(), 3).normalized();
    solver.force(w, y, workspace, expected);
    const Eigen::VectorXd found = solver.basis().transpose() * forces.forces(w.transpose(), solver.basis() * y);
    EXPECT_LE((found - expected).norm(), 1e-10 * body_.scale());
  }
}

void TargetSpaceOf::expect_near(const TargetSpace& space) const {
  const bool many = GetParam().examples > 4;
  const double tolerance = (many ? 100 : 1) * kTolerance, between = many ? 1.4 : 1.1;
  ASSERT_TRUE(space.table) << space.table_message;
  const runtime::TargetTable table(*space.table);
  auto workspace = table.make_workspace();
  Eigen::VectorXd y(table.modes());
  for (const Eigen::VectorXd& w : random_weights(GetParam().examples, 40)) {
    table.evaluate(w, workspace, y);
    const double distance = body_.energy_norm(space.coordinates.basis * y - body_.target(w)) / body_.scale();
    EXPECT_LE(distance, between * space.table->error) << w.transpose();
    if (!many || (w.tail(w.size() - 1).array() > 0).count() <= 2) {
      EXPECT_LE(distance, 1.1 * tolerance) << w.transpose();
    }
  }
}

// The elements' targets, solved by the run time's own solver, likewise: by what the bundle says of them.
TEST_P(TargetSpaceOf, ElementsGiveTheTargetsOfTheWholeMesh) {
  const TargetSpace space = body_.build(1e-4);
  TargetSolver solver;
  const Eigen::Index d = space.coordinates.poses.rows();
  ASSERT_FALSE(solver.build(GetParam().material, space.elements, examples_at(space.coordinates.poses),
                            RowMatrix::Identity(d, d), GetParam().reference));
  EXPECT_LE(space.elements.elements.size(), body_.bar_.model.object->mesh.tet_count());
  auto workspace = solver.make_workspace();
  for (const Eigen::VectorXd& w : random_weights(GetParam().examples, 40)) {
    Eigen::VectorXd y(d);
    solver.start(w, y);
    solver.solve(w, workspace, y);
    const double distance =
        body_.energy_norm(space.coordinates.basis * (solver.basis() * y) - body_.target(w)) / body_.scale();
    // Twice what a few held-out weights showed.
    EXPECT_LE(distance, 2 * (space.elements.heldout_error + space.error) + 1e-4) << w.transpose();
    EXPECT_LE(distance, GetParam().examples > 4 ? 1e-2 : 5e-3) << w.transpose();
  }
}

TEST_P(TargetSpaceOf, TakesFewDisplacementsThatHoldTheExamples) {
  const TargetSpace space = body_.build(1e-4);
  EXPECT_LE(space.coordinates.basis.cols(), body_.range_.basis.cols());
  for (Eigen::Index k = 0; k < body_.range_.poses.cols(); ++k) {
    const Eigen::VectorXd whole = body_.range_.basis * body_.range_.poses.col(k);
    EXPECT_LE(body_.energy_norm(space.coordinates.basis * space.coordinates.poses.col(k) - whole),
              1e-8 * body_.scale());
  }
}

// A table in the run time holds U^T P Y: the filter of the full space, which knows no modal basis.
TEST_P(TargetSpaceOf, PullIsTheFilteredTarget) {
  Case options = GetParam();
  if (options.free) GTEST_SKIP() << "the synthetic bar's filter is not free of rigid motions";
  const TargetSpace space = body_.build(1e-4);
  const ReducedModel& model = body_.bar_.model;
  const LaplaceBasis object = laplace_basis_of(model);
  const Eigen::VectorXd weights = descriptor_weights(object, model.shape_space->weighting);
  const Eigen::MatrixXd pull = model.projection->reduced_from_shape *
                               shape_changes(object, weights, RowMatrix(body_.system_.extend(space.coordinates.basis)));
  const FullSpaceExamples full(model, body_.system_, body_.poses_, options.reference);
  const Eigen::MatrixXd basis = body_.system_.restrict(model.modal->basis);
  for (const Eigen::VectorXd& w : random_weights(options.examples, 5)) {
    const Eigen::VectorXd y = space.coordinates.poses * w;
    const Eigen::VectorXd expected = basis.transpose() * full.filter(space.coordinates.basis * y);
    EXPECT_LE((pull * y - expected).norm(), 1e-10 * expected.norm());
  }
}

TEST(TargetSpace, IsTheSameForEveryNumberOfThreads) {
  const Body body(Case{3});
  const int threads = omp_get_max_threads();
  omp_set_num_threads(1);
  const TargetSpace one = body.build(1e-4);
  omp_set_num_threads(3);
  const TargetSpace three = body.build(1e-4);
  omp_set_num_threads(threads);
  EXPECT_EQ(one.coordinates.basis, three.coordinates.basis);
  EXPECT_EQ(one.elements.elements, three.elements.elements);
  EXPECT_EQ(one.elements.weights, three.elements.weights);
  ASSERT_TRUE(one.table && three.table);
  EXPECT_EQ(one.table->control_points, three.table->control_points);
}

// A pose that turns some tets inside out: they take no part, nor can one of them be an element.
TEST(TargetSpace, LeavesOutTetsThatAPoseTurnsInsideOut) {
  Body body(Case{2});
  body.range_.poses.col(1) *= 1000;
  const MeshTarget target = mesh_target(*body.bar_.model.object, body.system_, body.range_, EnergyReference::kExample);
  ASSERT_GT(target.left_out, 0);
  EXPECT_EQ(target.left_out + std::ssize(target.elements), body.bar_.model.object->mesh.tet_count());
  const Eigen::VectorXd pose = body.system_.extend(body.range_.basis * body.range_.poses.col(1));
  const TetMesh& mesh = body.bar_.model.object->mesh;
  const auto volume = [&](Eigen::Index t) {
    Eigen::Matrix3d edges;
    const auto place = [&](int corner) -> Eigen::Vector3d {
      const auto v = mesh.tets(t, corner);
      return mesh.vertices.row(v).transpose() + pose.segment<3>(3 * v);
    };
    for (int i = 0; i < 3; ++i) edges.col(i) = place(i + 1) - place(0);
    return edges.determinant();
  };
  Eigen::Index inverted = 0;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) inverted += volume(t) <= 0;
  EXPECT_EQ(target.left_out, inverted);
  const TargetSpace space = body.build(1e-3);
  EXPECT_EQ(space.left_out, target.left_out);
  for (const std::int32_t element : space.elements.elements) EXPECT_GT(volume(element), 0) << element;
}

}  // namespace
}  // namespace exmat::precompute
