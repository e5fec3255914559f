#include "runtime/api/failures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <string>

#include "tests/support/allocation_counter.h"

namespace exmat::runtime {
namespace {

using ::testing::StartsWith;

TEST(Failures, EachKindOfExceptionHasItsStatusAndMessage) {
  EXPECT_EQ(guarded("f", [] {}), EXMAT_OK);
  EXPECT_EQ(guarded("f", [] { throw InvalidArgument("ids[0] = 9"); }), EXMAT_INVALID_ARGUMENT);
  EXPECT_STREQ(last_failure(), "f: ids[0] = 9");
  EXPECT_EQ(guarded("f", [] { throw InputError({"a.h5", "/modal", "this", "that", "do so"}); }), EXMAT_BAD_INPUT);
  EXPECT_THAT(last_failure(), StartsWith("a.h5: /modal: expected this, found that"));
  EXPECT_EQ(guarded("f", [] { throw std::bad_alloc(); }), EXMAT_FAILURE);
  EXPECT_STREQ(last_failure(), "f: out of memory");
  EXPECT_EQ(guarded("f", [] { throw WorkError("disk full"); }), EXMAT_FAILURE);
  EXPECT_STREQ(last_failure(), "f: disk full");
  EXPECT_EQ(guarded("f", [] { throw 1; }), EXMAT_FAILURE);
  EXPECT_STREQ(last_failure(), "f: unknown failure");
}

TEST(Failures, AMessageIsCutAndCostsNoMemory) {
  const std::string text(100000, 'x');
  const test::AllocationCounter counter;
  fail(EXMAT_FAILURE, "%s", text.c_str());
  EXPECT_EQ(counter.count(), 0U);
  const std::string kept = last_failure();
  EXPECT_GT(kept.size(), 100U);
  EXPECT_LT(kept.size(), text.size());
}

}  // namespace
}  // namespace exmat::runtime
