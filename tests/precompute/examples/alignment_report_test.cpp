#include "precompute/examples/alignment_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <regex>

#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TetMesh moved(TetMesh mesh, const Eigen::RowVector3d& by) {
  mesh.vertices.rowwise() += by;
  return mesh;
}

int count(const std::string& text, const std::string& part) {
  int found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

ReportedPose pose_of(const TetMesh& transferred, const TetMesh& given) {
  ReportedPose pose{{}, transferred, given};
  pose.outcome.name = "a <pose>";
  pose.outcome.method = "registered";
  return pose;
}

// A cube above another: the middles of its top are as far from the other as it was lifted, those of its bottom too,
// for they are inside; those of its sides lie on the other's sides.
TEST(AlignmentReport, DistancesAreThoseOfTheSurfaces) {
  const TetMesh box = test::box_mesh({2, 2, 2}, {1, 1, 1});
  const TetMesh lifted = moved(box, {0, 0, 0.1});
  const Eigen::VectorXd distances = surface_distances(lifted, box);
  const TriangleArray triangles = surface_triangles(lifted.tets);
  ASSERT_EQ(distances.size(), triangles.rows());
  for (Eigen::Index k = 0; k < triangles.rows(); ++k) {
    const auto height = [&](int i) { return lifted.vertices(triangles(k, i), 2); };
    const bool level = height(0) == height(1) && height(1) == height(2);
    EXPECT_NEAR(distances[k], level ? 0.1 : 0, 1e-14) << k;
  }
}

TEST(AlignmentReport, SaysWhatToChangeAndShowsFivePicturesFromTwoSides) {
  const TetMesh box = test::box_mesh({2, 2, 2}, {1, 1, 1});
  ReportedPose good = pose_of(box, moved(box, {0, 0, 0.1})), refused = good;
  refused.outcome.verdict = AlignmentVerdict::kRefused;
  refused.outcome.message = "give 8 > 4 landmarks";
  const std::string page = alignment_page("bar & co", box, {good, refused});
  EXPECT_THAT(page, HasSubstr("<title>bar &amp; co: alignment of the examples</title>"));
  EXPECT_EQ(count(page, "<svg "), 20);
  EXPECT_EQ(count(page, "a &lt;pose&gt;"), 2);
  EXPECT_THAT(page, HasSubstr("<section class=\"good\">"));
  EXPECT_THAT(page, HasSubstr("<b>nothing to change.</b>"));
  EXPECT_THAT(page, HasSubstr("<section class=\"refused\">"));
  EXPECT_THAT(page, HasSubstr("<b>give 8 &gt; 4 landmarks.</b>"));
  // 0.1 of a diagonal of sqrt 3.
  EXPECT_EQ(count(page, "up to 5.8 % from"), 4);
  EXPECT_THAT(page, Not(HasSubstr("nan")));
}

TEST(AlignmentReport, AdvisesMoreEigenfunctionsWhereTheyLoseThePose) {
  const TetMesh box = test::box_mesh({1, 1, 1}, {1, 1, 1});
  ReportedPose pose = pose_of(box, box);
  pose.outcome.shape_space_error = 0.4;
  EXPECT_THAT(alignment_page("bar", box, {pose}), HasSubstr("the eigenfunctions lose 40 % of it"));
}

// A picture of many triangles is of pixels: it covers what that of few covers, whose polygons lie side by side. The
// edge of 900 pixels may be off by half of one each: 1 % of 45,000.
TEST(AlignmentReport, ManyTrianglesCoverWhatFewDo) {
  const auto first_picture = [](int cells) {
    const TetMesh box = test::box_mesh({cells, cells, cells}, {1, 1, 1});
    const std::string page = alignment_page("box", box, {pose_of(box, box)});
    const std::size_t begin = page.find("<svg ");
    return page.substr(begin, page.find("</svg>") - begin);
  };
  const std::string few = first_picture(2), many = first_picture(32);
  double area = 0;
  const std::regex triangle(R"(l(-?\d+)[ ]?(-?\d+)[ ]?(-?\d+)[ ]?(-?\d+)z)");  // its first two edges
  for (std::sregex_iterator it(few.begin(), few.end(), triangle), end; it != end; ++it) {
    std::array<double, 4> x{};
    for (std::size_t i = 0; i < 4; ++i) x[i] = std::stod((*it)[i + 1]);
    area += 0.5 * std::abs(x[0] * x[3] - x[1] * x[2]);
  }
  double covered = 0;
  const std::regex run(R"re(d="M(-?\d+) -?\d+\.5H(-?\d+)")re");
  for (std::sregex_iterator it(many.begin(), many.end(), run), end; it != end; ++it)
    covered += std::stod((*it)[2]) - std::stod((*it)[1]);
  EXPECT_GT(area, 1e4);
  EXPECT_NEAR(covered, area, 0.01 * area);
  EXPECT_LT(many.size(), 1000000U);
}

}  // namespace
}  // namespace exmat::precompute
