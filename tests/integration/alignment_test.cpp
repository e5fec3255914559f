#include <algorithm>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <regex>

#include "tests/integration/support.h"
#include "tests/support/box_mesh.h"

namespace exmat::test {
namespace {

using namespace nlohmann::literals;
using testing::HasSubstr;

const Json kQuick =
    R"({ "basis": { "size": 14, "linear_modes": 6 }, "cubature": { "elements": 20, "training_poses": 40 } })"_json;

class Alignment : public testing::Test {
 protected:
  // The twist on a tessellation that is neither the object's nor the rest example's.
  std::filesystem::path write_other(const Json& changes = Json::object()) {
    Json all = kQuick;
    all.merge_patch(changes);
    const auto asset = write_bar(folder_, bar_, all);
    TetMesh posed = box_mesh({12, 4, 4}, bar_.lengths);
    posed.vertices = twisted(posed.vertices, bar_) * bar_.pose_rotation.transpose();
    write_msh(folder_.path("twist.msh"), posed);
    return asset;
  }

  TemporaryFolder folder_;
  BarFiles bar_;
};

// The same pose on the rest example's own mesh needs no registration. Measured 4 %; the functions of different meshes
// differ by about 1 %.
TEST_F(Alignment, APoseOnAnotherMeshComesOverAsOnTheRestExamplesOwn) {
  const auto own = build(write_bar(folder_, bar_, kQuick));
  const ReducedModel model = through_bundle(build(write_other()).model, folder_.path("bundle.h5"));
  const ExampleData &expected = own.model.examples->examples[1], &example = model.examples->examples[1];
  EXPECT_EQ(expected.method, "same_connectivity");
  EXPECT_EQ(example.method, "registered");
  const Eigen::MatrixXd error = example.descriptor - expected.descriptor,
                        pose = expected.descriptor - model.shape_space->rest_descriptor;
  EXPECT_LE(error.norm(), 0.08 * pose.norm());
  EXPECT_LE(example.doubt, 0.5);
  EXPECT_LE(example.alignment_residual, 0.01);
  EXPECT_EQ(example.inverted_fraction, 0);
  EXPECT_GE(example.competing_maps, 1);  // the bar turned upon itself, which is farther from rest
}

TEST_F(Alignment, RefusalIsExitStatusOneWithoutABundleUnlessAccepted) {
  const auto asset = write_other();
  write_msh(folder_.path("twist.msh"), box_mesh({5, 5, 5}, {1, 1, 1}));  // another body
  const auto bundle = folder_.path("bundle.h5");
  const Outcome refused = exmat_precompute({"bundle", asset, "-o", bundle});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("example twist: alignment refused: "));
  EXPECT_THAT(refused.errors, HasSubstr("alignment.landmarks (8 vertices that do not lie in a plane)"));
  EXPECT_FALSE(std::filesystem::exists(bundle));
  const Outcome checked = exmat_precompute({"check", asset});
  EXPECT_EQ(checked.status, 1);
  EXPECT_THAT(checked.output, testing::ContainsRegex("twist +registered .*refused"));
}

TEST_F(Alignment, CheckReportsWithoutTheRestOfTheWork) {
  const auto report = folder_.path("report");
  const Outcome outcome = exmat_precompute({"check", write_other(), "--alignment-report", report});
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, testing::ContainsRegex("rest +rest_map .*good"));
  EXPECT_THAT(outcome.output, testing::ContainsRegex("twist +registered .*good"));
  EXPECT_THAT(outcome.errors, testing::Not(HasSubstr("cubature")));
  EXPECT_THAT(read_file(report / "twist.vtk"), HasSubstr("VECTORS displacement double"));
  EXPECT_THAT(read_file(report / "twist_example.vtk"), HasSubstr("DATASET UNSTRUCTURED_GRID"));
  const std::string page = read_file(report / "index.html");
  EXPECT_THAT(page, testing::AllOf(HasSubstr("<h2>twist <span>good</span></h2>"), testing::EndsWith("</html>\n")));
}

// m = 3 carries no twist. The number named is put to the proof.
TEST_F(Alignment, WarningNamesTheNumberOfFunctionsThatWouldDo) {
  const auto few = build(
      write_bar(folder_, bar_, R"({ "shape_space": { "eigenfunctions": 3 }, "basis": { "size": 8, "linear_modes": 5 },
                                                       "cubature": { "elements": 15, "training_poses": 40 } })"_json));
  std::smatch match;
  const auto named = std::ranges::find_if(few.report.warnings, [&](const std::string& warning) {
    return std::regex_search(warning, match,
                             std::regex("shape_space.eigenfunctions: ([0-9]+) would lose less than 25 %"));
  });
  ASSERT_NE(named, few.report.warnings.end());
  EXPECT_GT(few.model.examples->examples[1].shape_space_error, 0.25);
  Json more = kQuick;
  more["shape_space"]["eigenfunctions"] = std::stoi(match[1]);
  const auto enough = build(write_bar(folder_, bar_, more));
  EXPECT_LE(enough.model.examples->examples[1].shape_space_error, 0.26);  // its map loses a little besides
}

TEST_F(Alignment, LandmarksFileIsCheckedAgainstTheMeshes) {
  const auto asset = write_other({{"alignment", {{"method", "landmarks"}, {"landmarks", "marks.txt"}}}});
  folder_.write("marks.txt", "1 1 1\n2 2 2\n3 3 9999\n");
  const Outcome wrong = exmat_precompute({"check", asset});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.errors,
              HasSubstr("marks.txt: line 3: expected a vertex number from 1 to 325 or '-', found '9999'"));
  folder_.write("marks.txt", "1 1 1\n2 2 2\n");
  const Outcome few = exmat_precompute({"check", asset});
  EXPECT_EQ(few.status, 2);
  EXPECT_THAT(few.errors, HasSubstr("expected at least 4 landmarks of example twist, found 2"));
}

TEST_F(Alignment, AnEmptyExampleIsRefused) {
  const auto asset = write_other();
  write_msh(folder_.path("twist.msh"), TetMesh{VertexArray::Zero(0, 3), TetArray::Zero(0, 4)});
  const Outcome outcome = exmat_precompute({"check", asset});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.errors, HasSubstr("twist.msh"));
}

}  // namespace
}  // namespace exmat::test
