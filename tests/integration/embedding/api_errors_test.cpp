#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>
#include <thread>

#include "tests/integration/embedding/api_fixture.h"

namespace exmat {
namespace {

using test::ApiTest;
using test::BarFiles;
using test::displacement;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

exmat_status created(const std::string& bundle, const exmat_settings* settings = nullptr) {
  exmat_model* model = reinterpret_cast<exmat_model*>(1);
  const exmat_status status = exmat_model_create(bundle.c_str(), settings, &model);
  EXPECT_EQ(model == nullptr, status != EXMAT_OK);
  exmat_model_destroy(model);
  return status;
}

TEST_F(ApiTest, FaultyFilesAreBadInput) {
  EXPECT_EQ(created(files_.folder() / "none.h5"), EXMAT_BAD_INPUT);
  EXPECT_THAT(exmat_last_error(), AllOf(HasSubstr("none.h5"), HasSubstr("no such file")));

  const std::string whole = test::read_file(files_.bundle());
  for (const std::size_t size : {std::size_t{0}, std::size_t{100}, whole.size() / 2, whole.size() - 1}) {
    const auto cut = files_.folder().write("cut.h5", whole.substr(0, size));
    EXPECT_EQ(created(cut), EXMAT_BAD_INPUT) << size;
    EXPECT_THAT(exmat_last_error(), AllOf(HasSubstr("cut.h5"), HasSubstr("expected"), HasSubstr("found"))) << size;
  }

  exmat_model* model = nullptr;
  EXPECT_EQ(exmat_model_create_from_scene(files_.scene("\"setps\": 3").c_str(), &model), EXMAT_BAD_INPUT);
  EXPECT_THAT(exmat_last_error(), AllOf(HasSubstr("scene.json"), HasSubstr("/setps"), HasSubstr("steps")));
  EXPECT_EQ(model, nullptr);

  exmat_settings settings = default_settings();
  settings.internal_force = EXMAT_POLYNOMIAL;
  EXPECT_EQ(created(files_.bundle(), &settings), EXMAT_BAD_INPUT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("/polynomial"));
}

TEST_F(ApiTest, PointsOfAnotherBundleThanTheModelsAreRefused) {
  const Model model = this->model();
  test::Bar other = test::make_bar({.cells = {5, 2, 2}, .examples = 3});
  other.model.input_sha256[0] = '1';
  write_bundle(other.model, files_.bundle());
  try {
    Points::all_vertices(model);
    FAIL() << "read";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), EXMAT_BAD_INPUT);
    EXPECT_THAT(error.what(), HasSubstr("create the model again"));
  }
}

TEST_F(ApiTest, SettingsOutOfRangeAreInvalid) {
  const std::vector<std::pair<std::function<void(exmat_settings&)>, std::string>> faults{
      {[](auto& s) { s.time_step = 0; }, "/time_step: expected"},
      {[](auto& s) { s.time_step = kNaN; }, "settings.time_step = nan"},
      {[](auto& s) { s.gravity[2] = INFINITY; }, "settings.gravity[2] = inf"},
      {[](auto& s) { s.mass_damping = -1; }, "/damping/mass: expected"},
      {[](auto& s) { s.newton_tolerance = 1; }, "/newton/tolerance: expected"},
      {[](auto& s) { s.newton_iterations = 0; }, "/newton/max_iterations: expected"},
      {[](auto& s) { s.precision = 2; }, "settings.precision = 2: expected 0 to 1"},
      {[](auto& s) { s.sleep_energy = -1; }, "/sleep/energy: expected"},
      {[](auto& s) { s.sleep_time = 0; }, "/sleep/time: expected"},
      {[](auto& s) { s.sleep_energy = kNaN; }, "settings.sleep_energy = nan"},
      {[](auto& s) { s.example_bias = 1.5; }, "/examples/bias: expected"},
      {[](auto& s) { s.target_iterations = 0; }, "/examples/target_iterations: expected"},
      {[](auto& s) { s.integrator = 3; }, "settings.integrator = 3: expected 0 to 2"},
      {[](auto& s) { s.energy_reference = -1; }, "settings.energy_reference = -1: expected 0 to 1"},
      {[](auto& s) { s.use_examples = 2; }, "settings.use_examples = 2"},
      {[](auto& s) { s.size = 0; }, "settings.size = 0"},
      {[](auto& s) { s.size = std::size_t{1} << 60; }, "settings.size"}};
  for (const auto& [damage, message] : faults) {
    exmat_settings settings = default_settings();
    damage(settings);
    EXPECT_EQ(created(files_.bundle(), &settings), EXMAT_INVALID_ARGUMENT) << message;
    EXPECT_THAT(exmat_last_error(), HasSubstr(message));
  }
}

TEST_F(ApiTest, ProgramsOfANewerVersionAreServedUnlessTheyAskForMore) {
  struct Newer {
    exmat_settings known;
    double more;
  };
  Newer settings{{}, 1};
  ASSERT_EQ(exmat_settings_default(&settings.known, sizeof settings), EXMAT_OK);
  EXPECT_EQ(settings.known.size, sizeof settings);
  EXPECT_EQ(settings.known.time_step, 0.001);
  EXPECT_EQ(created(files_.bundle(), &settings.known), EXMAT_OK) << exmat_last_error();
  settings.more = 2;
  EXPECT_EQ(created(files_.bundle(), &settings.known), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_settings_default(&settings.known, 8), EXMAT_INVALID_ARGUMENT);

  struct NewerReport {
    exmat_report known;
    double more;
  };
  NewerReport report{{}, 1};
  report.known.size = sizeof report;
  const Model model = this->model();
  const Body body(model);
  ASSERT_EQ(exmat_body_step(body.get(), 1, &report.known), EXMAT_OK);
  EXPECT_EQ(report.known.size, sizeof report);
  EXPECT_EQ(report.known.steps, 1);
  EXPECT_EQ(report.more, 0);
  report.known.size = 0;
  EXPECT_EQ(exmat_body_step(body.get(), 1, &report.known), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(body.time(), 0.005);
}

template <typename Read, typename Struct>
void expect_served(Read read, Struct& known, const double& more, std::size_t size) {
  known.size = size;
  ASSERT_EQ(read(&known), EXMAT_OK);
  EXPECT_EQ(known.size, size);
  EXPECT_EQ(more, 0);
  known.size = 8;
  EXPECT_EQ(read(&known), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("size = 8: expected"));
}

TEST_F(ApiTest, StructsThatGrowAreFilledAsFarAsTheyAreKnown) {
  const Model model = this->model();
  const Body body(model);
  struct {
    exmat_motion known;
    double more = 1;
  } motion{};
  expect_served([&](exmat_motion* to) { return exmat_body_read_motion(body.get(), to); }, motion.known, motion.more,
                sizeof motion);
  struct {
    exmat_energies known;
    double more = 1;
  } energies{};
  expect_served([&](exmat_energies* to) { return exmat_body_read_energies(body.get(), to); }, energies.known,
                energies.more, sizeof energies);
  motion.known.size = 0;
  EXPECT_EQ(exmat_body_set_motion(body.get(), &motion.known), EXMAT_INVALID_ARGUMENT);
}

TEST_F(ApiTest, WrongArgumentsAreCodes) {
  const Model model = this->model(), other = this->model();
  const Body body(model);
  const std::array<std::int64_t, 2> ids{0, files_.tip()};
  const Points points = Points::vertices(model, ids), all = Points::all_vertices(model);
  const Points foreign = Points::vertices(other, ids);
  const auto r = static_cast<std::int64_t>(model.modes());
  exmat_model* no_model = nullptr;
  exmat_points* no_points = nullptr;
  exmat_body* no_body = nullptr;
  exmat_settings settings;
  exmat_report report{};
  report.size = sizeof report;
  exmat_energies energies{};
  energies.size = sizeof energies;
  std::array<double, 6> numbers{};
  std::array<float, 6> xyz{};
  std::vector<double> q(model.modes());
  std::vector<double> bad_q(model.modes(), kNaN);
  const std::array<std::int64_t, 2> bad_ids{0, files_.vertices()};
  const std::array<double, 6> bad_numbers{0, 0, 0, 0, kNaN, 0};
  exmat_body* const b = body.get();
  const char* const bundle = files_.bundle().c_str();

  EXPECT_EQ(exmat_settings_default(nullptr, sizeof settings), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_model_create(nullptr, nullptr, &no_model), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_model_create(bundle, nullptr, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_model_create_from_scene(nullptr, &no_model), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_model_create_from_scene(bundle, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_model_modes(nullptr), -1);
  EXPECT_EQ(exmat_model_vertices(nullptr), -1);
  EXPECT_EQ(exmat_model_examples(nullptr), -1);
  EXPECT_EQ(exmat_model_time_step(nullptr), -1);
  EXPECT_EQ(exmat_points_count(nullptr), -1);
  EXPECT_EQ(exmat_body_time(nullptr), -1);

  EXPECT_EQ(exmat_points_create_vertices(nullptr, ids.data(), 2, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_vertices(model.get(), nullptr, 2, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_vertices(model.get(), ids.data(), 2, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_vertices(model.get(), ids.data(), 0, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_vertices(model.get(), ids.data(), -1, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_vertices(model.get(), bad_ids.data(), 2, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("ids[1] = 63: expected vertices of the object, 0 to 62"));
  EXPECT_EQ(exmat_points_create_all_vertices(nullptr, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_all_vertices(model.get(), nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_at(nullptr, numbers.data(), 6, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_at(model.get(), nullptr, 6, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_at(model.get(), numbers.data(), 6, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_at(model.get(), numbers.data(), 4, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_at(model.get(), numbers.data(), 0, &no_points), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_create_at(model.get(), bad_numbers.data(), 6, &no_points), EXMAT_INVALID_ARGUMENT);
  for (const double far : {1e155, -3e200, 1.7e308}) {
    const std::array<double, 6> beyond{0, 0, 0, 0, far, 0};
    EXPECT_EQ(exmat_points_create_at(model.get(), beyond.data(), 6, &no_points), EXMAT_INVALID_ARGUMENT);
    EXPECT_THAT(exmat_last_error(), HasSubstr("xyz[4]"));
  }
  EXPECT_EQ(exmat_points_distances(nullptr, numbers.data(), 2), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_distances(points.get(), nullptr, 2), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_points_distances(points.get(), numbers.data(), 3), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(no_points, nullptr);

  EXPECT_EQ(exmat_body_create(nullptr, &no_body), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_create(model.get(), nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_reset(nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_set_reduced(nullptr, q.data(), q.data(), r), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_set_reduced(b, nullptr, q.data(), r), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_set_reduced(b, q.data(), nullptr, r), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_set_reduced(b, q.data(), q.data(), r + 1), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_set_reduced(b, q.data(), bad_q.data(), r), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_step(nullptr, 1, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_step(b, -1, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_report(nullptr, &report), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_report(b, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_apply_forces(nullptr, points.get(), numbers.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_apply_forces(b, nullptr, numbers.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_apply_forces(b, points.get(), nullptr, 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_apply_forces(b, points.get(), numbers.data(), 2), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_apply_forces(b, points.get(), bad_numbers.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("expected finite numbers"));
  for (const exmat_status status : {exmat_body_set_damping(b, 1e31, 0), exmat_body_set_damping(b, 0, 1e31),
                                    exmat_body_set_example_stiffness(b, -1, 1e31)}) {
    EXPECT_EQ(status, EXMAT_INVALID_ARGUMENT);
    EXPECT_THAT(exmat_last_error(), HasSubstr("1e+31: expected a number >= 0, of at most 1e+30"));
  }
  EXPECT_EQ(exmat_body_apply_forces(b, foreign.get(), numbers.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_apply_forces(b, all.get(), numbers.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("can only be read"));
  EXPECT_EQ(exmat_body_clear_forces(nullptr), EXMAT_INVALID_ARGUMENT);
  std::int64_t id = 0;
  EXPECT_EQ(exmat_body_add_forces(nullptr, points.get(), numbers.data(), 6, &id), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_add_forces(b, points.get(), numbers.data(), 6, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_add_forces(b, points.get(), bad_numbers.data(), 6, &id), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("exmat_body_add_forces: forces: "));
  EXPECT_EQ(exmat_body_set_forces(b, 7, points.get(), numbers.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("id = 7: expected that of forces that act on the body"));
  EXPECT_EQ(exmat_body_set_forces(nullptr, 0, points.get(), numbers.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_remove_forces(nullptr, 0), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_remove_forces(b, -1), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_restart_integrator(nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_positions(nullptr, points.get(), xyz.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_positions(b, nullptr, xyz.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_positions(b, points.get(), nullptr, 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_positions(b, points.get(), xyz.data(), 2), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_positions(b, foreign.get(), xyz.data(), 6), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_reduced(nullptr, q.data(), nullptr, r), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_reduced(b, q.data(), nullptr, r - 1), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_reduced(b, nullptr, nullptr, r), EXMAT_OK);
  EXPECT_EQ(exmat_body_read_weights(nullptr, numbers.data(), 3), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_weights(b, nullptr, 3), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_weights(b, numbers.data(), 2), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_energies(nullptr, &energies), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_body_read_energies(b, nullptr), EXMAT_INVALID_ARGUMENT);
  EXPECT_THAT(exmat_last_error(), HasSubstr("exmat_body_read_energies: energies is NULL"));
  exmat_model_destroy(nullptr);
  exmat_points_destroy(nullptr);
  exmat_body_destroy(nullptr);

  // None of it has left a trace.
  Body untouched(model);
  untouched.step(5);
  exmat_body_step(b, 5, nullptr);
  EXPECT_EQ(displacement(untouched, model.modes()), displacement(body, model.modes()));
}

TEST_F(ApiTest, MessagesBelongToTheirThread) {
  EXPECT_EQ(exmat_body_reset(nullptr), EXMAT_INVALID_ARGUMENT);
  std::string elsewhere = "?";
  std::thread([&] { elsewhere = exmat_last_error(); }).join();
  EXPECT_EQ(elsewhere, "");
  EXPECT_THAT(exmat_last_error(), HasSubstr("exmat_body_reset: body is NULL"));
}

TEST_F(ApiTest, ABodyAndPointsOutliveTheirModel) {
  std::vector<float> xyz(3);
  auto model = std::make_unique<Model>(this->model());
  const std::array<std::int64_t, 1> ids{files_.tip()};
  const Points points = Points::vertices(*model, ids);
  Body body(*model);
  model.reset();
  body.step(3);
  body.read_positions(points, xyz);
  EXPECT_TRUE(std::isfinite(xyz[0]));
}

TEST_F(ApiTest, ThreadsMayCreateModelsAtOnce) {
  std::vector<std::thread> threads;
  std::array<exmat_status, 4> statuses{};
  for (exmat_status& status : statuses) threads.emplace_back([&] { status = created(files_.bundle()); });
  for (std::thread& thread : threads) thread.join();
  for (const exmat_status status : statuses) EXPECT_EQ(status, EXMAT_OK);
}

TEST(ApiVersionTest, IsThatOfTheProject) {
  EXPECT_THAT(exmat_version(), ::testing::MatchesRegex("[0-9]+.[0-9]+.[0-9]+"));
}

}  // namespace
}  // namespace exmat
