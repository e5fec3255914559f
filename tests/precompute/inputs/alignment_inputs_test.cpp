#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/error.h"
#include "precompute/examples/alignment_report.h"
#include "precompute/examples/alignment_verdict.h"
#include "precompute/inputs/correspondence_files.h"
#include "tests/support/box_mesh.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string refusal(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "nothing";
}

TEST(Landmarks, AreReadFromOneWithCommentsAndGaps) {
  const test::TemporaryFolder folder;
  const auto file = folder.write("marks.txt", "# object rest bend\n1 2 3\n\n4, 5, -  # no bend\r\n10 - 12");
  IndexMatrix expected(3, 3);
  expected << 0, 1, 2, 3, 4, -1, 9, -1, 11;
  EXPECT_EQ(read_landmarks(file, {10, 5, 12}), expected);
}

TEST(Landmarks, FaultsAreNamedWithTheirLine) {
  const test::TemporaryFolder folder;
  const auto message = [&](const char* text) {
    const auto file = folder.write("marks.txt", text);
    return refusal([&] { read_landmarks(file, {10, 10}); });
  };
  EXPECT_THAT(message("1 2\n3\n"), HasSubstr("marks.txt: line 2: expected 2 vertex numbers or '-', found fewer"));
  EXPECT_THAT(message("1 2 3\n"), HasSubstr("line 1: expected 2 vertex numbers or '-', found '3' after them"));
  EXPECT_THAT(message("1 11\n"), HasSubstr("line 1: expected a vertex number from 1 to 10 or '-', found '11'"));
  EXPECT_THAT(message("0 1\n"), HasSubstr("found '0'"));
  EXPECT_THAT(message("1 x\n"), HasSubstr("found 'x'"));
  EXPECT_THAT(message("# nothing\n"), HasSubstr("expected lines of vertex numbers, found none"));
  EXPECT_THAT(refusal([&] { read_landmarks(folder.path("no.txt"), {1}); }), HasSubstr("no such file"));
}

TEST(VertexMap, HasALineForEachVertexOfTheObject) {
  const test::TemporaryFolder folder;
  const auto file = folder.write("map.txt", "3\n-\n1\n");
  EXPECT_EQ(read_vertex_map(file, 3, 5), (IndexVector(3) << 2, -1, 0).finished());
  EXPECT_THAT(refusal([&] { read_vertex_map(file, 4, 5); }),
              HasSubstr("map.txt: expected 4 lines, one for each vertex of the object, found 3"));
  EXPECT_THAT(refusal([&] { read_vertex_map(file, 3, 2); }), HasSubstr("line 1: expected a vertex number from 1 to 2"));
}

PoseAlignment good() {
  PoseAlignment alignment;
  alignment.doubt = 0.2;
  alignment.displacement = 0.3;
  return alignment;
}

AlignmentOutcome judged(const PoseAlignment& alignment, bool free_frame = false) {
  AlignmentOutcome outcome;
  outcome.name = "bend";
  judge_pose(alignment, AlignmentFrame::kAuto, free_frame, outcome);
  return outcome;
}

// The limits of docs/alignment.md, each with what would help.
TEST(AlignmentVerdict, FollowsTheLimits) {
  EXPECT_EQ(judged(good()).verdict, AlignmentVerdict::kGood);
  const auto with = [](auto change) {
    PoseAlignment alignment = good();
    change(alignment);
    return judged(alignment);
  };
  EXPECT_EQ(with([](auto& a) { a.doubt = 0.49; }).verdict, AlignmentVerdict::kGood);
  EXPECT_EQ(with([](auto& a) { a.doubt = 0.51; }).verdict, AlignmentVerdict::kDoubtful);
  const auto refused = with([](auto& a) { a.doubt = 1.21; });
  EXPECT_EQ(refused.verdict, AlignmentVerdict::kRefused);
  EXPECT_THAT(refused.message, HasSubstr("alignment.landmarks (8 vertices that do not lie in a plane)"));
  EXPECT_EQ(with([](auto& a) { a.inverted_fraction = 0.05; }).verdict, AlignmentVerdict::kRefused);
  EXPECT_THAT(with([](auto& a) { a.mirrored = true; }).message, HasSubstr("mirror image"));
  EXPECT_EQ(with([](auto& a) { a.squeezed_fraction = 0.1; }).verdict, AlignmentVerdict::kDoubtful);
  EXPECT_THAT(with([](auto& a) { a.uncovered = 0.1; }).message, HasSubstr("has the pose all parts"));
  const auto revolved = with([](auto& a) { a.hides_twist = true; });
  EXPECT_EQ(revolved.verdict, AlignmentVerdict::kDoubtful);
  EXPECT_THAT(revolved.message, HasSubstr("alignment.map"));
  const auto still = with([](auto& a) {
    a.hides_twist = true;
    a.displacement = 0.01;
  });
  EXPECT_EQ(still.verdict, AlignmentVerdict::kRefused);
  EXPECT_EQ(with([](auto& a) { a.turn = 1.5; }).verdict, AlignmentVerdict::kRefused);
  PoseAlignment ambiguous = good();
  ambiguous.ambiguous = true;
  ambiguous.competing_maps = 2;
  EXPECT_EQ(judged(ambiguous, true).verdict, AlignmentVerdict::kDoubtful) << "the least moved pose is taken";
  EXPECT_THAT(judged(ambiguous, true).message, AllOf(HasSubstr("2 other poses fit as well"), HasSubstr("landmarks")));
  ambiguous.residual = 0.06;
  EXPECT_EQ(judged(ambiguous, true).verdict, AlignmentVerdict::kRefused) << "its surface is met by no more than 5 %";
  EXPECT_THAT(judged(ambiguous, true).message, HasSubstr("alignment.frame \"shared\""));
}

TEST(AlignmentVerdict, RefusalsAreOneErrorUnlessAccepted) {
  AlignmentOutcome bad = judged(good());
  object_to(bad, AlignmentVerdict::kRefused, "first reason");
  object_to(bad, AlignmentVerdict::kRefused, "second reason");
  std::vector<std::string> warnings;
  AssetConfig asset;
  EXPECT_THROW(require_aligned(asset, {bad}, warnings), WorkError);
  EXPECT_EQ(refusal([&] {
              require_aligned(asset, {judged(good()), bad}, warnings);
            }),
            "example bend: alignment refused: first reason");
  AlignmentOutcome worse = judged(good());
  object_to(worse, AlignmentVerdict::kDoubtful, "doubt");
  object_to(worse, AlignmentVerdict::kRefused, "refusal");
  EXPECT_EQ(worse.message, "refusal; besides, doubt");
  asset.alignment.accept = true;
  require_aligned(asset, {bad}, warnings);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_THAT(warnings.front(), HasSubstr("first reason (taken, as alignment.accept says)"));
}

TEST(AlignmentReport, VtkHoldsTheMesh) {
  const TetMesh box = test::box_mesh({1, 1, 1}, {1, 2, 3});
  const std::string text = vtk_text(box, box.vertices, "box");
  EXPECT_THAT(text, testing::StartsWith("# vtk DataFile Version 3.0\nbox\nASCII\nDATASET UNSTRUCTURED_GRID\n"));
  EXPECT_THAT(text, HasSubstr("POINTS 8 double\n0 0 0\n1 0 0\n"));
  EXPECT_THAT(text, HasSubstr("CELLS 6 30\n4 0 1 3 7\n"));
  EXPECT_THAT(text, HasSubstr("POINT_DATA 8\nVECTORS displacement double\n0 0 0\n1 0 0\n"));
}

}  // namespace
}  // namespace exmat::precompute
