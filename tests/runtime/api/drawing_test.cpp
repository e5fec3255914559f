#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/mesh/assembly.h"
#include "common/mesh/geometry.h"
#include "exmat/exmat.hpp"
#include "runtime/api/drawn_surface.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

/// Drawing by exmat.hpp, beside the bar that the bundle was made of.
class Drawing : public ::testing::Test {
 protected:
  Drawing() {
    bar_.model.contact = test::surface_contact(bar_.model);
    write_bundle(bar_.model, folder_ / "bar.h5");
  }
  exmat::Model make(const std::string& members = "") const {
    return exmat::Model::from_text(
        R"({"bundle": "bar.h5", "examples": {"stiffness": 40, "damping": 1})" + members + "}",
        (folder_ / "scene.json").string());
  }
  Eigen::VectorXd some_pose() const {
    Eigen::VectorXd q(bar_.modes());
    for (Eigen::Index i = 0; i < q.size(); ++i) q[i] = 0.3 * std::sin(1.0 + static_cast<double>(i));
    return q;
  }
  static void put(exmat::Body& body, const Eigen::VectorXd& q) {
    const std::vector<double> numbers(q.begin(), q.end()), still(numbers.size());
    body.set_reduced(numbers, still);
  }

  test::Bar bar_ = test::make_bar({.examples = 3});
  test::TemporaryFolder folder_;
};

TEST_F(Drawing, PointsOfTheSurfaceAreItsVertices) {
  const exmat::Model model = make();
  const exmat::Surface surface(model);
  EXPECT_EQ(surface.kind(), EXMAT_SURFACE_OBJECT);
  const std::vector<std::int64_t> vertices = surface.vertices();
  const std::vector<std::int32_t> triangles = surface.triangles();
  const TriangleArray& expected = bar_.model.object->surface;
  ASSERT_EQ(std::ssize(triangles), expected.size());
  for (Eigen::Index i = 0; i < expected.size(); ++i)
    EXPECT_EQ(vertices[static_cast<std::size_t>(triangles[static_cast<std::size_t>(i)])], expected.data()[i]);
  const std::vector<double> rest = surface.rest();
  const std::vector<float> basis = surface.basis(model.modes());
  for (std::size_t i = 0; i < vertices.size(); ++i)
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const auto row = static_cast<Eigen::Index>(3 * i) + axis;
      EXPECT_EQ(rest[static_cast<std::size_t>(row)], bar_.model.object->mesh.vertices(vertices[i], axis));
      for (Eigen::Index mode = 0; mode < bar_.modes(); ++mode)
        EXPECT_EQ(basis[static_cast<std::size_t>(row * bar_.modes() + mode)],
                  static_cast<float>(bar_.basis()(3 * vertices[i] + axis, mode)));
    }
  EXPECT_THROW(exmat::Surface(model, EXMAT_SURFACE_RENDER), exmat::Error);
}

TEST_F(Drawing, PlacementRestAndBasisMakeThePositions) {
  test::Bar free = test::make_bar({.free = true});
  write_bundle(free.model, folder_ / "free.h5");
  const exmat::Model model((folder_ / "free.h5").string());
  exmat::Body body(model);
  exmat_motion motion = body.motion();
  motion.linear_velocity[1] = 3;
  motion.angular_velocity[2] = 2;
  body.set_motion(motion);
  body.step(100);
  const exmat::Surface surface(model);
  std::vector<float> positions(3 * surface.points());
  body.read_positions(surface, positions);
  std::array<double, 12> numbers{};
  body.read_placement(numbers);
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> placement(numbers.data());
  EXPECT_LE((placement.leftCols<3>() * placement.leftCols<3>().transpose()).eval().trace() - 3, 1e-12);
  const std::vector<double> rest = surface.rest();
  const std::vector<float> basis = surface.basis(model.modes());
  const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> rows(
      basis.data(), std::ssize(rest), static_cast<Eigen::Index>(model.modes()));
  const auto q = body.displacement(model.modes());
  const Eigen::VectorXd moved = rows.cast<double>() * Eigen::Map<const Eigen::VectorXd>(q.data(), std::ssize(q));
  for (Eigen::Index i = 0; i < moved.size(); i += 3) {
    const Eigen::Vector3d local = Eigen::Map<const Eigen::Vector3d>(rest.data() + i) + moved.segment<3>(i);
    const Eigen::Vector3d found = Eigen::Map<const Eigen::Vector3f>(positions.data() + i).cast<double>();
    EXPECT_LE((placement * local.homogeneous() - found).norm(), 1e-6);
  }
}

TEST_F(Drawing, PointsOfTrianglesMoveWithTheirCorners) {
  const exmat::Model model = make();
  const exmat::Surface surface(model);
  exmat::Body body(model);
  put(body, some_pose());
  std::vector<float> all(3 * surface.points());
  body.read_positions(surface, all);
  const std::vector<std::int32_t> corners = surface.triangles();
  const std::array<std::int64_t, 2> triangles{5, 9};
  const std::array<double, 6> shares{0.2, 0.3, 0.5, 1, 0, 0};
  const exmat::Points points = exmat::Points::on_surface(surface, triangles, shares);
  std::array<float, 6> found{};
  body.read_positions(points, found);
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double expected = 0;
      for (std::size_t c = 0; c < 3; ++c)
        expected += shares[3 * i + c] *
                    all[3 * static_cast<std::size_t>(corners[3 * static_cast<std::size_t>(triangles[i]) + c]) + axis];
      EXPECT_NEAR(found[3 * i + axis], expected, 1e-6);
    }
  body.apply_forces(points, std::array{1.0, 0.0, 0.0, 0.0, 0.0, 0.0});
  const std::array<double, 6> wrong{0.2, 0.3, 0.6, 1, 0, 0};
  EXPECT_THROW(exmat::Points::on_surface(surface, triangles, wrong), exmat::Error);
  const std::array<std::int64_t, 2> outside{5, 1000000};
  EXPECT_THROW(exmat::Points::on_surface(surface, outside, shares), exmat::Error);
}

// By the definition, from all tets of a vertex.
TEST_F(Drawing, EnergyDensityIsThatOfTheTets) {
  const exmat::Model model = make();
  exmat::Surface surface(model);
  exmat::Body body(model);
  const Eigen::VectorXd q = some_pose();
  put(body, q);
  std::vector<float> density(surface.points());
  body.read_energy_density(surface, density);
  const ObjectData& object = *bar_.model.object;
  const Eigen::VectorXd moved = bar_.basis() * q, volumes = tet_volumes(object.mesh);
  Eigen::VectorXd energy = Eigen::VectorXd::Zero(object.mesh.vertex_count()), volume = energy;
  for (Eigen::Index t = 0; t < object.mesh.tet_count(); ++t) {
    Eigen::Matrix3d rest, now;
    for (int c = 0; c < 3; ++c) {
      const auto from = object.mesh.tets(t, 0), to = object.mesh.tets(t, c + 1);
      rest.col(c) = (object.mesh.vertices.row(to) - object.mesh.vertices.row(from)).transpose();
      now.col(c) = rest.col(c) + moved.segment<3>(3 * to) - moved.segment<3>(3 * from);
    }
    const double psi = test::energy_density(object.materials.model, now * rest.inverse(),
                                            object.materials.youngs_modulus[t], object.materials.poisson_ratio[t]);
    for (const std::int32_t vertex : object.mesh.tets.row(t)) {
      energy[vertex] += volumes[t] * psi;
      volume[vertex] += volumes[t];
    }
  }
  const std::vector<std::int64_t> vertices = surface.vertices();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const double expected = energy[vertices[i]] / volume[vertices[i]];
    EXPECT_NEAR(density[i], expected, 1e-4 * (1 + expected));
  }
}

TEST_F(Drawing, RenderMeshesAreTheirTetsPoints) {
  const TetMesh& mesh = bar_.model.object->mesh;
  RenderData& render = bar_.model.render.emplace();
  render.tets.resize(3);
  render.tets << 0, 7, 20;
  render.barycentric = RowMatrix::Constant(3, 4, 0.25);
  render.vertices.resize(3, 3);
  for (Eigen::Index i = 0; i < 3; ++i) render.vertices.row(i) = tet_positions(mesh, render.tets[i]).colwise().mean();
  render.triangles.resize(1, 3);
  render.triangles << 0, 1, 2;
  write_bundle(bar_.model, folder_ / "bar.h5");
  const exmat::Model model = make();
  exmat::Surface surface(model);
  EXPECT_EQ(surface.kind(), EXMAT_SURFACE_RENDER);
  EXPECT_EQ(surface.triangles(), (std::vector<std::int32_t>{0, 1, 2}));
  exmat::Body body(model);
  const Eigen::VectorXd q = some_pose(), moved = bar_.basis() * q;
  put(body, q);
  std::vector<float> positions(9), density(3);
  body.read_positions(surface, positions);
  body.read_energy_density(surface, density);
  for (Eigen::Index i = 0; i < 3; ++i) {
    Eigen::Vector3d expected = render.vertices.row(i);
    for (const std::int32_t corner : mesh.tets.row(render.tets[i])) expected += 0.25 * moved.segment<3>(3 * corner);
    EXPECT_LE((Eigen::Map<const Eigen::Vector3f>(positions.data() + 3 * i).cast<double>() - expected).norm(), 1e-6);
    EXPECT_GT(density[static_cast<std::size_t>(i)], 0);
  }
}

TEST_F(Drawing, ElementsStandAtTheirCentroids) {
  const exmat::Model model = make();
  const exmat::Points elements = exmat::Points::elements(model);
  const CubatureData& cubature = *bar_.model.cubature;
  ASSERT_EQ(std::ssize(model.element_weights()), cubature.elements.size());
  const std::vector<double> rest = elements.rest(), weights = model.element_weights();
  for (Eigen::Index j = 0; j < cubature.elements.size(); ++j) {
    const Eigen::Vector3d expected = tet_positions(bar_.model.object->mesh, cubature.elements[j]).colwise().mean();
    EXPECT_LE((Eigen::Map<const Eigen::Vector3d>(rest.data() + 3 * j) - expected).norm(), 1e-12);
    EXPECT_EQ(weights[static_cast<std::size_t>(j)], cubature.weights[j]);
  }
}

TEST_F(Drawing, ExamplesAndTheirTargets) {
  const exmat::Model model = make(R"(, "gravity": [0, 0, -2])");
  const ExampleSet& examples = *bar_.model.examples;
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(model.example_name(-1, k), examples.examples[k].name);
    const std::vector<double> pose = model.example_pose(-1, k);
    EXPECT_EQ(Eigen::Map<const Eigen::VectorXd>(pose.data(), std::ssize(pose)), examples.examples[k].pose);
  }
  EXPECT_EQ(model.example_name(-1, 3), "");
  EXPECT_EQ(model.example_name(0, 0), "");
  // At weights of one example alone the target is that example, as the filter T^+ T sees it.
  exmat::Body body(model);
  std::vector<double> target(model.modes());
  body.read_target(target);
  EXPECT_EQ(target, std::vector<double>(model.modes()));
  const std::array<double, 3> weights{0, 1, 0};
  body.set_example_weights(weights);
  body.step(60);
  body.read_target(target);
  const ProjectionData& projection = *bar_.model.projection;
  const Eigen::VectorXd expected =
      projection.reduced_from_shape * (projection.shape_from_reduced * examples.examples[1].pose);
  const Eigen::VectorXd found = Eigen::Map<const Eigen::VectorXd>(target.data(), std::ssize(target));
  EXPECT_LE((found - expected).norm(), 1e-6 * expected.norm());
}

/// q after so many steps.
std::vector<double> after(exmat::Body& body, std::int64_t steps, std::size_t modes) {
  body.step(steps);
  const auto q = body.displacement(modes);
  return {q.begin(), q.end()};
}

TEST_F(Drawing, SettingsOfABodyAreThoseOfAModel) {
  const exmat::Model plain = make(R"(, "gravity": [0, 0, -2])");
  const exmat::Model set =
      make(R"(, "gravity": [0, 0, -2], "integrator": "newmark", "damping": {"mass": 0.7, "stiffness": 0.01})");
  exmat::Body body(plain), other(set);
  body.set_damping(0.7, 0.01);
  body.set_integrator(EXMAT_NEWMARK);
  EXPECT_EQ(after(body, 50, plain.modes()), after(other, 50, set.modes()));
  EXPECT_THROW(body.set_damping(-1, 0), exmat::Error);
  EXPECT_THROW(body.set_integrator(3), exmat::Error);
}

TEST_F(Drawing, WeightsOfASceneAreThoseThatAreSet) {
  const std::string weights = R"("weights": [0.25, 0.75, 0])";
  const exmat::Model given =
      exmat::Model::from_text(R"({"bundle": "bar.h5", "examples": {"stiffness": 40, "damping": 1, )" + weights + "}}",
                              (folder_ / "scene.json").string());
  const exmat::Model plain = make();
  exmat::Body body(plain), other(given);
  body.set_example_weights(std::array{0.25, 0.75, 0.0});
  EXPECT_EQ(after(body, 50, plain.modes()), after(other, 50, given.modes()));
  try {
    exmat::Model::from_text(R"({"bundle": "bar.h5", "examples": {"stiffness": 4, "weights": [0.5, 0.5]}})",
                            (folder_ / "scene.json").string());
    FAIL();
  } catch (const exmat::Error& error) {
    EXPECT_EQ(error.status(), EXMAT_BAD_INPUT);
    EXPECT_THAT(error.what(), HasSubstr("/examples/weights: expected 3 numbers"));
  }
}

TEST_F(Drawing, PositionsInDoublePrecisionAreThoseOfTheBasis) {
  const exmat::Model model = make();
  exmat::Body body(model);
  const Eigen::VectorXd q = some_pose();
  put(body, q);
  const exmat::Points points = exmat::Points::vertices(model, std::array<std::int64_t, 2>{7, 3});
  std::array<double, 6> found{};
  body.read_positions(points, found);
  for (const auto& [row, vertex] : {std::pair(0, 7), std::pair(3, 3)}) {
    const Eigen::Vector3d expected =
        bar_.model.object->mesh.vertices.row(vertex).transpose() + bar_.basis().middleRows<3>(3 * vertex) * q;
    EXPECT_LE((Eigen::Map<const Eigen::Vector3d>(found.data() + row) - expected).norm(), 1e-14);
  }
  std::array<double, 5> wrong{};
  EXPECT_THROW(body.read_positions(points, wrong), exmat::Error);
  std::vector<double> all(3 * model.vertices());
  EXPECT_THROW(body.read_positions(exmat::Points::all_vertices(model), all), exmat::Error);
}

// A central difference of step h errs by h^2, and by rounding over h.
TEST_F(Drawing, ForceAndTangentAreDerivativesOfTheEnergy) {
  constexpr double kStep = 1e-5;
  const exmat::Model model = make();
  const Eigen::VectorXd q = some_pose();
  const exmat::Elasticity at = model.elasticity(std::vector<double>(q.begin(), q.end()));
  const auto r = static_cast<std::size_t>(q.size());
  const double most_force = std::ranges::max(at.force, {}, [](double x) { return std::abs(x); });
  const double most_tangent = std::ranges::max(at.tangent, {}, [](double x) { return std::abs(x); });
  for (std::size_t i = 0; i < r; ++i) {
    std::vector<double> up(q.begin(), q.end()), down = up;
    up[i] += kStep;
    down[i] -= kStep;
    const exmat::Elasticity above = model.elasticity(up), below = model.elasticity(down);
    EXPECT_NEAR((above.energy - below.energy) / (2 * kStep), at.force[i], 1e-6 * std::abs(most_force));
    for (std::size_t j = 0; j < r; ++j) {
      EXPECT_NEAR((above.force[j] - below.force[j]) / (2 * kStep), at.tangent[r * j + i],
                  1e-6 * std::abs(most_tangent));
      EXPECT_EQ(at.tangent[r * j + i], at.tangent[r * i + j]);
    }
  }
  double energy = 0;
  EXPECT_EQ(exmat_model_read_elasticity(model.get(), q.data(), q.size(), &energy, nullptr, nullptr), EXMAT_OK);
  EXPECT_EQ(energy, at.energy);
  EXPECT_THROW(model.elasticity(std::vector<double>(r + 1)), exmat::Error);
  EXPECT_THROW(model.elasticity(std::vector<double>(r, NAN)), exmat::Error);
}

TEST_F(Drawing, ARayMeetsTheNearestOfAllTriangles) {
  const exmat::Model model = make();
  exmat::Body body(model);
  put(body, some_pose());
  const exmat::Surface surface(model);
  const std::vector<std::int32_t> triangles = surface.triangles();
  std::vector<double> xyz(3 * surface.points());
  body.read_positions(surface, xyz);
  const auto point = [&](std::size_t k) -> Eigen::Vector3d { return Eigen::Map<Eigen::Vector3d>(&xyz[3 * k]); };
  const auto corner = [&](std::size_t f, std::size_t c) {
    return point(static_cast<std::size_t>(triangles[3 * f + c]));
  };
  const Eigen::Vector3d middle = Eigen::Map<Eigen::Matrix3Xd>(xyz.data(), 3, surface.points()).rowwise().mean();
  int hits = 0;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d origin = middle + 9 * Eigen::Vector3d(std::sin(i), std::cos(3 * i), std::sin(7 * i + 1.0));
    const Eigen::Vector3d direction =
        middle + 0.4 * Eigen::Vector3d(std::cos(5 * i), std::sin(2 * i), std::sin(i)) - origin;
    double nearest = INFINITY;
    for (std::size_t f = 0; f < triangles.size() / 3; ++f) {
      Eigen::Matrix3d sides;
      sides << corner(f, 1) - corner(f, 0), corner(f, 2) - corner(f, 0), -direction.normalized();
      const Eigen::Vector3d at = sides.fullPivLu().solve(origin - corner(f, 0));
      if (at[0] >= 0 && at[1] >= 0 && at[0] + at[1] <= 1 && at[2] >= 0) nearest = std::min(nearest, at[2]);
    }
    const std::array from{origin[0], origin[1], origin[2]}, along{direction[0], direction[1], direction[2]};
    const std::optional<exmat::RayHit> hit = body.cast_ray(surface, from, along);
    ASSERT_EQ(hit.has_value(), std::isfinite(nearest)) << i;
    if (!hit) continue;
    ++hits;
    EXPECT_NEAR(hit->distance, nearest, 1e-12 * nearest) << i;
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    for (std::size_t c = 0; c < 3; ++c) place += hit->shares[c] * corner(static_cast<std::size_t>(hit->triangle), c);
    EXPECT_LE((place - origin - nearest * direction.normalized()).norm(), 1e-12 * nearest) << i;
    EXPECT_FALSE(body.cast_ray(surface, from, along, 0.999 * nearest)) << i;
  }
  EXPECT_GT(hits, 50);
  EXPECT_LT(hits, 200);
  const std::array zero{0.0, 0.0, 0.0};
  EXPECT_THROW(body.cast_ray(surface, zero, zero), exmat::Error);
  EXPECT_THROW(body.cast_ray(exmat::Surface(make()), zero, std::array{0.0, 0.0, 1.0}), exmat::Error);
}

TEST_F(Drawing, MatricesAreThoseOfTheMesh) {
  const exmat::Model model = make();
  const ObjectData& object = *bar_.model.object;
  for (const auto& [kind, expected] :
       {std::pair(EXMAT_MASS, expand_to_vectors(scalar_mass(object.mesh, object.materials.density))),
        std::pair(EXMAT_STIFFNESS, elastic_stiffness(object.mesh, object.materials))}) {
    const exmat::CompressedRows rows = model.matrix(kind);
    EXPECT_THAT(rows.starts, ElementsAreArray(expected.outerIndexPtr(), static_cast<std::size_t>(expected.rows()) + 1));
    const auto entries = static_cast<std::size_t>(expected.nonZeros());
    EXPECT_THAT(rows.columns, ElementsAreArray(expected.innerIndexPtr(), entries));
    EXPECT_THAT(rows.values, ElementsAreArray(expected.valuePtr(), entries));
  }
  EXPECT_THROW(model.matrix(2), exmat::Error);
  EXPECT_EQ(exmat_matrix_entries(nullptr), -1);
}

TEST_F(Drawing, ProfilesAddUpToLessThanTheCallTook) {
  const exmat::Model model = make(R"(, "gravity": [0, 0, -2])");
  exmat::Body body(model);
  body.step(20);
  EXPECT_EQ(body.world().profile().solve, 0);
  body.world().set_profiled(true);
  const exmat_report report = body.step(20);
  const exmat_profile profile = body.world().profile();
  EXPECT_GT(profile.internal_force, 0);
  EXPECT_LE(profile.weights + profile.target + profile.internal_force + profile.solve + profile.contact,
            report.seconds);
}

TEST_F(Drawing, BundlesSayWhatTheyHold) {
  const exmat_bundle_info info = exmat::bundle_info((folder_ / "bar.h5").string());
  EXPECT_EQ(info.modes, bar_.modes());
  EXPECT_EQ(info.vertices, bar_.model.object->mesh.vertex_count());
  EXPECT_EQ(info.elements, bar_.model.cubature->elements.size());
  EXPECT_EQ(info.examples, 3);
  EXPECT_EQ(info.constrained, 1);
  EXPECT_EQ(info.contact, 1);
  EXPECT_EQ(info.render_vertices, 0);
  EXPECT_THROW(exmat::bundle_region_name((folder_ / "bar.h5").string(), 0), exmat::Error);
  EXPECT_THROW(exmat::bundle_info((folder_ / "none.h5").string()), exmat::Error);
}

TEST_F(Drawing, TouchWhatIsAddedWhereTheTextIsToldSo) {
  const std::string text = R"({"bundle": "bar.h5"})", path = (folder_ / "scene.json").string();
  exmat::Body with(exmat::Model::from_text(text, path, true)), without(exmat::Model::from_text(text, path));
  with.world().add_obstacle(exmat::default_obstacle());
  EXPECT_THROW(without.world().add_obstacle(exmat::default_obstacle()), exmat::Error);
}

}  // namespace
}  // namespace exmat::runtime
