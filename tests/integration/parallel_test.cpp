// exmat-precompute on several ranks of mpirun, and its other eigensolvers, against one rank and the direct solver.
#include <algorithm>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/mesh/assembly.h"
#include "precompute/solvers/eigenpairs.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/sim/step/stepper.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace parallel_test {

using ::testing::HasSubstr;

constexpr int kDone = 0, kFailure = 1, kBadInput = 2;
// Relative difference that bundles may have: eigenpairs have residuals below 1e-9 whatever they are found with.
constexpr double kTolerance = 1e-8;

const std::string kProgram = EXMAT_BINARY_DIR "/bin/exmat-precompute";
const std::vector<std::string> kMpirun{"--allow-run-as-root", "--oversubscribe", "--bind-to", "none"};

Outcome on_ranks(int ranks, const std::vector<std::string>& arguments) {
  std::vector<std::string> words = kMpirun;
  words.insert(words.end(), {"-n", std::to_string(ranks), kProgram});
  words.insert(words.end(), arguments.begin(), arguments.end());
  return execute("mpirun", words);
}

int count(const std::string& text, const std::string& part) {
  int found = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++found;
  return found;
}

double difference(const Eigen::MatrixXd& value, const Eigen::MatrixXd& reference) {
  if (value.rows() != reference.rows() || value.cols() != reference.cols()) return 1;
  return (value - reference).norm() / reference.norm();
}

/// Largest relative share of a column of `columns` outside the span of `span`, both orthonormal in `product`.
double outside(const Eigen::MatrixXd& span, const Eigen::MatrixXd& columns, const SparseMatrix& product) {
  const Eigen::MatrixXd rest = columns - span * (span.transpose() * (product * columns));
  return std::sqrt((rest.transpose() * (product * rest)).diagonal().maxCoeff());
}

/// The same, cluster of eigenvalues by cluster.
double outside_clusters(const ShapeSpaceData& reference, const ShapeSpaceData& space, const SparseMatrix& mass) {
  double largest = 0;
  const Eigen::Index m = reference.eigenvalues.size();
  for (Eigen::Index begin = 0, end = 0; begin < m; begin = end) {
    end = precompute::next_uncut(reference.eigenvalues, begin);
    largest = std::max(largest, outside(reference.eigenfunctions.middleCols(begin, end - begin),
                                        space.eigenfunctions.middleCols(begin, end - begin), mass));
  }
  return largest;
}

/// A folder with the small bar.
class Parallel : public testing::Test {
 protected:
  /// On the ranks of mpirun; 0: without.
  Outcome run(int ranks, std::vector<std::string> options = {}) const {
    options.insert(options.begin(), {"bundle", asset_, "-o", folder_ / "bundle.h5"});
    return ranks == 0 ? exmat_precompute(options) : on_ranks(ranks, options);
  }

  ReducedModel bundle(int ranks, const std::vector<std::string>& options = {}) const {
    const Outcome outcome = run(ranks, options);
    EXPECT_EQ(outcome.status, kDone) << outcome.errors;
    // One rank speaks.
    EXPECT_EQ(count(outcome.output, "\ntotal "), 1) << outcome.output;
    EXPECT_EQ(count(outcome.errors, "] linear modes\n"), 1) << outcome.errors;
    return read_bundle(folder_ / "bundle.h5");
  }

  /// [3n x steps] displacements of the twisting bar of bundle.h5.
  Eigen::MatrixXd motion() const {
    const SceneConfig config = load_scene(write_scene(folder_, Json::parse(R"({
      "time_step": 0.002, "steps": 100, "gravity": [0, 0, -1],
      "damping": { "mass": 0.2, "stiffness": 0.01 }, "examples": { "stiffness": 4000, "damping": 10, "bias": 0.2 } })")));
    const runtime::LoadedScene loaded = runtime::load_run(config);
    runtime::Workspace workspace(*loaded.model, loaded.scene);
    runtime::State state = make_state(*loaded.model);
    const RowMatrix basis = read_bundle(folder_ / "bundle.h5").modal->basis;
    Eigen::MatrixXd displacements(basis.rows(), config.steps);
    for (auto u : displacements.colwise()) {
      EXPECT_EQ(runtime::step(*loaded.model, loaded.scene, state, workspace).status, 0U);
      u = basis * state.q;
    }
    return displacements;
  }

  void expect_same(const ReducedModel& model, const ReducedModel& reference) const {
    const auto scalar = scalar_mass(reference.object->mesh, reference.object->materials.density);
    const SparseMatrix mass = expand_to_vectors(scalar);
    const SparseMatrix unit = scalar_mass(reference.object->mesh) / reference.shape_space->volume;
    const auto close = [](const char* what, double found) {
      fmt::print("{}: {:.1e}\n", what, found);
      EXPECT_LE(found, kTolerance) << what;
    };
    close("eigenvalues", difference(model.shape_space->eigenvalues, reference.shape_space->eigenvalues));
    close("eigenfunctions", outside_clusters(*reference.shape_space, *model.shape_space, unit));
    close("frequencies", difference(model.modal->frequencies, reference.modal->frequencies));
    close("basis", outside(reference.modal->basis, model.modal->basis, mass));
    EXPECT_EQ(model.cubature->elements, reference.cubature->elements);
    close("cubature", difference(model.cubature->weights, reference.cubature->weights));
    const auto close_poses = [&](const std::vector<ExampleData>& found, const std::vector<ExampleData>& expected) {
      ASSERT_EQ(found.size(), expected.size());
      for (std::size_t k = 1; k < found.size(); ++k)  // the first is at rest
        close("pose", difference(model.modal->basis * found[k].pose, reference.modal->basis * expected[k].pose));
    };
    ASSERT_EQ(model.examples.has_value(), reference.examples.has_value());
    if (reference.examples) close_poses(model.examples->examples, reference.examples->examples);
    ASSERT_EQ(model.regions.size(), reference.regions.size());
    for (std::size_t k = 0; k < reference.regions.size(); ++k)
      close_poses(model.regions[k].examples.examples, reference.regions[k].examples.examples);
    EXPECT_EQ(model.input_sha256, reference.input_sha256);
  }

  TemporaryFolder folder_;
  std::filesystem::path asset_ = write_small_bar(folder_);
};

TEST_F(Parallel, RanksMakeTheSameBundle) {
  // The internal force is chosen by time measured.
  asset_ = write_small_bar(folder_, Json::parse(R"({ "internal_force": "cubature" })"));
  const ReducedModel reference = bundle(0);
  const std::string bytes = read_file(folder_ / "bundle.h5");
  const Eigen::MatrixXd reference_motion = motion();
  EXPECT_GT(reference_motion.cwiseAbs().maxCoeff(), 0.05);
  const auto files = folder_.names();
  for (const int ranks : {1, 2, 3}) {
    SCOPED_TRACE(ranks);
    expect_same(bundle(ranks), reference);
    const double moved = difference(motion(), reference_motion);
    fmt::print("{} ranks, motion: {:.1e}\n", ranks, moved);
    EXPECT_LE(moved, kTolerance);
    EXPECT_EQ(folder_.names(), files);
    if (ranks == 1) {
      EXPECT_TRUE(read_file(folder_ / "bundle.h5") == bytes);
    }
  }
}

// A border of six rigid motions, on the last rank; a region's poses take solves of their own.
TEST_F(Parallel, RanksMakeTheSameFreeBodyWithARegion) {
  asset_ = write_small_bar(folder_, Json::parse(R"({
    "internal_force": "cubature", "object": { "fixed": null },
    "regions": [ { "name": "outer", "vertices": { "box": { "min": [1.99, -1, -1], "max": [9, 2, 2] } },
                   "examples": ["twist"] } ] })"));
  const ReducedModel reference = bundle(0);
  ASSERT_EQ(reference.regions.size(), 1U);
  ASSERT_TRUE(reference.rigid.has_value());
  for (const int ranks : {2, 3}) {
    SCOPED_TRACE(ranks);
    expect_same(bundle(ranks), reference);
  }
}

TEST_F(Parallel, MultigridOnTwoRanksMakesTheSameBundle) {
  asset_ = write_small_bar(folder_, Json::parse(R"({ "internal_force": "cubature" })"));
  const ReducedModel reference = bundle(0);
  expect_same(bundle(2, {"--eigensolver", "gamg", "--st-ksp-rtol", "1e-13", "--eps-max-it=900"}), reference);
}

// One message of ours, no hang, nothing left behind; mpirun says the status.
TEST_F(Parallel, FailuresEndAllRanks) {
  const auto files = folder_.names();
  const auto refused = [&](const Outcome& outcome, int status, const std::string& text) {
    EXPECT_EQ(outcome.status, status) << outcome.errors;
    EXPECT_EQ(count(outcome.errors, "exmat-precompute: "), 1) << outcome.errors;
    EXPECT_THAT(outcome.errors, HasSubstr(text));
    EXPECT_EQ(folder_.names(), files);
  };
  refused(on_ranks(2, {"bundle", folder_ / "missing.json", "-o", folder_ / "bundle.h5"}), kBadInput, "missing.json");
  refused(on_ranks(2, {"bundel"}), kBadInput, "did you mean bundle?");
  refused(run(2, {"--eps-largest_reel"}), kBadInput, "--eps-largest-reel: expected an option of the solvers in use");
  // All ranks find that it does not converge.
  refused(run(2, {"--eigensolver", "gamg", "--st-ksp-max_it", "1"}), kFailure,
          "conjugate gradients: relative residual ");
}

// The second rank is killed as if it ran out of memory; the first would wait for it for ever. The bundle of this bar
// takes many times the time after which it is killed, on any machine.
TEST_F(Parallel, TheDeathOfARankEndsTheOthers) {
  asset_ = write_bar(folder_, {.cells = {64, 24, 24}});
  const auto files = folder_.names();
  std::vector<std::string> words = kMpirun;
  const std::vector<std::string> bundle{"bundle", asset_, "-o", folder_ / "bundle.h5"};
  words.insert(words.end(), {"-n", "1", kProgram});
  words.insert(words.end(), bundle.begin(), bundle.end());
  words.insert(words.end(), {":", "-n", "1", "timeout", "-s", "KILL", "0.7", kProgram});
  words.insert(words.end(), bundle.begin(), bundle.end());
  EXPECT_NE(execute("mpirun", words).status, kDone);
  EXPECT_EQ(folder_.names(), files);
}

}  // namespace parallel_test
}  // namespace exmat::test
