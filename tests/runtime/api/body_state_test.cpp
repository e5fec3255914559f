#include "runtime/api/body_state.h"

#include <exmat/exmat.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "tests/support/scene_run.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

/// Kinds of bodies differ in what they carry from step to step; each of these has something that the others have not.
struct Case {
  const char* name;
  test::BarOptions bar;
  bool contact;
  const char* members;
};

constexpr const char* kFalling =
    R"(, "body": {"linear_velocity": [0.2, -1, 0], "angular_velocity": [1, 2, 3]},
       "obstacles": [{"plane": {"point": [0, -0.02, 0], "normal": [0, 1, 0]}, "stiffness": 1e5, "friction": 0.4}])";

std::vector<Case> cases() {
  static const std::string falling_in_full_space = std::string(kFalling) + R"(, "space": "full")";
  return {{"clamped",
           {.examples = 3},
           false,
           R"(, "examples": {"stiffness": 100, "target": "solve", "target_iterations": 1})"},
          {"newmark", {}, false, R"(, "integrator": "newmark")"},
          {"free", {.free = true}, true, kFalling},
          {"carried",
           {.carried = true},
           false,
           R"(, "body": {"motion": [{"time": 0}, {"time": 0.15, "position": [0, 0.1, 0]}]})"},
          {"full", {}, false, R"(, "space": "full", "damping": {"mass": 0.5, "stiffness": 0.01})"},
          {"full_and_free", {.free = true}, true, falling_in_full_space.c_str()},
          {"auto",
           {},
           false,
           R"(, "space": "auto", "space_release": 0.1,
              "forces": [{"vertices": {"ids": [60]}, "force": [0, 1, 0], "start": 0.05, "end": 0.15}])"}};
}

class BodyStates : public ::testing::TestWithParam<Case> {
 protected:
  exmat::Model make(const Case& test) {
    test::Bar bar = test::make_bar(test.bar);
    if (test.contact) bar.model.contact = test::surface_contact(bar.model);
    bar.model.input_sha256 = std::string(64, 'a');
    write_bundle(bar.model, folder_ / "bar.h5");
    scene_ = folder_.write(
        "scene.json", std::string(R"({"bundle": "bar.h5", "time_step": 0.01, "gravity": [0, -9.81, 0], "steps": 40)") +
                          test.members + "}");
    return exmat::Model::from_scene(scene_);
  }
  static std::uint64_t hash_of(const std::vector<exmat_body*>& bodies) {
    std::uint64_t hash = 0;
    EXPECT_EQ(exmat_bodies_hash(bodies.data(), std::ssize(bodies), &hash), EXMAT_OK);
    return hash;
  }

  test::TemporaryFolder folder_;
  std::string scene_;
};
INSTANTIATE_TEST_SUITE_P(Bodies, BodyStates, ::testing::ValuesIn(cases()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(BodyStates, ABodyThatTakesAStateGoesOnToTheLastBit) {
  const exmat::Model model = make(GetParam());
  EXPECT_EQ(model.input_sha256(), std::string(64, 'a'));
  for (const int first : {0, 1, 19, 33}) {
    exmat::Body whole(model), other(model);
    whole.step(first);
    other.step(7);
    const double* before = exmat_body_displacement(other.get());
    other.set_state(whole.state());
    EXPECT_EQ(other.state(), whole.state());
    EXPECT_EQ(other.time(), whole.time());
    EXPECT_EQ(exmat_body_displacement(other.get()), before);
    EXPECT_EQ(other.energies().elastic, whole.energies().elastic);
    whole.step(40 - first);
    other.step(40 - first);
    EXPECT_EQ(other.state(), whole.state()) << first;
  }
}

TEST_P(BodyStates, ABodyTakesItsOwnStateWhateverForceItHasBeenGiven) {
  const exmat::Model model = make(GetParam());
  exmat::Body body(model), other(model);
  const exmat::Points points = exmat::Points::vertices(model, std::vector<std::int64_t>{7});
  // Each is bounded by the same number as the state's, and a vertex has many of them.
  for (int i = 0; i < 3; ++i) body.apply_forces(points, std::vector<double>{0, 1e29, -1e30});
  other.set_state(body.state());
  EXPECT_EQ(other.state(), body.state());
}

TEST_P(BodyStates, TheHashIsThatOfARun) {
  const exmat::Model model = make(GetParam());
  exmat::Body body(model), second(model);
  body.step(40);
  second.step(40);
  SceneConfig config = load_scene(scene_);
  EXPECT_EQ(hash_of({body.get()}), test::run(config).state_hash);
  config.instances = 2;
  EXPECT_EQ(hash_of({body.get(), second.get()}), test::run(config).state_hash);
  EXPECT_EQ(exmat_bodies_hash(nullptr, 1, nullptr), EXMAT_INVALID_ARGUMENT);
}

TEST_P(BodyStates, ArraysStayInPlace) {
  const exmat::Model model = make(GetParam());
  exmat::Body body(model);
  const auto q = body.displacement(model.modes()), v = body.velocity(model.modes());
  for (const int steps : {0, 1, 20}) {
    body.step(steps);
    std::vector<double> copied_q(model.modes()), copied_v(model.modes());
    body.read_displacement(copied_q);
    body.read_velocity(copied_v);
    EXPECT_THAT(copied_q, ::testing::ElementsAreArray(q));
    EXPECT_THAT(copied_v, ::testing::ElementsAreArray(v));
  }
  body.reset();
  EXPECT_EQ(exmat_body_displacement(body.get()), q.data());
  EXPECT_EQ(exmat_body_velocity(body.get()), v.data());
  EXPECT_EQ(exmat_body_weights(body.get()) == nullptr, model.examples() == 0);
}

using BadBodyState = BodyStates;

TEST_F(BadBodyState, IsRefusedAndTheBodyIsAsItWas) {
  const exmat::Model model = make(cases()[2]);
  exmat::Body body(model);
  body.step(30);
  const std::vector<double> good = body.state();
  ASSERT_GT(good[5], 0) << "it touches the floor";
  const auto refusal = [&](std::size_t place, double number) -> std::string {
    std::vector<double> bad = good;
    if (place < bad.size())
      bad[place] = number;
    else
      bad.push_back(number);
    try {
      body.set_state(bad);
    } catch (const exmat::Error& error) {
      EXPECT_EQ(error.status(), EXMAT_INVALID_ARGUMENT);
      EXPECT_EQ(body.state(), good);
      return error.what();
    }
    return "taken";
  };
  EXPECT_THAT(refusal(good.size(), 0), HasSubstr("expected"));
  EXPECT_THAT(refusal(9, std::numeric_limits<double>::infinity()),
              HasSubstr("numbers: inf: expected finite ones of at most 1e+30"));
  EXPECT_THAT(refusal(0, 1), HasSubstr("layout 1: expected 6"));
  EXPECT_THAT(refusal(1, 0.02), HasSubstr("time step 0.02 s: expected 0.01 s, the model's"));
  EXPECT_THAT(refusal(2, 0.5), HasSubstr("steps = 0.5: expected a whole number"));
  EXPECT_THAT(refusal(3, 2), HasSubstr("begins_anew = 2: expected 0 or 1"));
  EXPECT_THAT(refusal(4, 2), HasSubstr("first step = 2: expected 0 or 1"));
  EXPECT_THAT(refusal(5, good[5] + 1), HasSubstr("numbers: they end early"));
  EXPECT_THAT(refusal(good.size() - 10, 1e6), HasSubstr("vertex = 1e+06: expected a whole number below"));
  EXPECT_THAT(refusal(good.size() - 9, 1), HasSubstr("obstacle = 1: expected a whole number below 1"));
  EXPECT_EQ(refusal(6, good[6]), "taken");
  EXPECT_THAT(refusal(9, 1e31), HasSubstr("numbers: 1e+31: expected finite ones of at most 1e+30"));
}

class ExamplesOfABody : public BodyStates {
 protected:
  exmat::Model bar(double kappa) {
    exmat_settings settings = default_settings();
    settings.use_examples = 1;
    settings.example_stiffness = kappa;
    settings.example_bias = 0.5;
    return exmat::Model(folder_ / "bar.h5", settings);
  }
};

// A body with a kappa of its own moves as one of a model of that kappa.
TEST_F(ExamplesOfABody, StiffnessIsThatOfAModelWithIt) {
  make(cases()[0]);
  const exmat::Model soft = bar(0), stiff = bar(300);
  exmat::Body body(soft), expected(stiff);
  body.set_example_stiffness(300);
  body.reset();
  body.step(1);
  expected.step(1);
  EXPECT_EQ(hash_of({body.get()}), hash_of({expected.get()}));
  EXPECT_THROW(body.set_example_stiffness(-1), exmat::Error);
  EXPECT_THROW(body.set_example_stiffness(1, 0), exmat::Error);
  const exmat::Model without(folder_ / "bar.h5");
  EXPECT_THROW(exmat::Body(without).set_example_stiffness(1), exmat::Error);
}

// With all the weight on one example and a force far above the elastic one, the body comes to rest at its pose.
TEST_F(ExamplesOfABody, GivenWeightsDrawItToTheirTarget) {
  make(cases()[0]);
  exmat_settings settings = default_settings();
  settings.use_examples = 1;
  settings.time_step = 0.01;
  settings.example_stiffness = 1e8;
  settings.example_damping = 2e4;
  settings.integrator = EXMAT_BACKWARD_EULER;
  const exmat::Model model(folder_ / "bar.h5", settings);
  exmat::Body body(model);
  const ReducedModel data = test::make_bar(cases()[0].bar).model;
  for (const Eigen::Index k : {1, 2, 0}) {
    Eigen::VectorXd weights = Eigen::VectorXd::Unit(3, k);
    body.set_example_weights({weights.data(), 3});
    body.step(600);
    EXPECT_THAT(body.weights(3), ::testing::ElementsAreArray(weights.data(), 3));
    const Eigen::Map<const Eigen::VectorXd> q(body.displacement(model.modes()).data(),
                                              body.displacement(model.modes()).size());
    const auto& all = data.examples->examples;
    double nearest = std::numeric_limits<double>::max();
    Eigen::Index found = -1;
    for (Eigen::Index i = 0; i < 3; ++i)
      if (const double distance = (q - all[static_cast<std::size_t>(i)].pose).norm(); distance < nearest) {
        nearest = distance;
        found = i;
      }
    EXPECT_EQ(found, k);
  }
  body.set_example_weights({});
  EXPECT_THROW(body.set_example_weights(std::array{1.0, 0.0}), exmat::Error);
  EXPECT_THROW(body.set_example_weights(std::array{1.0, 0.5, 0.0}), exmat::Error);
  EXPECT_THROW(body.set_example_weights(std::array{1.5, -0.5, 0.0}), exmat::Error);
}

}  // namespace
}  // namespace exmat::runtime
