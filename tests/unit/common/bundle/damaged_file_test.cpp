#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/bundle/schema.h"
#include "common/core/error.h"
#include "tests/unit/common/bundle/small_model.h"

// HDF5 1.10 leaks where it meets damaged metadata and where a file cannot be closed.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libhdf5\n"; }

namespace exmat {
namespace {

using test::read_file;
using test::small_model;
using test::TemporaryFolder;
using test::write_file;
using ::testing::HasSubstr;

// The message of reading it; empty if it is read.
std::string fault_of(const std::filesystem::path& file) {
  try {
    read_bundle(file);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

// One region, without targets: each dataset more is a few thousand bytes that are damaged one by one.
ReducedModel least_model(bool constrained) {
  ReducedModel model = small_model(constrained);
  model.regions.erase(model.regions.begin());
  return model;
}

TEST(CutShort, IsRefusedAtEachLength) {
  const TemporaryFolder folder;
  write_bundle(least_model(true), folder / "a.h5");
  const std::string content = read_file(folder / "a.h5");
  const auto file = folder / "short.h5";
  write_file(file, content);
  for (std::size_t length = content.size(); length-- > 0;) {
    std::filesystem::resize_file(file, length);
    const std::string message = fault_of(file);
    ASSERT_THAT(message, HasSubstr("short.h5: expected ")) << length;
    if (length >= 48)
      ASSERT_THAT(message, HasSubstr(fmt::format("cut short by {} bytes", content.size() - length))) << length;
    else if (length > 0)
      ASSERT_THAT(message, HasSubstr("cut short by at least")) << length;
    else
      ASSERT_THAT(message, HasSubstr("an empty file"));
  }
}

struct ByteRange {
  std::string dataset;
  std::size_t begin, end;
};

herr_t collect_range(hid_t root, const char* name, const H5O_info_t* info, void* ranges) {
  if (info->type != H5O_TYPE_DATASET) return 0;
  const hid_t dataset = H5Dopen2(root, name, H5P_DEFAULT);
  const std::size_t begin = H5Dget_offset(dataset);
  const std::size_t size = H5Dget_storage_size(dataset);
  static_cast<std::vector<ByteRange>*>(ranges)->push_back({"/" + std::string(name), begin, begin + size});
  H5Dclose(dataset);
  return 0;
}

std::vector<ByteRange> data_ranges(const std::filesystem::path& path) {
  std::vector<ByteRange> ranges;
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, collect_range, &ranges, H5O_INFO_BASIC);
  H5Fclose(file);
  return ranges;
}

TEST(FlippedBit, InDataIsFoundAndTheDatasetNamed) {
  const TemporaryFolder folder;
  write_bundle(least_model(false), folder / "a.h5");
  std::string content = read_file(folder / "a.h5");
  const auto ranges = data_ranges(folder / "a.h5");
  // All of the schema's; the three of an example three times, in the region twice; that has no targets.
  ASSERT_EQ(ranges.size(), bundle_schema().datasets.size() + 2 * 3 + 3 - 3);
  for (const auto& [dataset, begin, end] : ranges)
    for (std::size_t at = begin; at < end; ++at) {
      const auto flip = [&] { content[at] = static_cast<char>(content[at] ^ (1 << (at % 8))); };
      flip();
      write_file(folder / "b.h5", content);
      flip();
      const std::string message = fault_of(folder / "b.h5");
      ASSERT_THAT(message, HasSubstr("b.h5: " + dataset + ": expected ")) << at;
      ASSERT_THAT(message, HasSubstr("damaged or were changed")) << at;
    }
}

// A stride without common factors with the format's alignment visits all kinds of places.
TEST(FlippedByte, AnywhereIsRefusedOrHarmless) {
  constexpr std::size_t kStride = 29;
  const TemporaryFolder folder;
  write_bundle(least_model(false), folder / "a.h5");
  std::string content = read_file(folder / "a.h5");
  std::size_t refused = 0;
  for (std::size_t at = 0; at < content.size(); at += kStride) {
    content[at] = static_cast<char>(~content[at]);
    write_file(folder / "b.h5", content);
    content[at] = static_cast<char>(~content[at]);
    const std::string message = fault_of(folder / "b.h5");
    if (message.empty()) continue;
    ++refused;
    ASSERT_THAT(message, HasSubstr("b.h5")) << at;
    ASSERT_FALSE(validate_bundle(folder / "b.h5").empty()) << at;
  }
  EXPECT_GT(refused, content.size() / kStride / 2);
}

}  // namespace
}  // namespace exmat
