#include <cmath>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/hdf5/hdf5_file.h"
#include "tests/integration/support.h"
#include "tests/support/box_mesh.h"

// A bundle's report on how its body settles in its examples' poses, beside bodies that are stepped until they rest.

namespace exmat::test {
namespace settled_poses_test {

using namespace nlohmann::literals;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Strong damping: after 20 s the slowest mode has lost all of its motion.
const Json kScene =
    R"({ "time_step": 0.02, "steps": 1000, "gravity": [0, 0, -1], "damping": { "mass": 6 }, "newton": { "tolerance": 1e-10 },
  "examples": { "stiffness": 50, "damping": 10, "weights": [0, 1] }, "output": { "every": 1000 } })"_json;

class SettledPoses : public testing::Test {
 protected:
  // Poses of the object's own mesh, so that the pose as given is known here.
  SettledPoses() {
    asset_ = write_small_bar(folder_, {{"examples", {{{"name", "bend"}, {"mesh", "own.msh"}}}}});
    mesh_ = box_mesh({8, 2, 1}, bar_.lengths);
    TetMesh posed = mesh_;
    // Its tets keep their volumes: poses are taken in a unit of length in which the body's volume is 1.
    posed.vertices.col(2).array() += 0.05 * mesh_.vertices.col(0).array().square();
    write_msh(folder_.path("own.msh"), posed);
    given_ = (posed.vertices - mesh_.vertices).reshaped<Eigen::RowMajor>();
  }

  Outcome bundle(const Json& scene) {
    return exmat_precompute(
        {"bundle", asset_, "-o", folder_.path("bundle.h5"), "--scene", write_scene(folder_, scene)});
  }

  ExampleData bend() const { return read_bundle(folder_.path("bundle.h5")).examples->examples.back(); }

  double norm(const Eigen::VectorXd& field) const {
    return std::sqrt(mass_product(mesh_, Eigen::VectorXd::Constant(mesh_.tet_count(), 1000), field, field));
  }

  // Displacements [3n] at the end of a run.
  Eigen::VectorXd end_of_run(const Json& scene) {
    const Outcome run = exmat_runtime({"run", write_scene(folder_, scene), "-o", folder_.path("run.h5")});
    EXPECT_EQ(run.status, 0) << run.errors;
    const Hdf5File file = Hdf5File::open(folder_.path("run.h5"));
    const Hdf5Dataset dataset = file.open_dataset("/vertices");
    std::vector<float> found(dataset.element_count());
    dataset.read(found.data(), ElementType::kFloat32);
    const Eigen::Index size = given_.size();
    const Eigen::Map<const Eigen::VectorXf> last(found.data() + std::ssize(found) - size, size);
    return last.cast<double>() - mesh_.vertices.reshaped<Eigen::RowMajor>();
  }

  TemporaryFolder folder_;
  BarFiles bar_;
  std::filesystem::path asset_;
  TetMesh mesh_;
  Eigen::VectorXd given_;
};

// Positions are written with 7 digits, and what the run has left of its motion is less.
constexpr double kSettled = 1e-5;

TEST_F(SettledPoses, AreThoseThatBodiesComeToRestIn) {
  const Outcome made = bundle(kScene);
  ASSERT_EQ(made.status, 0) << made.errors;
  const ExampleData example = bend();
  const Eigen::VectorXd off = end_of_run(kScene) - given_;
  EXPECT_NEAR(example.settled_error, norm(off) / norm(given_), kSettled);
  const Eigen::VectorXd distances = off.reshaped<Eigen::RowMajor>(off.size() / 3, 3).rowwise().norm();
  EXPECT_NEAR(example.settled_distance, distances.maxCoeff(), kSettled * bar_.lengths[0]);
  EXPECT_NEAR(distances[example.settled_vertex], distances.maxCoeff(), kSettled * bar_.lengths[0]);
  EXPECT_GT(example.settled_error, 1.2 * example.best_error) << "the force is weak";
  EXPECT_THAT(made.errors, HasSubstr(fmt::format("example bend: settled {:.1f} % of its displacement from the pose",
                                                 100 * example.settled_error)));
  EXPECT_THAT(made.errors, HasSubstr("ten times examples.stiffness would leave"));
}

// Without gravity, by forces of the strengths that are tried and others: none is better by much.
TEST_F(SettledPoses, AreNoneBetterThanTheBest) {
  Json scene = kScene;
  scene.erase("gravity");
  double least = 1;
  for (const double stiffness : {10.0, 1e2, 1e3, 1e4, 1e5, 1e6}) {
    scene["examples"]["stiffness"] = stiffness;
    ASSERT_EQ(bundle(scene).status, 0);
    const ExampleData example = bend();
    EXPECT_NEAR(norm(end_of_run(scene) - given_) / norm(given_), example.settled_error, kSettled);
    least = std::min(least, example.settled_error);
  }
  EXPECT_NEAR(bend().best_error, least, 0.02);
}

TEST_F(SettledPoses, AreTheBestWhereTargetsAreCompensated) {
  ASSERT_EQ(bundle(kScene).status, 0);
  const double before = bend().settled_error;
  Json scene = kScene;
  scene["examples"]["compensate"] = true;
  const Outcome made = bundle(scene);
  ASSERT_EQ(made.status, 0) << made.errors;
  const ExampleData example = bend();
  fmt::print("settled {:.4f}, compensated {:.4f}, best {:.4f}\n", before, example.settled_error, example.best_error);
  // Under gravity the body bends where the eigenfunctions do not see it, so that it is not the best to the last digit.
  EXPECT_NEAR(example.settled_error, example.best_error, 0.02);
  EXPECT_NEAR(norm(end_of_run(scene) - given_) / norm(given_), example.settled_error, kSettled);
  // With the rest pose in place of the example gravity has no effect that the eigenfunctions see.
  Json at_rest = scene;
  at_rest["examples"]["weights"] = {1, 0};
  const double compensated = norm(end_of_run(at_rest));
  scene["examples"].erase("compensate");
  ASSERT_EQ(bundle(scene).status, 0);
  at_rest["examples"].erase("compensate");
  EXPECT_LT(compensated, 0.2 * norm(end_of_run(at_rest)));
}

// A strong force makes this body fall over on its way to be crushed; a bend is the nearer the stronger its force is.
TEST_F(SettledPoses, AreCompensatedEachByItself) {
  Json scene = kScene;
  scene["examples"]["compensate"] = true;
  ASSERT_EQ(bundle(scene).status, 0);
  const double alone = bend().settled_error;
  TetMesh crushed = mesh_;
  crushed.vertices.col(0) *= 0.5;
  write_msh(folder_.path("crush.msh"), crushed);
  asset_ = write_small_bar(
      folder_, {{"examples", {{{"name", "crush"}, {"mesh", "crush.msh"}}, {{"name", "bend"}, {"mesh", "own.msh"}}}}});
  scene["examples"]["weights"] = {1, 0, 0};
  const Outcome made = bundle(scene);
  ASSERT_EQ(made.status, 0) << made.errors;
  const std::vector<ExampleData> both = read_bundle(folder_.path("bundle.h5")).examples->examples;
  fmt::print("bend {:.4f} alone, {:.4f} beside crush, which settles at {:.4f}, best {:.4f}\n", alone,
             both[2].settled_error, both[1].settled_error, both[1].best_error);
  EXPECT_NEAR(both[2].settled_error, alone, 0.01);
  EXPECT_THAT(made.errors, HasSubstr("so weak a force does not hold the pose: raise examples.stiffness"));
  EXPECT_EQ(made.errors.find("ten times examples.stiffness"), std::string::npos) << "of targets for another";
}

// The force of a few eigenfunctions takes the body all of the way, since its basis holds the pose as it was given.
TEST_F(SettledPoses, AreThePosesAlsoWhereEigenfunctionsLoseSomeOfThem) {
  asset_ = write_small_bar(folder_, {{"examples", {{{"name", "bend"}, {"mesh", "own.msh"}}}},
                                     {"shape_space", {{"eigenfunctions", 3}, {"tolerance", 0.1}}}});
  ASSERT_EQ(bundle(kScene).status, 0);
  fmt::print("lost {:.4f}, best {:.4f}\n", bend().shape_space_error, bend().best_error);
  EXPECT_GT(bend().shape_space_error, 0.08);
  EXPECT_LT(bend().best_error, 0.02);
}

TEST_F(SettledPoses, OfCompensatedTargetsBelongToTheirScene) {
  Json scene = kScene;
  scene["steps"] = 1;
  ASSERT_EQ(bundle(scene).status, 0);
  scene["examples"]["compensate"] = true;
  const Outcome refused = exmat_runtime({"run", write_scene(folder_, scene)});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.errors, AllOf(HasSubstr("scene.json"), HasSubstr("/examples/compensate"),
                                    HasSubstr("expected a bundle that was made for this scene"), HasSubstr("--scene")));
  ASSERT_EQ(bundle(scene).status, 0);
  EXPECT_EQ(exmat_runtime({"run", write_scene(folder_, scene)}).errors.find("compensated"), std::string::npos);
  scene["gravity"] = {0, 0, -2};
  const Outcome other = exmat_runtime({"run", write_scene(folder_, scene)});
  EXPECT_EQ(other.status, 0);
  EXPECT_THAT(other.errors, HasSubstr("compensated for a stiffness of 50 1/s^2 and gravity of (0, 0, -1)"));
  scene["examples"]["force"] = "elastic";
  const Outcome elastic =
      exmat_precompute({"bundle", asset_, "-o", folder_.path("b.h5"), "--scene", write_scene(folder_, scene)});
  EXPECT_EQ(elastic.status, 2);
  EXPECT_THAT(elastic.errors, AllOf(HasSubstr("/examples/compensate"), HasSubstr("found an elastic force")));
}

// --if-changed knows the scene's loads.
TEST_F(SettledPoses, AreMadeAgainForAnotherLoad) {
  const auto again = [&](const Json& scene) {
    return exmat_precompute({"bundle", asset_, "-o", folder_.path("bundle.h5"), "--scene", write_scene(folder_, scene),
                             "--if-changed"})
        .errors;
  };
  ASSERT_EQ(bundle(kScene).status, 0);
  EXPECT_THAT(again(kScene), HasSubstr("nothing to do"));
  Json scene = kScene;
  scene["examples"]["stiffness"] = 600;
  EXPECT_EQ(again(scene).find("nothing to do"), std::string::npos);
  scene["examples"]["compensate"] = true;
  EXPECT_EQ(again(scene).find("nothing to do"), std::string::npos);
}

TEST_F(SettledPoses, SayWhereAPoseMovesWhatIsFixed) {
  TetMesh posed = mesh_;
  posed.vertices.col(2).array() += 0.05 * mesh_.vertices.col(0).array().square();
  for (auto x : posed.vertices.rowwise())
    if (x[0] < 1e-6 && x[1] > 0.6) x[1] += 0.25;  // half of the clamp slides
  write_msh(folder_.path("own.msh"), posed);
  const Outcome checked = exmat_precompute({"check", asset_});
  EXPECT_EQ(checked.status, 0);
  EXPECT_THAT(checked.errors, HasSubstr("example bend: the pose moves fixed vertices by up to"));
  const Outcome made = bundle(kScene);
  EXPECT_THAT(made.errors, HasSubstr("example bend: the pose moves fixed vertices by up to"));
}

}  // namespace settled_poses_test
}  // namespace exmat::test
