#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <map>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/bundle/fields.h"
#include "common/bundle/file_schemas.h"
#include "common/core/error.h"
#include "common/hdf5/schema.h"
#include "tests/common/bundle/small_model.h"

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
  // All of the schema's; the three of an example three times, in the region twice; that has no targets and no
  // six of /full_space.
  ASSERT_EQ(ranges.size(), bundle_schema().datasets.size() + 2 * 3 + 3 - 3 - 6);
  for (const auto& [dataset, begin, end] : ranges)
    for (std::size_t at = begin; at < end; at += 9) {  // each byte and bit of a number has its turn
      const auto flip = [&] { content[at] = static_cast<char>(content[at] ^ (1 << (at % 8))); };
      flip();
      write_file(folder / "b.h5", content);
      flip();
      const std::string message = fault_of(folder / "b.h5");
      ASSERT_THAT(message, HasSubstr("b.h5: " + dataset + ": expected ")) << at;
      ASSERT_THAT(message, HasSubstr("damaged or were changed")) << at;
    }
}

// All that a model holds, by place.
class Values {
 public:
  explicit Values(const ReducedModel& model) { visit_fields(model, *this); }

  void group(std::string_view, std::string_view path) { path_ = path; }
  template <typename T>
  void attribute(std::string_view name, const T& member) {
    attributes_[path_ + "@" + std::string(name)] = to_attribute(member);
  }
  template <typename T>
  void dataset(std::string_view name, const T& member) {
    const ArrayView view = view_of(member);
    const std::size_t bytes = static_cast<std::size_t>(view.rows * view.cols) * size_of(view.type);
    datasets_[fmt::format("{}/{} {} {}", path_, name, view.rows, view.cols)] =
        std::string(static_cast<const char*>(view.data), bytes);
  }
  bool operator==(const Values& other) const {
    return attributes_ == other.attributes_ && datasets_ == other.datasets_;
  }

 private:
  std::string path_;
  std::map<std::string, AttributeValue> attributes_;
  std::map<std::string, std::string> datasets_;
};

// As few datasets as a bundle can have; what HDF5 keeps of each is alike.
ReducedModel bare_model() {
  ReducedModel model = small_model(true, false);
  model.polynomial.reset();
  model.contact.reset();
  model.render.reset();
  return model;
}

// Flips one bit of every so many-th byte, all eight with EXMAT_ALL_BITS=1. HDF5's metadata are under its checksums and
// data under ours; what is left are zeros, where HDF5 leaves gaps in its blocks of metadata.
void flip_all_over(const ReducedModel& model, std::size_t stride) {
  constexpr std::size_t kValidated = 29;
  const bool all_bits = std::getenv("EXMAT_ALL_BITS") != nullptr;
  const TemporaryFolder folder;
  const auto file = folder / "a.h5";
  write_bundle(model, file);
  const std::string content = read_file(file);
  const Values values(read_bundle(file));
  std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
  const auto put = [&](std::size_t at, char byte) {
    stream.seekp(static_cast<std::streamoff>(at)).put(byte).flush();
    ASSERT_TRUE(stream);
  };
  std::size_t flips = 0, harmless = 0;
  for (std::size_t at = 0; at < content.size(); at += all_bits ? 1 : stride)
    for (std::size_t bit = all_bits ? 0 : at % 8; bit < (all_bits ? 8 : at % 8 + 1); ++bit, ++flips) {
      put(at, static_cast<char>(content[at] ^ (1 << bit)));
      const std::string message = fault_of(file);
      if (message.empty()) {
        ASSERT_TRUE(Values(read_bundle(file)) == values) << at;
        ASSERT_EQ(content[at], '\0') << at;
        ++harmless;
      } else {
        ASSERT_THAT(message, HasSubstr("a.h5")) << at;
      }
      if (at % kValidated == 0) {
        ASSERT_EQ(validate_bundle(file).empty(), message.empty()) << at;
      }
      put(at, content[at]);
    }
  fmt::print("{} bytes, {} flips, {} of them harmless\n", content.size(), flips, harmless);
  EXPECT_LT(harmless, flips / 8);
}

TEST(FlippedBit, AnywhereIsRefusedOrHarmless) { flip_all_over(bare_model(), 3); }

// Examples and regions are links, which are found by listing.
TEST(FlippedBit, InALargerBundleIsRefusedOrHarmless) { flip_all_over(least_model(false), 67); }

// In a description, which the reader does not look at. HDF5 1.10 finds no fault in it when it is asked a second time,
// and other things missing beside it.
TEST(FlippedBit, InATextOfAGroupIsFoundAtOnce) {
  const TemporaryFolder folder;
  write_bundle(small_model(false), folder / "a.h5");
  const std::string content = read_file(folder / "a.h5");
  for (const GroupSchema& group : bundle_schema().groups)
    for (auto at = content.find(group.description); at != std::string::npos;
         at = content.find(group.description, at + 1)) {
      std::string flipped = content;
      flipped[at] = static_cast<char>(flipped[at] ^ 1);
      write_file(folder / "b.h5", flipped);
      ASSERT_THAT(fault_of(folder / "b.h5"), HasSubstr("the file is damaged")) << group.path;
      ASSERT_FALSE(validate_bundle(folder / "b.h5").empty()) << group.path;
    }
}

}  // namespace
}  // namespace exmat
