#include "common/core/command_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <optional>
#include <sys/stat.h>

#include "common/core/error.h"
#include "tests/support/temporary_folder.h"

namespace exmat {
namespace {

using test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;

template <typename Action>
std::string refusal_of(Action action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string refusal_of_output(const std::filesystem::path& file, const std::string& role = "-o") {
  return refusal_of([&] { claim_output(file, role); });
}

std::string refusal_of_input(const std::filesystem::path& file) {
  return refusal_of([&] { check_input(file, "a mesh"); });
}

/// Names that lead to one file `mesh` in the folder.
std::vector<std::filesystem::path> names_of(const TemporaryFolder& folder, const std::filesystem::path& mesh) {
  std::filesystem::create_symlink("mesh", folder.path() / "link");
  std::filesystem::create_symlink(folder.path() / "link", folder.path() / "link_of_link");
  std::filesystem::create_hard_link(mesh, folder.path() / "hard");
  std::filesystem::create_directory(folder.path() / "sub");
  std::filesystem::create_directory_symlink(folder.path(), folder.path() / "sub" / "back");
  return {mesh,
          folder.path() / "sub/../mesh",
          folder.path() / "./mesh",
          folder.path() / "link",
          folder.path() / "link_of_link",
          folder.path() / "hard",
          folder.path() / "sub/back/mesh",
          std::filesystem::proximate(mesh)};
}

TEST(CommandFiles, RefuseAnOutputThatWasRead) {
  const TemporaryFolder folder;
  const auto mesh = folder.write("mesh", "x");
  const CommandFiles files;
  check_input(mesh, "a mesh");
  for (const auto& name : names_of(folder, mesh))
    EXPECT_THAT(refusal_of_output(name), HasSubstr("does not read")) << name;
  EXPECT_EQ(refusal_of_output(folder.path() / "other"), "");
}

TEST(CommandFiles, RefuseToReadAnOutput) {
  const TemporaryFolder folder;
  const auto mesh = folder.write("mesh", "x"), other = folder.write("other", "x");
  for (const auto& name : names_of(folder, mesh)) {
    const CommandFiles files;
    claim_output(name, "--report");
    EXPECT_THAT(refusal_of_input(mesh), AllOf(HasSubstr(name.string()), HasSubstr("--report"))) << name;
    EXPECT_EQ(refusal_of_input(other), "");
    const OwnOutputRead own;
    EXPECT_EQ(refusal_of_input(mesh), "");
  }
}

TEST(CommandFiles, RefuseTwoOutputsOfOneFile) {
  const TemporaryFolder folder;
  const auto mesh = folder.write("mesh", "x");
  for (const auto& name : names_of(folder, mesh)) {
    const CommandFiles files;
    claim_output(mesh, "-o");
    EXPECT_THAT(refusal_of_output(name, "--depfile"), AllOf(HasSubstr("--depfile"), HasSubstr("that of -o"))) << name;
  }
}

TEST(CommandFiles, KnowOutputsThatDoNotExist) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() / "sub");
  std::filesystem::create_symlink("new", folder.path() / "link");  // to a file that does not exist
  for (const char* name : {"new", "sub/../new", "./new", "link"}) {
    const CommandFiles files;
    claim_output(folder.path() / "new", "-o");
    EXPECT_NE(refusal_of_output(folder.path() / name, "--report"), "") << name;
    EXPECT_EQ(refusal_of_output(folder.path() / "sub/new", "--report"), "");
  }
}

TEST(CommandFiles, AreForgottenWithTheCommandAndNoneOfAHost) {
  const TemporaryFolder folder;
  const auto mesh = folder.write("mesh", "x");
  {
    const CommandFiles files;
    check_input(mesh, "a mesh");
  }
  EXPECT_EQ(refusal_of_output(mesh), "");
  EXPECT_EQ(refusal_of_input(mesh), "");
  const CommandFiles files;
  EXPECT_EQ(refusal_of_output(mesh), "");
}

TEST(CommandFiles, RefuseOutputsWithoutAFolder) {
  const TemporaryFolder folder;
  folder.write("file", "x");
  std::filesystem::create_symlink("none/new", folder.path() / "dangling");
  const CommandFiles files;
  for (const char* name : {"none/new", "file/new", "dangling"})
    EXPECT_THAT(refusal_of_output(folder.path() / name), HasSubstr("expected a name in a folder that exists")) << name;
  EXPECT_THAT(refusal_of_output(folder.path() / "new/"), HasSubstr("found the name of a folder"));
  for (const char* name : {"file/new", "file/new/deep"})
    EXPECT_THAT(refusal_of([&] { claim_folder(folder.path() / name, "--cache"); }),
                HasSubstr("--cache: expected a folder"));
  EXPECT_EQ(refusal_of([&] { claim_folder(folder.path() / "new/deep/", "-o"); }), "");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "new"));
  EXPECT_EQ(refusal_of_output(folder.path() / "new/deep/page.html"), "") << "the command makes that folder";
  EXPECT_THAT(refusal_of([&] { claim_folder(folder.path() / "new/deep", "--cache"); }), HasSubstr("that of -o"));
}

TEST(CheckInput, RefusesWhatIsNoFile) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder.path() / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(refusal_of_input(folder.path() / "none"), HasSubstr("expected a mesh, found no such file"));
  EXPECT_THAT(refusal_of_input(folder.path()), HasSubstr("found a folder"));
  EXPECT_THAT(refusal_of_input(folder.path() / "pipe"), HasSubstr("a pipe or a device"));
  EXPECT_THAT(refusal_of_input("/dev/zero"), HasSubstr("a pipe or a device"));
}

TEST(LinkTarget, IsThePathThatAWriteChanges) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() / "sub");
  std::filesystem::create_symlink("../new", folder.path() / "sub/link");
  EXPECT_EQ(link_target(folder.path() / "plain"), folder.path() / "plain");
  EXPECT_EQ(link_target(folder.path() / "sub/link"), folder.path() / "sub/../new");
}

TEST(LinkTarget, RefusesLinksThatLeadToEachOther) {
  const TemporaryFolder folder;
  std::filesystem::create_symlink("b", folder.path() / "a");
  std::filesystem::create_symlink("a", folder.path() / "b");
  const CommandFiles files;
  EXPECT_THAT(refusal_of([&] { link_target(folder.path() / "a"); }), HasSubstr("found links that lead to each other"));
  EXPECT_THAT(refusal_of_output(folder.path() / "a"), HasSubstr("found links that lead to each other"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path() / "a"));
}

TEST(CommandFiles, CheckOutputsWithoutClaimingThem) {
  const TemporaryFolder folder;
  const auto mesh = folder.write("mesh", "x"), other = folder.path() / "other";
  const CommandFiles files;
  check_input(mesh, "a mesh");
  EXPECT_THAT(refusal_of([&] { check_output(mesh, "Save"); }), HasSubstr("Save: expected a file that this command"));
  EXPECT_THAT(refusal_of([&] { check_output(folder.path(), "Save"); }), HasSubstr("found a folder"));
  for (int time = 0; time < 2; ++time) EXPECT_EQ(refusal_of([&] { check_output(other, "Save"); }), "");
  EXPECT_EQ(refusal_of_output(other), "");
  EXPECT_THAT(refusal_of([&] { check_output(other, "Save"); }), HasSubstr("that of -o"));
}

TEST(RequireKind, LetsOnlyFilesOfTheKindBeReplaced) {
  const TemporaryFolder folder;
  const auto refusal = [&](const std::filesystem::path& file) {
    return refusal_of([&] { require_kind(file, "-o", "a trajectory", "\x89HDF"); });
  };
  EXPECT_EQ(refusal(folder.path() / "new"), "");
  EXPECT_EQ(refusal(folder.write("empty", "")), "");
  EXPECT_EQ(refusal(folder.write("own", "\x89HDF and more")), "");
  EXPECT_THAT(refusal(folder.write("asset.json", "{}")),
              HasSubstr("-o: expected a trajectory to replace, or the name of a new file, found a JSON file"));
  EXPECT_THAT(refusal(folder.write("short", "\x89HD")), HasSubstr("found another kind of file"));
  std::filesystem::create_symlink("asset.json", folder.path() / "link");
  EXPECT_THAT(refusal(folder.path() / "link"), HasSubstr("found a JSON file"));
}

}  // namespace
}  // namespace exmat
