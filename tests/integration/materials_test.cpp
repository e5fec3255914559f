#include <Eigen/LU>
#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/decompositions.h"
#include "common/core/error.h"
#include "common/mesh/geometry.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/stepper.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace {

using namespace nlohmann::literals;

class MaterialFiles : public testing::Test {
 protected:
  /// The clamped bar in little, 4 m long, stiff and light beyond x = 2.
  ReducedModel built(const Json& object) {
    Json of_tets = object;
    of_tets["formulation"] = "linear";
    return through_bundle(build(write_small_bar(folder_, {{"object", of_tets}})).model, folder_.path("bundle.h5"));
  }

  TemporaryFolder folder_;
};

bool is_far(const ObjectData& object, Eigen::Index tet) { return tet_positions(object.mesh, tet).col(0).mean() > 2; }

/// Frequencies [Hz] of the clamped mesh, densely, its tets stiff and light where they are far.
Eigen::VectorXd dense_frequencies(const ObjectData& object, Eigen::Index count) {
  const Eigen::Index n = object.mesh.vertex_count();
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(3 * n, 3 * n), mass = stiffness;
  for (Eigen::Index t = 0; t < object.mesh.tet_count(); ++t) {
    const double young = is_far(object, t) ? 4e6 : 1e6, density = is_far(object, t) ? 500 : 1000, poisson = 0.3;
    const double mu = young / 2 / (1 + poisson), lambda = young * poisson / (1 + poisson) / (1 - 2 * poisson);
    Eigen::Matrix4d affine;
    affine << Eigen::Vector4d::Ones(), tet_positions(object.mesh, t);
    const Eigen::Matrix<double, 3, 4> shape = affine.inverse().bottomRows<3>();
    const double volume = affine.determinant() / 6;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const auto row = 3 * object.mesh.tets(t, i), column = 3 * object.mesh.tets(t, j);
        const Eigen::Vector3d a = shape.col(i), b = shape.col(j);
        stiffness.block<3, 3>(row, column) += volume * (lambda * a * b.transpose() + mu * b * a.transpose() +
                                                        mu * a.dot(b) * Eigen::Matrix3d::Identity());
        mass.block<3, 3>(row, column) += density * volume / 20 * (i == j ? 2 : 1) * Eigen::Matrix3d::Identity();
      }
  }
  std::vector<int> free;
  for (int dof = 0; dof < static_cast<int>(3 * n); ++dof)
    if (object.fixed[dof / 3] == 0) free.push_back(dof);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(stiffness(free, free), mass(free, free));
  return solver.eigenvalues().head(count).cwiseSqrt() / (2 * std::numbers::pi);
}

void expect_two_materials(const ReducedModel& model) {
  const ObjectData& object = *model.object;
  for (Eigen::Index t = 0; t < object.mesh.tet_count(); ++t) {
    ASSERT_EQ(object.materials.youngs_modulus[t], is_far(object, t) ? 4e6 : 1e6) << t;
    ASSERT_EQ(object.materials.density[t], is_far(object, t) ? 500 : 1000) << t;
    ASSERT_EQ(object.materials.poisson_ratio[t], 0.3);
  }
  const CubatureData& cubature = *model.cubature;
  for (Eigen::Index j = 0; j < cubature.elements.size(); ++j)
    EXPECT_EQ(cubature.youngs_modulus[j], object.materials.youngs_modulus[cubature.elements[j]]);
  const Eigen::VectorXd& frequencies = model.modal->frequencies;
  const Eigen::VectorXd expected = dense_frequencies(object, frequencies.size());
  EXPECT_LE((frequencies - expected).cwiseQuotient(expected).cwiseAbs().maxCoeff(), 1e-8);
}

TEST_F(MaterialFiles, PartsOfTheAssetReachTheBundle) {
  expect_two_materials(built(R"({
    "material": { "model": "stable_neo_hookean", "youngs_modulus": 1e6, "poisson_ratio": 0.3, "density": 1000 },
    "materials": [ { "tets": { "box": { "min": [2, -9, -9], "max": [9, 9, 9] } },
                     "youngs_modulus": 4e6, "density": 500 } ] })"_json));
}

/// The object's mesh with its two parts as sets and regions.
std::string to_veg(const ObjectData& object) {
  std::string text = fmt::format("*VERTICES\n{} 3 0 0\n", object.mesh.vertex_count());
  for (Eigen::Index v = 0; v < object.mesh.vertex_count(); ++v)
    text += fmt::format("{} {} {} {}\n", v + 1, object.mesh.vertices(v, 0), object.mesh.vertices(v, 1),
                        object.mesh.vertices(v, 2));
  text += fmt::format("*ELEMENTS\nTET\n{} 4 0\n", object.mesh.tet_count());
  std::string far;
  for (Eigen::Index t = 0; t < object.mesh.tet_count(); ++t) {
    const auto tet = object.mesh.tets.row(t);
    text += fmt::format("{} {} {} {} {}\n", t + 1, tet[0] + 1, tet[1] + 1, tet[2] + 1, tet[3] + 1);
    if (is_far(object, t)) far += fmt::format("{}\n", t + 1);
  }
  return text + "*MATERIAL SOFT\nENU, 1000, 1e6, 0.3\n*MATERIAL STIFF\nENU, 500, 4e6, 0.3\n*SET far\n" + far +
         "*REGION\nallElements, SOFT\n*REGION\nfar, STIFF\n";
}

TEST_F(MaterialFiles, RegionsOfTheMeshFileReachTheBundle) {
  const ReducedModel uniform = built(Json::object());
  folder_.write("two.veg", to_veg(*uniform.object));
  expect_two_materials(built(R"({ "mesh": "two.veg", "material": { "model": "corotational", "youngs_modulus": null,
                                  "poisson_ratio": null, "density": null } })"_json));
}

class MaterialPipeline : public MaterialFiles, public testing::WithParamInterface<const char*> {};
INSTANTIATE_TEST_SUITE_P(Each, MaterialPipeline, testing::Values("stvk", "stable_neo_hookean", "corotational"),
                         [](const auto& test) { return std::string(test.param); });

// Files to files: the body goes to its example, which the table of targets knows.
TEST_P(MaterialPipeline, BodySettlesAtItsExample) {
  const ReducedModel model = built({{"material", {{"model", GetParam()}}}});
  EXPECT_EQ(name_of(model.object->materials.model), GetParam());
  if (model.object->materials.model != MaterialModel::kStVenantKirchhoff) {
    EXPECT_EQ(model.cubature->internal_force, ForceMethod::kCubature);
    EXPECT_EQ(model.cubature->internal_force_reason, "the material has no polynomial");
  }
  ASSERT_TRUE(model.targets);
  for (const char* target : {"table", "solve"}) {
    Json members = R"({ "time_step": 0.01, "steps": 400, "damping": { "mass": 2 }, "gravity": [0, 0, -1],
                        "examples": { "stiffness": 1e5, "damping": 100, "bias": 0 } })"_json;
    members["examples"]["target"] = target;
    const SceneConfig config = load_scene(write_scene(folder_, members));
    const runtime::LoadedScene loaded = runtime::load_run(config);
    runtime::Workspace workspace(*loaded.model, loaded.scene);
    runtime::State state = make_state(*loaded.model);
    for (int i = 0; i < config.steps; ++i)
      ASSERT_EQ(runtime::step(*loaded.model, loaded.scene, state, workspace).status & runtime::kStepNonFinite, 0U);
    const Eigen::VectorXd& example = model.examples->examples[1].pose;
    const auto seen = [&](const Eigen::VectorXd& q) {
      return (model.projection->reduced_from_shape * (model.projection->shape_from_reduced * q)).norm();
    };
    EXPECT_LE(seen(state.q - example), 0.05 * seen(example)) << target;
  }
}

// In all vertices and in the modes the body comes to rest at the same pose, as far as these few modes hold it: no
// farther apart than where density is uniform.
TEST_F(MaterialFiles, SeveralDensitiesHaveExamplesInAllVertices) {
  const auto apart = [&](const Json& object, bool is_uniform) {
    const ReducedModel model = built(object);
    const Eigen::Index seen = is_uniform ? 0 : model.projection->shape_from_reduced.rows() / 3;
    EXPECT_EQ(model.projection->filter_scale.size(), seen);
    if (is_uniform) folder_.write("two.veg", to_veg(*model.object));
    const SceneConfig config = load_scene(write_scene(folder_, R"({
      "time_step": 0.01, "steps": 400, "damping": { "mass": 2 }, "space": "full",
      "examples": { "stiffness": 1e5, "damping": 100, "bias": 0 } })"_json));
    const runtime::LoadedScene loaded = runtime::load_run(config);
    runtime::Workspace workspace(*loaded.model, loaded.scene);
    runtime::FullWorkspace own(*loaded.full, loaded.scene);
    runtime::State reduced = make_state(*loaded.model), full = reduced;
    runtime::enter_full_space(*loaded.full, *loaded.model, full);
    std::uint32_t status = 0;
    for (int i = 0; i < config.steps; ++i) {
      status |= runtime::step(*loaded.model, loaded.scene, reduced, workspace).status;
      status |= runtime::step_in_full_space(*loaded.full, *loaded.model, loaded.scene, full, workspace, own).status;
    }
    EXPECT_EQ(status, 0U);
    const Eigen::MatrixXd& filter = loaded.model->examples.front().filter;
    return (filter * (full.q - reduced.q)).norm() / (filter * full.q).norm();
  };
  const double of_one = apart(R"({ "material": { "model": "corotational" } })"_json, true);
  EXPECT_LE(apart(R"({ "mesh": "two.veg", "material": { "model": "corotational", "youngs_modulus": null,
                       "poisson_ratio": null, "density": null } })"_json,
                  false),
            of_one);
}

TEST_F(MaterialFiles, APolynomialOfAnotherMaterialIsRefused) {
  const auto asset = write_small_bar(folder_, R"({ "internal_force": "polynomial",
                                                   "object": { "material": { "model": "corotational" } } })"_json);
  try {
    build(asset);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("\"polynomial\" for corotational"));
  }
}

TEST_F(MaterialFiles, APoissonRatioBeyondTheModelIsRefusedByTheProgram) {
  const auto asset = write_small_bar(
      folder_, R"({ "object": { "material": { "model": "stable_neo_hookean", "poisson_ratio": -0.9 } } })"_json);
  const Outcome outcome = exmat_precompute({"check", asset.string()});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.errors,
              testing::HasSubstr("Poisson ratios above -0.8 and at most 0.49999 for stable_neo_hookean"));
}

}  // namespace
}  // namespace exmat::test
