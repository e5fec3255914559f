#include "common/core/atomic_file.h"

#include <csignal>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/core/error.h"
#include "tests/common/bundle/small_model.h"
#include "tests/support/file_size_limit.h"

namespace exmat {
namespace {

using test::FileSizeLimit;
using test::read_file;
using test::TemporaryFolder;
using test::write_file;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string failure_of(const std::filesystem::path& target) {
  try {
    const AtomicFile file(target);
  } catch (const WorkError& error) {
    return error.what();
  }
  return "";
}

TEST(AtomicFile, AppearsWhenCommitted) {
  const TemporaryFolder folder;
  AtomicFile file(folder / "a.txt");
  EXPECT_FALSE(std::filesystem::exists(folder / "a.txt"));
  EXPECT_EQ(file.temporary().parent_path(), folder.path());
  write_file(file.temporary(), "new");
  file.commit();
  EXPECT_EQ(read_file(folder / "a.txt"), "new");
  EXPECT_EQ(folder.size(), 1u);
}

TEST(AtomicFile, LeavesTheOldOneWithoutCommit) {
  const TemporaryFolder folder;
  write_file(folder / "a.txt", "old");
  {
    const AtomicFile file(folder / "a.txt");
    write_file(file.temporary(), "new");
  }
  EXPECT_EQ(read_file(folder / "a.txt"), "old");
  EXPECT_EQ(folder.size(), 1u);
}

TEST(AtomicFile, TakesAnotherNameEachTime) {
  const TemporaryFolder folder;
  const AtomicFile first(folder / "a.txt"), second(folder / "a.txt");
  EXPECT_NE(first.temporary(), second.temporary());
}

TEST(AtomicFile, NamesAFolderThatIsMissing) {
  const TemporaryFolder folder;
  const std::string message = failure_of(folder / "none/a.txt");
  EXPECT_THAT(message, StartsWith("cannot write " + (folder / "none/a.txt").string()));
  EXPECT_THAT(message, HasSubstr("there is no folder " + (folder / "none").string()));
}

TEST(AtomicFile, RefusesAFolderAsTarget) {
  const TemporaryFolder folder;
  EXPECT_THAT(failure_of(folder.path()), HasSubstr("it is a folder"));
  EXPECT_EQ(folder.size(), 0u);
}

TEST(AtomicFile, RefusesADeviceAsTarget) {
  EXPECT_THAT(failure_of("/dev/full"), HasSubstr("it is not a regular file"));
}

TEST(AtomicFile, TellsWhyAFileCannotBeCreated) {
  EXPECT_THAT(failure_of("/proc/exmat_a.txt"), StartsWith("cannot write /proc/exmat_a.txt: "));
}

TEST(WriteFileAtomically, LeavesTheOldFileWhenTheDiskIsFull) {
  const TemporaryFolder folder;
  write_file_atomically(folder / "a.txt", "old");
  {
    const FileSizeLimit limit(1000);
    EXPECT_THROW(write_file_atomically(folder / "a.txt", std::string(5000, 'x')), WorkError);
  }
  EXPECT_EQ(read_file(folder / "a.txt"), "old");
  EXPECT_EQ(folder.size(), 1u);
}

TEST(AtomicFile, ReplacesWhatALinkLeadsTo) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "sub");
  write_file(folder / "sub/old.txt", "old");
  std::filesystem::create_symlink("sub/old.txt", folder / "link");
  std::filesystem::create_symlink("sub/new.txt", folder / "link_to_nothing");
  for (const char* name : {"link", "link_to_nothing"}) {
    write_file_atomically(folder / name, "new");
    EXPECT_TRUE(std::filesystem::is_symlink(folder / name));
  }
  EXPECT_EQ(read_file(folder / "sub/old.txt"), "new");
  EXPECT_EQ(read_file(folder / "sub/new.txt"), "new");
  EXPECT_EQ(folder.size(), 3u);
}

TEST(EndBySignal, RemovesTheFilesOfThisProcessAlone) {
  const TemporaryFolder folder;
  write_file(folder / "a.txt", "old");
  const AtomicFile of_parent(folder / "b.txt");
  const pid_t child = fork();
  if (child == 0) {
    const AtomicFile first(folder / "a.txt");
    AtomicFile second(folder / "c.txt");
    second.commit();
    std::signal(SIGTERM, end_by_signal);
    std::raise(SIGTERM);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM);
  EXPECT_EQ(read_file(folder / "a.txt"), "old");
  EXPECT_EQ(folder.names(), (std::set<std::string>{"a.txt", "c.txt", of_parent.temporary().filename()}));
}

// A process that is killed while it writes.
pid_t killed_writer(const std::filesystem::path& target) {
  const pid_t child = fork();
  if (child == 0) {
    const AtomicFile output(target);
    std::raise(SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  return child;
}

TEST(AtomicFile, RemovesWhatAKilledProcessLeftBehind) {
  const TemporaryFolder folder;
  const auto target = folder / "out.txt", other = folder / "out.txt.old";
  write_file_atomically(target, "old");
  killed_writer(target);
  killed_writer(other);
  EXPECT_EQ(folder.names().size(), 3U) << "nothing was left behind";
  const AtomicFile alive(target);
  EXPECT_EQ(folder.names().size(), 3U);  // its own in the place of the killed one's
  write_file_atomically(target, "new");
  EXPECT_TRUE(std::filesystem::exists(alive.temporary())) << "a living process lost its file";
  EXPECT_EQ(read_file(target), "new");
  write_file_atomically(other, "other");
  EXPECT_EQ(folder.names().size(), 3U);
}

}  // namespace
}  // namespace exmat
