#include "precompute/study/sources/error_split.h"

#include <algorithm>
#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sstream>

#include "common/mesh/assembly.h"
#include "precompute/study/sources/split_text.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;

// Motions of a box as a whole, whose distances are those of their shifts.
class Split : public testing::Test {
 protected:
  ChainMotion motion(std::optional<ErrorSource> source, double first, double second) const {
    BodyFrames frames;
    for (const double shift : {first, second}) {
      frames.times.push_back(frames.times.empty() ? 1 : 2);
      frames.positions.push_back(mesh_.vertices);
      frames.positions.back().col(1).array() += shift;
    }
    return {source, "a against b", frames};
  }
  ErrorSplit split() const {
    const std::vector<ErrorPart> others{{ErrorSource::kAlignment, PartStatus::kNotKnown, "why, \"so\"", {}, {}},
                                        {ErrorSource::kTable, PartStatus::kNone, "no examples", {}, {}}};
    return split_error({motion({}, 3, 4), motion(ErrorSource::kTimeStep, 3, 5), motion(ErrorSource::kBasis, 3, 3),
                        motion(ErrorSource::kCubature, 6, 3)},
                       others, mesh_.vertices, mass_, false);
  }

  TetMesh mesh_ = test::box_mesh({1, 1, 1}, {1, 1, 1});
  SparseMatrix mass_ = scalar_mass(mesh_, Eigen::VectorXd::Constant(mesh_.tet_count(), 7));
};

TEST_F(Split, IsThatOfSuccessiveMotionsOverTheSizeOfTheFirst) {
  const ErrorSplit found = split();
  ASSERT_EQ(found.parts.size(), 5U);
  const double size = std::sqrt((9.0 + 16) / 2);
  const ErrorSource order[] = {ErrorSource::kTimeStep, ErrorSource::kAlignment, ErrorSource::kBasis,
                               ErrorSource::kCubature, ErrorSource::kTable};
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(found.parts[i].source, order[i]);
  EXPECT_NEAR(found.parts[0].added->mean, std::sqrt(0.5) / size, 1e-12);
  EXPECT_NEAR(found.parts[0].added->settled, 1 / size, 1e-12);
  EXPECT_NEAR(found.parts[2].added->mean, std::sqrt(4.0 / 2) / size, 1e-12);
  EXPECT_NEAR(found.parts[2].so_far->mean, std::sqrt(1.0 / 2) / size, 1e-12) << "one undid the other in part";
  EXPECT_NEAR(found.parts[3].added->max, 3 / size, 1e-12);
  EXPECT_NEAR(found.parts[3].added->end, 0, 1e-12);
  EXPECT_FALSE(found.parts[1].added || found.parts[4].so_far);
  EXPECT_NEAR(found.total.mean, std::sqrt((9.0 + 1) / 2) / size, 1e-12);
  EXPECT_NEAR(found.sum.mean, (std::sqrt(0.5) + std::sqrt(2.0) + std::sqrt(4.5)) / size, 1e-12);
  EXPECT_NEAR(found.sum.settled, (1.0 + 2) / size, 1e-12);
}

// Each source names what its reader can turn.
TEST_F(Split, AdvisesByTheLargestPart) {
  PointKnobs knobs{20, 30, 60, 0.001, true, "table"};
  ErrorSplit found = split();
  EXPECT_THAT(advice_on(found, knobs),
              HasSubstr("ask for more cubature.elements than 60; next is basis with 40 %; what is not known"));
  const auto advice = [&](ErrorSource source) {
    ErrorSplit alone;
    alone.total.mean = 0.2;
    alone.parts = {{ErrorSource::kTargets, PartStatus::kMeasured, "", RelativeError{0.01, 0, 0, 0}, {}},
                   {source, PartStatus::kMeasured, "", RelativeError{0.19, 0, 0, 0}, {}}};
    return advice_on(alone, knobs);
  };
  EXPECT_EQ(
      advice(ErrorSource::kEigenfunctions),
      "The most of the error of 20 % is 19 % of eigenfunctions: ask for more shape_space.eigenfunctions than 20.");
  EXPECT_THAT(advice(ErrorSource::kTimeStep), HasSubstr("a smaller time_step than 0.001 s"));
  EXPECT_THAT(advice(ErrorSource::kAlignment), HasSubstr("alignment.landmarks"));
  EXPECT_THAT(advice(ErrorSource::kBasis), HasSubstr("a larger basis.size than 30, or for more basis.training_seg"));
  EXPECT_THAT(advice(ErrorSource::kTable), HasSubstr("targets.tolerance for more table nodes, or take target: solve"));
  knobs.trained = false;
  knobs.target = "solve";
  EXPECT_THAT(advice(ErrorSource::kBasis), HasSubstr("learn from runs (basis.training)"));
  EXPECT_THAT(advice(ErrorSource::kTable), HasSubstr("examples.target_iterations"));
  found.total.mean = 0.005;
  EXPECT_THAT(advice_on(found, knobs), HasSubstr("Near the full problem (0.5 %)"));
}

TEST_F(Split, IsWrittenForReadersAndPrograms) {
  ErrorSplit found = split();
  found.full_problem = "the full";
  found.advice = "Turn <it>.";
  const std::string csv = split_csv(found);
  EXPECT_THAT(csv, HasSubstr("source,status,note,added_mean,added_max,added_end,added_settled,so_far_mean,"));
  EXPECT_THAT(csv, HasSubstr("\nalignment,not_known,\"why, \"\"so\"\"\",,,,,,,,\n"));
  EXPECT_THAT(csv, HasSubstr("\nbasis,measured,a against b,0.4,0.5656854249"));
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);)
    EXPECT_EQ(std::ranges::count(line, ','), line.starts_with("alignment") ? 11 : 10) << line;
  const std::string page = split_html(found, "point 1", "position");
  EXPECT_THAT(page, HasSubstr("<td class=\"l\">basis</td><td>40.0</td>"));
  EXPECT_THAT(page, HasSubstr("Turn &lt;it&gt;."));
  EXPECT_THAT(page, HasSubstr("<td>not known</td>"));
  EXPECT_THAT(page, HasSubstr("</svg>"));
  const std::string text = split_markdown(found, "s", "point 1", "position");
  EXPECT_THAT(text, HasSubstr("| basis | 40.0 | 56.6 | 20.0 | 28.3 | basis.size, basis.training | a against b |\n"));
  found.failure = "went <wrong>";
  EXPECT_THAT(split_html(found, "point 1", "position"), HasSubstr("<p class=\"bad\">went &lt;wrong&gt;</p>"));
  EXPECT_THAT(split_csv(found), HasSubstr("total,failed"));
}

}  // namespace
}  // namespace exmat::precompute
