#include "precompute/training/fidelity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;

TEST(FidelityText, NamesWhatWasTriedAndWhatWasNot) {
  Segment heavy, pulled, pushed;
  heavy.duration = 2;
  heavy.gravity = {0, 3, -4};
  pulled.duration = 0.5;
  pulled.examples = {{.stiffness = 40, .damping = 1, .bias = 0.5}};
  pushed.duration = 0.25;
  pushed.examples = {{.stiffness = 700, .damping = 1, .bias = 1}};
  pushed.forces = {{{1, 2, 5, 7}, {0, 0, 3}}};                                    // 12 N in all
  const TrainingRunOptions options{.angular_frequency = 3, .mass_damping = 0.2};  // beta = 0.03 / 3
  const std::vector<Chain> runs{{heavy}, {pulled, pushed}};
  EXPECT_EQ(tried_text(runs, options, false),
            "gravity of 5 m/s^2, example forces of kappa 40 to 7e+02 1/s^2, bias 0.5 to 1, forces of 12 N on vertices, "
            "in runs of 0.75 to 2 s with mass damping 0.2 1/s and stiffness damping 0.01 s");
  EXPECT_EQ(untried_text(runs, false),
            "stiffer examples, contact, hands, stronger or weaker loads, longer runs, other damping");

  EXPECT_EQ(tried_text({{heavy}}, options, true),
            "no load, in runs of 2 s with mass damping 0.2 1/s and stiffness damping 0.01 s")
      << "gravity deforms no free body";
  EXPECT_EQ(
      untried_text({{pulled}}, false),
      "gravity, stiffer examples, forces on vertices, contact, hands, stronger or weaker loads, longer runs, other "
      "damping");
}

TEST(FidelityText, NamesThrowsAndElasticExamples) {
  Segment thrown;
  thrown.duration = 1;
  thrown.motion.linear_velocity = {0, 0, -3};
  thrown.obstacle = runtime::Obstacle{runtime::Plane{{0, 0, 0}, {0, 0, 1}}, {}, 1e6, 0, 0.5};
  thrown.examples = {{.stiffness = 2, .damping = 0, .bias = 1, .elastic = true}};
  const TrainingRunOptions options{.angular_frequency = 3, .stiffness_damping = 0};
  EXPECT_EQ(
      tried_text({{thrown}}, options, true),
      "elastic example forces of factor 2, bias 1, throws at a plane with 3 m/s, in runs of 1 s with mass damping "
      "0 1/s and stiffness damping 0 s");
  EXPECT_EQ(untried_text({{thrown}}, true),
            "stiffer examples, forces on vertices, hands, stronger or weaker loads, longer runs, other damping");
}

FidelityData fidelity(double shape_error, double modal_error) {
  FidelityData data;
  data.shape_error = shape_error;
  data.modal_error = modal_error;
  data.advice = "more cubature.elements";
  return data;
}

TEST(FidelityWarning, SaysThatTrainingMadeTheBodyWorse) {
  EXPECT_EQ(warning_of(fidelity(0.77, 0.58)),
            "training made the body worse: it is 77 % from the full space in held-out runs, modes alone with all "
            "elements 58 %; more cubature.elements, or basis.training \"none\"");
  EXPECT_THAT(warning_of(fidelity(0.034, 0.03)), HasSubstr("training made the body worse"));
  EXPECT_EQ(warning_of(fidelity(0.032, 0.03)), "") << "within a tenth";
  EXPECT_EQ(warning_of(fidelity(0.019, 0.001)), "") << "an error that is none";
}

TEST(FidelityWarning, SaysThatTheBodyIsFarFromTheFullSpace) {
  EXPECT_EQ(warning_of(fidelity(0.11, 0.2)),
            "in held-out runs the body is 11 % from the full space: more cubature.elements");
  EXPECT_EQ(warning_of(fidelity(0.09, 0.2)), "");
}

}  // namespace
}  // namespace exmat::precompute
