#include "precompute/cache/stage_cache.h"

#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/assembly.h"
#include "precompute/examples/example_alignment.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

using exmat::test::read_file;
using exmat::test::TemporaryFolder;
using testing::HasSubstr;

template <typename Value>
std::string bytes_of(const Value& value) {
  ByteWriter writer;
  write_bytes(writer, value);
  return writer.bytes;
}

template <typename Value>
Value read_back(std::string_view bytes) {
  Value value;
  ByteReader reader(bytes);
  pass(reader, value);
  EXPECT_EQ(reader.left(), 0U);
  return value;
}

AlignedPose sample_pose() {
  AlignedPose pose;
  pose.positions = VertexArray::Random(7, 3);
  pose.carried = CarriedShape{Eigen::MatrixXd::Random(4, 3), VertexArray::Random(5, 3)};
  pose.outcome = {"bent", "coupled", 0.1, 0.2, 0.3, 4, 0.5, AlignmentVerdict::kDoubtful, "why"};
  return pose;
}

SparseMatrix sample_sparse() {
  SparseMatrix matrix(4, 6);
  matrix.insert(0, 5) = 1.5;
  matrix.insert(2, 1) = -2.5;
  matrix.insert(2, 4) = 3.5;
  return matrix;
}

TEST(ValueBytes, GiveTheValueBack) {
  const AlignedPose pose = read_back<AlignedPose>(bytes_of(sample_pose()));
  EXPECT_EQ(bytes_of(pose), bytes_of(read_back<AlignedPose>(bytes_of(pose))));
  EXPECT_EQ(pose.outcome.message, "why");
  EXPECT_EQ(pose.outcome.verdict, AlignmentVerdict::kDoubtful);
  EXPECT_EQ(pose.carried->points.rows(), 5);
  const SparseMatrix sparse = read_back<SparseMatrix>(bytes_of(sample_sparse()));
  EXPECT_EQ(Eigen::MatrixXd(sparse), Eigen::MatrixXd(sample_sparse()));
  const auto pair = read_back<std::pair<std::optional<TargetTableData>, std::string>>(
      bytes_of(std::pair<std::optional<TargetTableData>, std::string>(std::nullopt, "none")));
  EXPECT_FALSE(pair.first);
  EXPECT_EQ(pair.second, "none");
  EXPECT_EQ(read_back<Eigen::MatrixXd>(bytes_of(Eigen::MatrixXd(0, 3))).cols(), 3);
}

TEST(ValueBytes, DifferWhereValuesDo) {
  const std::string before = bytes_of(sample_sparse());
  SparseMatrix other = sample_sparse();
  other.coeffRef(2, 4) = std::nextafter(3.5, 4);
  EXPECT_NE(bytes_of(other), before);
  EXPECT_NE(bytes_of(0.0), bytes_of(-0.0));
  EXPECT_NE(bytes_of(Eigen::MatrixXd(Eigen::MatrixXd::Zero(2, 3))),
            bytes_of(Eigen::MatrixXd(Eigen::MatrixXd::Zero(3, 2))));
  EXPECT_NE(bytes_of(std::vector<std::string>{"ab", "c"}), bytes_of(std::vector<std::string>{"a", "bc"}));
  EXPECT_NE(bytes_of(std::optional<int>()), bytes_of(std::optional<int>(0)));
}

// Sizes that the rest cannot hold are refused before memory is taken for them.
TEST(ValueBytes, AreRefusedAtEveryTruncation) {
  const std::string whole = bytes_of(sample_pose());
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_THROW(read_back<AlignedPose>(std::string_view(whole).substr(0, length)), DamagedBytes) << length;
  std::string huge = bytes_of(Eigen::MatrixXd(Eigen::MatrixXd::Zero(2, 2)));
  huge[6] = 0x7f;
  EXPECT_THROW(read_back<Eigen::MatrixXd>(huge), DamagedBytes);
  EXPECT_THROW(read_back<Eigen::Vector3d>(bytes_of(Eigen::VectorXd(Eigen::VectorXd::Zero(2)))), DamagedBytes);
}

class Cache : public testing::Test {
 protected:
  // A cache as another run finds it: the result, and whether it was computed.
  double square(double x, const std::string& stage = "square") {
    StageCache cache(folder_ / "cache");
    bool computed = false;
    const auto result = cache.get(
        stage,
        [&] {
          computed = true;
          return Eigen::VectorXd(Eigen::VectorXd::Constant(1, x * x));
        },
        x);
    computed_ = computed;
    EXPECT_EQ(cache.uses().size(), 1U);
    EXPECT_NE(cache.uses().front().found, computed);
    return result[0];
  }
  std::vector<std::filesystem::path> files() const {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "cache")) files.push_back(entry.path());
    return files;
  }

  TemporaryFolder folder_;
  bool computed_ = false;
};

TEST_F(Cache, ComputesOnceOfTheSameInputsAndStage) {
  EXPECT_EQ(square(3), 9);
  EXPECT_TRUE(computed_);
  EXPECT_EQ(square(3), 9);
  EXPECT_FALSE(computed_);
  EXPECT_EQ(square(4), 16);
  EXPECT_TRUE(computed_);
  EXPECT_EQ(square(3, "another stage"), 9);
  EXPECT_TRUE(computed_);
  EXPECT_EQ(files().size(), 3U);
}

TEST_F(Cache, WhatIsDamagedIsWarnedOfAndComputedAgain) {
  square(3);
  const auto file = files().front();
  const std::string whole = read_file(file);
  std::vector<std::string> warnings;
  const auto former = log::set_sink([&](log::Level level, std::string_view message) {
    if (level == log::Level::kWarning) warnings.emplace_back(message);
  });
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    std::string damaged = whole.substr(0, length);
    if (length == whole.size()) damaged.back() = static_cast<char>(damaged.back() ^ 1);
    exmat::test::write_file(file, damaged);
    EXPECT_EQ(square(3), 9);
    EXPECT_TRUE(computed_) << length;
    EXPECT_EQ(read_file(file), whole) << length;
  }
  log::set_sink(former);
  ASSERT_EQ(warnings.size(), whole.size() + 1);
  EXPECT_THAT(warnings.front(), HasSubstr(file.string() + ": it is damaged; computing this again: square"));
}

TEST_F(Cache, AFolderThatCannotBeIsAFailureAndAFullOneIsNot) {
  exmat::test::write_file(folder_ / "cache", "a file");
  EXPECT_THROW(StageCache(folder_ / "cache"), WorkError);
  std::filesystem::remove(folder_ / "cache");
  square(3);
  const auto file = files().front();
  std::filesystem::remove(file);
  std::filesystem::create_directory(file);  // nothing can be written there
  std::vector<std::string> warnings;
  const auto former = log::set_sink([&](log::Level level, std::string_view message) {
    if (level == log::Level::kWarning) warnings.emplace_back(message);
  });
  EXPECT_EQ(square(3), 9);
  log::set_sink(former);
  EXPECT_THAT(warnings, testing::Contains(HasSubstr("the cache keeps no square")));
}

TEST_F(Cache, WithoutAFolderKeepsNothing) {
  StageCache cache;
  for (int run = 0; run < 2; ++run)
    EXPECT_EQ(cache.get(
                  "sum", [] { return 2.0; }, 1.0),
              2);
  EXPECT_TRUE(cache.uses().empty());
}

}  // namespace
}  // namespace exmat::precompute
