#include "precompute/study/sweep/workers.h"

#include <csignal>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdexcept>
#include <unistd.h>

#include "common/core/error.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute {
namespace {

using ::testing::HasSubstr;

TEST(Workers, DoEveryJobInAnotherProcess) {
  const test::TemporaryFolder folder;
  for (const int processes : {1, 3}) {
    std::vector<Job> jobs;
    for (int i = 0; i < 7; ++i)
      jobs.push_back({std::to_string(i), [&folder, i] { folder.write(std::to_string(i), std::to_string(getpid())); }});
    for (const auto& failure : run_in_processes("jobs", jobs, processes)) EXPECT_FALSE(failure);
    std::set<std::string> writers;
    for (int i = 0; i < 7; ++i) writers.insert(test::read_file(folder / std::to_string(i)));
    EXPECT_EQ(writers.size(), 7U);
    EXPECT_FALSE(writers.contains(std::to_string(getpid())));
  }
  EXPECT_TRUE(run_in_processes("none", {}, 2).empty());
}

TEST(Workers, SayWhatWentWrongAndGoOn) {
  const test::TemporaryFolder folder;
  const std::string endless(100000, 'x');
  const std::vector<Job> jobs{{"input",
                               [] {
                                 throw InputError({"a.json", "/b", "c", "d", ""});
                               }},
                              {"crash", [] { std::raise(SIGKILL); }},
                              {"long", [&] { throw std::runtime_error(endless); }},
                              {"status", [] { _exit(7); }},
                              {"sound", [&] { folder.write("done", "yes"); }}};
  const auto failures = run_in_processes("jobs", jobs, 2);
  EXPECT_EQ(failures.at(0).value(), "a.json: /b: expected c, found d");
  EXPECT_THAT(failures.at(1).value(), HasSubstr("signal 9"));
  EXPECT_THAT(failures.at(2).value(), HasSubstr("xxxx"));
  EXPECT_THAT(failures.at(3).value(), HasSubstr("status 7"));
  EXPECT_FALSE(failures.at(4));
  EXPECT_EQ(test::read_file(folder / "done"), "yes");
}

}  // namespace
}  // namespace exmat::precompute
