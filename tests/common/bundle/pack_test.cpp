#include <algorithm>
#include <cstring>
#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <regex>

#include "common/bundle/bundle.h"
#include "common/bundle/file_schemas.h"
#include "common/bundle/pack_store.h"
#include "common/core/crc32.h"
#include "common/core/error.h"
#include "tests/common/bundle/field_text.h"
#include "tests/common/bundle/small_model.h"

namespace exmat {
namespace {

using test::FieldText;
using test::small_model;
using test::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

std::string refusal(const std::function<void()>& read) {
  try {
    read();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

class Pack : public ::testing::Test {
 protected:
  static std::string bytes_of(const ReducedModel& model) {
    const TemporaryFolder folder;
    write_pack(model, folder / "a.exmat");
    return test::read_file(folder / "a.exmat");
  }
  static BundleInput in_memory(std::string bytes) {
    return {"a pack", std::make_shared<const std::string>(std::move(bytes))};
  }
  static std::string refusal_of(std::string bytes) {
    return refusal([&] { read_bundle(in_memory(std::move(bytes))); });
  }

  template <typename T>
  static T get(const std::string& pack, std::size_t place) {
    T value;
    std::memcpy(&value, pack.data() + place, sizeof value);
    return value;
  }
  template <typename T>
  static void put(std::string& pack, std::size_t place, T value) {
    std::memcpy(pack.data() + place, &value, sizeof value);
  }
  // Begin of the first array, or of the zeros before it.
  static std::size_t end_of_table(const std::string& pack) {
    return PackHeader::kSize + get<std::uint64_t>(pack, PackHeader::kTableBytes);
  }
  // The checksums that stand there after the change, so that what follows them is tried.
  static std::string mended(std::string pack) {
    const auto bytes = std::as_bytes(std::span(pack));
    put(pack, PackHeader::kTableCrc,
        crc32_of(bytes.subspan(PackHeader::kSize, get<std::uint64_t>(pack, PackHeader::kTableBytes))));
    put(pack, PackHeader::kCrc, crc32_of(bytes.first(PackHeader::kCrc)));
    return pack;
  }

  const ReducedModel model_ = small_model();
  const std::string pack_ = bytes_of(model_);
};

TEST_F(Pack, HoldsAllThatTheBundleHasButWhatNoRunReads) {
  const TemporaryFolder folder;
  for (const bool constrained : {true, false})
    for (const bool with_examples : {true, false}) {
      const ReducedModel model = small_model(constrained, with_examples);
      write_bundle(model, folder / "a.h5");
      write_pack(model, folder / "a.exmat");
      const auto whole = FieldText(read_bundle(folder / "a.h5")).fields;
      const auto packed = FieldText(read_bundle(folder / "a.exmat")).fields;
      ASSERT_EQ(packed.size(), whole.size());
      for (const auto& [path, text] : whole) {
        const std::string in_schema =
            std::regex_replace(std::regex_replace(path, std::regex("^/regions/[^/@]+"), "/regions/{region}"),
                               std::regex("/examples/[^/@]+(?=[/@])"), "/examples/{example}");
        const bool is_attribute = path.find('@') != std::string::npos;
        if (!is_attribute && bundle_schema().dataset(in_schema).use == Use::kInspect)
          EXPECT_THAT(packed.at(path), StartsWith("0 x")) << path;
        else
          EXPECT_EQ(packed.at(path), text) << path;
      }
      EXPECT_THAT(validate_bundle(folder / "a.exmat"), IsEmpty());
      EXPECT_EQ(summarise_bundle(folder / "a.exmat").vertices, summarise_bundle(folder / "a.h5").vertices);
      EXPECT_EQ(summarise_bundle(folder / "a.exmat").groups, summarise_bundle(folder / "a.h5").groups);
    }
}

TEST_F(Pack, HasTheSameBytesForTheSameModel) { EXPECT_EQ(bytes_of(model_), bytes_of(small_model())); }

TEST_F(Pack, HasArraysAtMultiplesOf64Bytes) {
  const PackStore store("a pack", std::make_shared<const std::string>(pack_));
  // The only place where the basis stands, as the definition of the format says.
  const RowMatrix& basis = model_.modal->basis;
  const std::string_view content(reinterpret_cast<const char*>(basis.data()),
                                 static_cast<std::size_t>(basis.size()) * sizeof(double));
  const std::size_t place = pack_.find(content);
  ASSERT_NE(place, std::string::npos);
  EXPECT_EQ(place % 64, 0u);
  EXPECT_EQ(pack_.size() % 64, 0u);
}

TEST_F(Pack, IsRefusedAtEveryLengthButItsOwn) {
  ASSERT_EQ(refusal_of(pack_), "");
  for (std::size_t length = 0; length < pack_.size(); ++length)
    ASSERT_NE(refusal_of(pack_.substr(0, length)), "") << length;
  EXPECT_THAT(refusal_of(pack_.substr(0, pack_.size() - 64)),
              AllOf(HasSubstr("a pack"), HasSubstr("cut short by 64 bytes")));
  EXPECT_THAT(refusal_of(pack_ + std::string(64, '\0')), HasSubstr("damaged"));
}

TEST_F(Pack, IsRefusedWithAnyBitOfHeaderAndTableChangedAndWithBitsOfItsData) {
  const std::size_t table = end_of_table(pack_);
  for (std::size_t byte = 0; byte < pack_.size(); byte += byte < table ? 1 : 5)
    for (int bit = 0; bit < 8; bit += byte < PackHeader::kSize ? 1 : 3) {
      std::string changed = pack_;
      changed[byte] = static_cast<char>(changed[byte] ^ (1 << bit));
      ASSERT_NE(refusal_of(std::move(changed)), "") << "byte " << byte << ", bit " << bit;
    }
}

TEST_F(Pack, IsReadOrRefusedWithAnyLengthAndNumberInItsTable) {
  constexpr std::uint64_t kOdd[] = {0, 1, 0x7f, 0xff, 0x7fffffff, 0xffffffff, 0x7fffffffffffffff, 0xffffffffffffffff};
  const std::size_t table = end_of_table(pack_);
  std::size_t refused = 0;
  for (std::size_t place = PackHeader::kVersion; place + 8 <= table; place += place < PackHeader::kSize ? 8 : 7)
    for (const std::uint64_t odd : kOdd) {
      std::string changed = pack_;
      if (place < PackHeader::kSize || place % 2 == 0)
        put(changed, place, odd);
      else
        put(changed, place, static_cast<std::uint32_t>(odd));
      const bool fits = get<std::uint64_t>(changed, PackHeader::kTableBytes) <= changed.size() - PackHeader::kSize;
      refused += refusal_of(fits ? mended(changed) : changed).empty() ? 0 : 1;
    }
  EXPECT_GT(refused, 0u);
}

TEST_F(Pack, IsRefusedWithOtherBytesBetweenItsArrays) {
  std::string changed = pack_;
  ASSERT_EQ(changed.back(), '\0');
  changed.back() = 1;
  EXPECT_THAT(refusal_of(changed), HasSubstr("expected 0 between arrays"));
}

TEST_F(Pack, OfAnotherVersionSaysSo) {
  std::string changed = pack_;
  put(changed, PackHeader::kVersion, kPackVersion + 1);
  EXPECT_THAT(refusal_of(changed), AllOf(HasSubstr("expected version 1, found 2"), HasSubstr("another version")));
}

TEST_F(Pack, ThatIsNoneIsNamed) {
  EXPECT_THAT(refusal_of(std::string(100, 'x')), HasSubstr("expected a pack of a bundle, found another kind of file"));
  EXPECT_THAT(refusal_of(""), HasSubstr("expected a pack of a bundle"));
}

TEST_F(Pack, ServesRowsOfTheBasis) {
  const std::array<std::int64_t, 2> vertices = {3, 0};
  const RowMatrix rows = read_basis_rows(in_memory(pack_), vertices);
  EXPECT_EQ(rows.topRows(3), model_.modal->basis.middleRows(9, 3));
  EXPECT_EQ(rows.bottomRows(3), model_.modal->basis.topRows(3));
}

}  // namespace
}  // namespace exmat
