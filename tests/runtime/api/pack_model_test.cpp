#include <exmat/exmat.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

using ::testing::HasSubstr;

struct PackCase {
  const char* name;
  test::BarOptions bar;
  bool contact;
  std::int32_t space;
};

/// A model of a pack in memory beside one of the bundle that the pack was made of.
class PackModel : public ::testing::TestWithParam<PackCase> {
 protected:
  void SetUp() override {
    test::Bar bar = test::make_bar(GetParam().bar);
    bar.model.contact = test::surface_contact(bar.model);
    write_bundle(bar.model, folder_ / "bar.h5");
    write_pack(read_bundle(folder_ / "bar.h5"), folder_ / "bar.exmat");
    pack_ = test::read_file(folder_ / "bar.exmat");
    settings_.time_step = 0.01;
    settings_.gravity[1] = -9.81;
    settings_.space = GetParam().space;
    settings_.use_contact = GetParam().contact ? 1 : 0;
    settings_.use_examples = GetParam().bar.examples > 0 ? 1 : 0;
    settings_.example_stiffness = 100;
    settings_.example_bias = 0.5;
  }

  exmat::Model of_bundle() const { return {(folder_ / "bar.h5").string(), settings_}; }
  exmat::Model of_pack() {
    // The bytes are not needed any longer, and need no alignment.
    const std::string odd = "x" + pack_;
    return exmat::Model::from_memory(std::as_bytes(std::span(odd)).subspan(1), settings_);
  }

  std::uint64_t hash_after_steps(const exmat::Model& model) const {
    exmat::Body body(model);
    if (GetParam().contact) {
      exmat_obstacle floor = exmat::default_obstacle();
      floor.point[1] = -0.2;
      floor.direction[1] = 1;
      floor.direction[2] = 0;
      floor.stiffness = 1e5;
      floor.friction = 0.4;
      std::int64_t id = 0;
      EXPECT_EQ(exmat_world_add_obstacle(exmat_body_world(body.get()), &floor, &id), EXMAT_OK);
    }
    body.step(60);
    std::uint64_t hash = 0;
    exmat_body* const handle = body.get();
    EXPECT_EQ(exmat_bodies_hash(&handle, 1, &hash), EXMAT_OK);
    return hash;
  }

  test::TemporaryFolder folder_;
  std::string pack_;
  exmat_settings settings_ = exmat::default_settings();
};
INSTANTIATE_TEST_SUITE_P(
    Bodies, PackModel,
    ::testing::Values(PackCase{"clamped_with_examples", {.examples = 3}, false, EXMAT_SPACE_REDUCED},
                      PackCase{"free_in_contact", {.free = true}, true, EXMAT_SPACE_REDUCED},
                      PackCase{"full_space", {}, false, EXMAT_SPACE_FULL}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_P(PackModel, StepsAsThatOfItsBundleToTheLastBit) {
  EXPECT_EQ(hash_after_steps(of_pack()), hash_after_steps(of_bundle()));
  EXPECT_EQ(hash_after_steps(exmat::Model((folder_ / "bar.exmat").string(), settings_)), hash_after_steps(of_bundle()));
}

TEST_P(PackModel, GivesPointsAndSurfaces) {
  const exmat::Model packed = of_pack(), whole = of_bundle();
  const exmat::Points a = exmat::Points::all_vertices(packed), b = exmat::Points::all_vertices(whole);
  std::vector<float> xyz(3 * a.size()), expected(3 * b.size());
  exmat::Body(packed).read_positions(a, xyz);
  exmat::Body(whole).read_positions(b, expected);
  EXPECT_EQ(xyz, expected);
  EXPECT_EQ(exmat::Points::elements(packed).size(), exmat::Points::elements(whole).size());
}

TEST_P(PackModel, IsRefusedWhereThePackIsDamaged) {
  exmat_model* model = nullptr;
  EXPECT_EQ(exmat_model_create_from_memory(pack_.data(), pack_.size() - 1, &settings_, &model), EXMAT_BAD_INPUT);
  EXPECT_EQ(model, nullptr);
  EXPECT_THAT(exmat_last_error(), ::testing::AllOf(HasSubstr("the pack in memory"), HasSubstr("cut short by 1 bytes")));
  EXPECT_EQ(exmat_model_create_from_memory(nullptr, 1, &settings_, &model), EXMAT_INVALID_ARGUMENT);
  EXPECT_EQ(exmat_model_create_from_memory(pack_.data(), 0, nullptr, &model), EXMAT_BAD_INPUT);
}

}  // namespace
}  // namespace exmat::runtime
