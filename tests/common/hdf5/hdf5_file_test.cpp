#include "common/hdf5/hdf5_file.h"

#include <cstdlib>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include "common/bundle/bundle.h"
#include "common/bundle/file_schemas.h"
#include "common/core/error.h"
#include "tests/common/bundle/small_model.h"
#include "tests/support/file_size_limit.h"

namespace exmat {
namespace {

using test::FileSizeLimit;
using test::read_file;
using test::small_model;
using test::TemporaryFolder;
using ::testing::HasSubstr;

SymbolSizes trajectory_sizes() {
  SymbolSizes sizes;
  sizes.set("F", 3, "the test");
  sizes.set("n", 2, "the test");
  return sizes;
}

TEST(Hdf5File, GivesBackItsAttributes) {
  const TemporaryFolder folder;
  const std::vector<std::pair<std::string, AttributeValue>> attributes = {
      {"integer", std::int64_t{-7}},
      {"number", 0.1},
      {"text", std::string("x \xc3\xa9")},
      {"empty", std::string()},
      {"integers", std::vector<std::int64_t>{1, 2}},
      {"numbers", std::vector<double>{0.5}},
      {"texts", std::vector<std::string>{"a", "", "long"}},
  };
  auto written = Hdf5File::create(folder / "a.h5", "a.h5");
  for (const auto& [name, value] : attributes) written.write_attribute("/", name, value);
  written.close();
  const auto file = Hdf5File::open(folder / "a.h5");
  for (const auto& [name, value] : attributes) EXPECT_EQ(file.read_attribute("/", name), value) << name;
  EXPECT_FALSE(file.has_attribute("/", "other"));
}

TEST(Hdf5File, SaysWhenThereIsNone) {
  const TemporaryFolder folder;
  EXPECT_THROW(Hdf5File::open(folder / "none.h5"), InputError);
  EXPECT_THROW(Hdf5File::open(folder.path()), InputError);
}

// A host program may have the file open by the same library, with locks or without.
TEST(Hdf5File, OpensWhatTheHostHasOpen) {
  const TemporaryFolder folder;
  auto written = Hdf5File::create(folder / "a.h5", "a.h5");
  written.write_attribute("/", "number", 0.5);
  written.close();
  for (const auto degree : {H5F_CLOSE_DEFAULT, H5F_CLOSE_WEAK, H5F_CLOSE_SEMI, H5F_CLOSE_STRONG})
    for (const auto& [locks, best_effort] : {std::pair{1, 1}, {1, 0}, {0, 1}, {0, 0}}) {
      const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
      H5Pset_fclose_degree(access, degree);
      H5Pset_file_locking(access, locks, best_effort);
      const hid_t host = H5Fopen((folder / "a.h5").c_str(), H5F_ACC_RDONLY, access);
      ASSERT_GE(host, 0);
      EXPECT_EQ(std::get<double>(Hdf5File::open(folder / "a.h5").read_attribute("/", "number")), 0.5);
      H5Fclose(host);
      H5Pclose(access);
    }
}

TEST(RowWriter, WritesADatasetRowByRow) {
  const TemporaryFolder folder;
  const std::vector<float> positions = {0, 1, 2, 3, 4, 5, 10, 11, 12, 13, 14, 15, 20, 21, 22, 23, 24, 25};
  auto written = Hdf5File::create(folder / "a.h5", "a.h5");
  write_header(written, trajectory_schema(), generator_name());
  RowWriter time(written, trajectory_schema().dataset("/time"), trajectory_sizes());
  RowWriter vertices(written, trajectory_schema().dataset("/vertices"), trajectory_sizes());
  for (std::size_t frame = 0; frame < 3; ++frame) {
    time.append(0.5 * static_cast<double>(frame));
    vertices.append(std::span(positions).subspan(6 * frame, vertices.row_size()));
  }
  time.finish();
  vertices.finish();
  written.close();

  const auto file = Hdf5File::open(folder / "a.h5");
  const Hdf5Dataset dataset = file.open_dataset("/vertices");
  EXPECT_EQ(dataset.type(), ElementType::kFloat32);
  EXPECT_EQ(dataset.sizes(), (std::vector<std::int64_t>{3, 2, 3}));
  std::vector<float> read(18);
  dataset.read(read.data(), ElementType::kFloat32);
  EXPECT_EQ(read, positions);
  EXPECT_EQ(file.read_attribute("/vertices", "dims"), AttributeValue("F n 3"));
  EXPECT_EQ(file.read_attribute("/vertices", "units"), AttributeValue("m"));
  EXPECT_EQ(file.read_attribute("/vertices", "crc32"),
            AttributeValue(std::int64_t{crc32_of(std::as_bytes(std::span(read)))}));
  EXPECT_EQ(file.read_attribute("/", "format"), AttributeValue("exmat-trajectory"));
}

TEST(RowWriter, RefusesMisuse) {
  const TemporaryFolder folder;
  auto file = Hdf5File::create(folder / "a.h5", "a.h5");
  RowWriter time(file, trajectory_schema().dataset("/time"), trajectory_sizes());
  EXPECT_THROW(time.append(1.0F), std::logic_error);
  EXPECT_THROW(time.append(std::span<const double>()), std::logic_error);
  EXPECT_THROW(time.finish(), std::logic_error);
  for (int frame = 0; frame < 3; ++frame) time.append(static_cast<double>(frame));
  EXPECT_THROW(time.append(3.0), std::logic_error);
  EXPECT_THROW(RowWriter(file, trajectory_schema().dataset("/reduced"), trajectory_sizes()), std::logic_error);
}

// Each limit stops the write at another place: the header, some dataset, the final flush.
TEST(FullDisk, LeavesTheOldBundleAndNoOther) {
  const TemporaryFolder folder;
  write_bundle(small_model(true, false), folder / "a.h5");
  const std::string before = read_file(folder / "a.h5");
  ReducedModel larger = small_model();
  larger.cubature->heldout_poses = RowMatrix::Constant(1000, 2, 0.5);
  write_bundle(larger, folder / "b.h5");
  const std::size_t size = std::filesystem::file_size(folder / "b.h5");
  std::filesystem::remove(folder / "b.h5");
  for (const std::size_t limit :
       {std::size_t{10}, std::size_t{100}, size / 8, size / 4, size / 2, size - 1000, size - 1}) {
    const FileSizeLimit full(limit);
    try {
      write_bundle(larger, folder / "a.h5");
      FAIL() << limit;
    } catch (const WorkError& error) {
      EXPECT_THAT(error.what(), HasSubstr("cannot write " + (folder / "a.h5").string()));
      EXPECT_THAT(error.what(), HasSubstr("File too large"));
    }
    EXPECT_TRUE(read_file(folder / "a.h5") == before) << limit;
    EXPECT_EQ(folder.size(), 1u) << limit;
  }
  write_bundle(larger, folder / "a.h5");
  EXPECT_EQ(read_bundle(folder / "a.h5").cubature->heldout_poses.rows(), 1000);
}

// HDF5's own exit handler crashes after a failed close.
TEST(FullDisk, LetsTheProgramEndInOrder) {
  const TemporaryFolder folder;
  const auto fail_and_exit = [&] {
    const FileSizeLimit full(10000);
    try {
      write_bundle(small_model(), folder / "a.h5");
    } catch (const WorkError&) {
      std::exit(static_cast<int>(ExitStatus::kFailure));
    }
  };
  EXPECT_EXIT(fail_and_exit(), ::testing::ExitedWithCode(1), "");
}

TEST(MissingFolder, IsNamed) {
  const TemporaryFolder folder;
  try {
    write_bundle(small_model(), folder / "none/a.h5");
    FAIL();
  } catch (const WorkError& error) {
    EXPECT_THAT(error.what(), HasSubstr("there is no folder"));
  }
}

}  // namespace
}  // namespace exmat
