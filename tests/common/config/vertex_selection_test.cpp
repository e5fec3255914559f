#include "common/config/vertex_selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/config/selection_reader.h"
#include "common/core/error.h"

namespace exmat {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Selection : public ::testing::Test {
 protected:
  void SetUp() override {
    points_.resize(4, 3);
    points_ << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
    marks_.parts["hand"] = FlagVector{{0, 1, 0, 1}};
    marks_.parts["nothing"] = FlagVector::Zero(4);
    marks_.colours.resize(4, 3);
    marks_.colours << 1, 0, 0, 0.95, 0.05, 0, 0.85, 0, 0, 0, 0, 1;
  }
  std::vector<std::int32_t> select(const std::string& json) const {
    return select_points(from_, read_selection(Json::parse(json), "scene.json", "/here"));
  }
  std::string refusal(const std::string& json) const {
    try {
      select(json);
    } catch (const InputError& error) {
      return error.what();
    }
    return "none";
  }

  VertexArray points_;
  VertexMarks marks_;
  SelectablePoints from_{
      .points = points_, .marks = &marks_, .file = "scene.json", .place = "/here", .surface = "a.glb"};
};

TEST_F(Selection, TakesEveryWord) {
  EXPECT_THAT(select(R"({"box": {"min": [0, 0, 0], "max": [1, 0.5, 0.5]}})"), ElementsAre(0, 1));
  EXPECT_THAT(select(R"({"sphere": {"center": [0, 0, 1], "radius": 1}})"), ElementsAre(0, 3));
  EXPECT_THAT(select(R"({"ids": [3, 1]})"), ElementsAre(1, 3));
  EXPECT_THAT(select(R"({"part": "hand"})"), ElementsAre(1, 3));
  EXPECT_THAT(select(R"({"color": {"rgb": [1, 0, 0]}})"), ElementsAre(0, 1));
  EXPECT_THAT(select(R"({"color": {"rgb": [1, 0, 0], "within": 0.2}})"), ElementsAre(0, 1, 2));
  EXPECT_THAT(select(R"({"point": [0.1, 0.8, 0.2]})"), ElementsAre(2));
  EXPECT_THAT(select(R"({"point": [0.5, 0.5, 0.5]})"), ElementsAre(0));  // the first of those as near
}

TEST_F(Selection, SaysWhatWasMeant) {
  EXPECT_THAT(refusal(R"({"part": "hnad"})"),
              HasSubstr("scene.json: /here/part: expected a part of a.glb, found \"hnad\"; did you mean \"hand\"?"));
  EXPECT_THAT(refusal(R"({"part": "a tail of its own"})"), HasSubstr("it has \"hand\", \"nothing\""));
  EXPECT_THAT(refusal(R"({"part": "nothing"})"), HasSubstr("choose a larger part, or more cells"));
  EXPECT_THAT(refusal(R"({"color": {"rgb": [0, 1, 0]}})"), HasSubstr("(0, 1, 0)"));
  EXPECT_THAT(refusal(R"({"point": [100, 0, 0]})"), HasSubstr("99 m off; the mesh lies in (0, 0, 0) to (1, 1, 1)"));
  EXPECT_THAT(refusal(R"({"box": {"min": [5, 5, 5], "max": [6, 6, 6]}})"), HasSubstr("at least one vertex"));
  EXPECT_THAT(refusal(R"({"box": {"min": [5, 5, 5], "max": [6, 4, 6]}})"), HasSubstr("/here/box/max/1"));
  EXPECT_THAT(refusal(R"({"ids": [4]})"), HasSubstr("/here/ids: expected 0-based vertex ids below 4, found 4"));
}

TEST_F(Selection, WithoutASurfaceHasNoParts) {
  from_.marks = nullptr;
  EXPECT_THAT(refusal(R"({"part": "hand"})"), HasSubstr("an object that is given as object.surface"));
  EXPECT_THAT(select(R"({"point": [0, 0, 9e-1]})"), ElementsAre(3));
}

}  // namespace
}  // namespace exmat
