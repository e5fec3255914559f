#include "common/model/vertex_marks.h"

#include <gtest/gtest.h>

namespace exmat {
namespace {

TEST(VertexMarks, AreUnpackedAsTheyWerePacked) {
  VertexMarks marks;
  marks.parts["hand"] = FlagVector{{1, 0, 0, 1, 0}};
  marks.parts["Körper"] = FlagVector{{1, 1, 0, 1, 0}};
  marks.parts["nowhere"] = FlagVector::Zero(5);
  marks.colours = VertexArray::Random(5, 3).cwiseAbs();
  ObjectData object;
  pack_marks(marks, object);
  EXPECT_EQ(object.part_sets.rows(), 3);  // both, the body alone, none
  EXPECT_EQ(object.part_sets.cols(), 3);
  EXPECT_EQ(object.vertex_parts.size(), 5);
  const VertexMarks again = marks_of(object);
  EXPECT_EQ(again.parts, marks.parts);
  EXPECT_EQ(again.colours, marks.colours);
}

TEST(VertexMarks, OfAnObjectWithoutASurfaceAreNone) {
  ObjectData object;
  pack_marks({}, object);
  EXPECT_EQ(object.part_names.size(), 0);
  EXPECT_EQ(object.vertex_parts.size(), 0);
  EXPECT_TRUE(marks_of(object).parts.empty());
  EXPECT_EQ(marks_of(object).colours.rows(), 0);
}

}  // namespace
}  // namespace exmat
