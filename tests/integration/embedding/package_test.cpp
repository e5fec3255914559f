// Installs what was built and lets programs of their own find it: find_package, compile, link, run.
#include <array>
#include <cstdio>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sstream>
#include <sys/wait.h>

#include "common/hdf5/hdf5_file.h"
#include "tests/integration/embedding/bar_files.h"

namespace exmat {
namespace {

using test::BarFiles;
using test::TemporaryFolder;
using ::testing::HasSubstr;
using ::testing::Not;

struct Outcome {
  int status = -1;
  std::string output;  ///< and errors
};

Outcome shell(const std::string& command) {
  Outcome outcome;
  std::FILE* const pipe = popen(("( " + command + " ) 2>&1").c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer;
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe))
    outcome.output.append(buffer.data(), count);
  const int status = pclose(pipe);
  if (WIFEXITED(status)) outcome.status = WEXITSTATUS(status);
  return outcome;
}

std::string word(const std::filesystem::path& path) { return "'" + path.string() + "'"; }

class PackageTest : public ::testing::Test {
 protected:
  void SetUp() override {
    must_run(fmt::format("'{}' --install '{}' --component runtime --prefix {}", EXMAT_CMAKE, EXMAT_BINARY_DIR,
                         word(prefix_)));
  }

  static std::string must_run(const std::string& command) {
    const Outcome outcome = shell(command);
    EXPECT_EQ(outcome.status, 0) << command << '\n' << outcome.output;
    return outcome.output;
  }

  /// Configures and builds a project against the installed package; returns its build folder.
  std::filesystem::path build(const std::filesystem::path& sources) const {
    const auto folder = folder_ / ("build_" + sources.filename().string());
    const std::string flags = std::string(EXMAT_SANITIZE).empty() ? "" : "-fsanitize=" EXMAT_SANITIZE;
    must_run(fmt::format("'{}' -S {} -B {} -DCMAKE_PREFIX_PATH={} -DCMAKE_C_FLAGS='{}' -DCMAKE_CXX_FLAGS='{}'",
                         EXMAT_CMAKE, word(sources), word(folder), word(prefix_), flags, flags));
    must_run(fmt::format("'{}' --build {}", EXMAT_CMAKE, word(folder)));
    return folder;
  }

  /// q after `steps` steps of the scene by the installed program, in hexadecimal, as the consumers print it.
  std::string reduced_of_program(const std::string& scene, std::int64_t steps) const {
    const auto trajectory = folder_ / "trajectory.h5";
    must_run(fmt::format("{} run '{}' --steps {} -o {}", word(prefix_ / "bin/exmat-runtime"), scene, steps,
                         word(trajectory)));
    const Hdf5File file = Hdf5File::open(trajectory);
    const Hdf5Dataset reduced = file.open_dataset("/reduced");
    std::vector<double> q(static_cast<std::size_t>(reduced.sizes()[1]));
    reduced.read_rows(reduced.sizes()[0] - 1, 1, q.data(), ElementType::kFloat64);
    return hexadecimal(q);
  }

  static std::string hexadecimal(const std::vector<double>& numbers) {
    std::string text;
    std::array<char, 40> buffer;
    for (const double number : numbers) {
      std::snprintf(buffer.data(), buffer.size(), "%a ", number);
      text += buffer.data();
    }
    return text;
  }

  static std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
    return lines;
  }

  /// The first block of the page in this language.
  static std::string block(const std::string& page, const std::string& language) {
    const std::string fence = "```" + language + '\n';
    const std::size_t begin = page.find(fence) + fence.size();
    return page.substr(begin, page.find("```", begin) - begin);
  }

  TemporaryFolder folder_;
  std::filesystem::path prefix_ = folder_ / "installed";
  BarFiles files_;
};

const std::filesystem::path kConsumers = std::filesystem::path(EXMAT_SOURCE_DIR) / "tests/integration/embedding";

TEST_F(PackageTest, ACProgramStepsWhatTheCommandSteps) {
  const std::string scene = files_.scene(
      test::kDampedExamples + fmt::format(", \"output\": {{\"every\": 1}}, "
                                          "\"forces\": [{{\"vertices\": {{\"ids\": [{}]}}, \"force\": [1, 2, -3]}}]",
                                          files_.tip()));
  constexpr int kSteps = 40;
  const auto consumer = build(kConsumers / "c_consumer") / "consumer";
  const std::string output =
      must_run(fmt::format("{} '{}' '{}' {} {} 1 2 -3", word(consumer), scene, files_.bundle(), kSteps, files_.tip()));
  const auto lines = lines_of(output);
  ASSERT_EQ(lines.size(), 2u) << output;
  // The scene's scripted force, and the same force applied by the program to a body with the same settings.
  const std::string q = reduced_of_program(scene, kSteps);
  EXPECT_EQ(lines[0].substr(0, q.size()), q);
  EXPECT_EQ(lines[1], lines[0]);
  EXPECT_THAT(q, Not(HasSubstr("nan")));
}

TEST_F(PackageTest, ACppProgramStepsBodiesByOneAndByTwoThreads) {
  const std::string scene = files_.scene(test::kDampedExamples + ", \"output\": {\"every\": 1}");
  constexpr int kSteps = 20;
  const auto consumer = build(kConsumers / "cpp_consumer") / "consumer";
  const std::string output = must_run(fmt::format("{} '{}' {} {}", word(consumer), scene, kSteps, files_.tip()));
  const auto lines = lines_of(output);
  ASSERT_EQ(lines.size(), 2u) << output;
  const std::string q = reduced_of_program(scene, kSteps);
  EXPECT_EQ(lines[0].substr(0, q.size()), q);
  EXPECT_EQ(lines[1], fmt::format("3 exmat_body_read_positions: coordinates = {}: expected 3", 3 * files_.vertices()));
}

TEST_F(PackageTest, TheProgramOfThePageRuns) {
  const std::string page = test::read_file(std::filesystem::path(EXMAT_SOURCE_DIR) / "docs/embedding.md");
  folder_.write("page/CMakeLists.txt", block(page, "cmake"));
  const auto source = folder_.write("page/main.c", block(page, "c"));
  const std::string output = must_run(word(build(folder_ / "page") / "swing") + ' ' + word(files_.bundle()));
  const auto lines = lines_of(output);
  ASSERT_EQ(lines.size(), 10u) << output;
  EXPECT_THAT(lines.front(), HasSubstr("0.1 s: "));
  EXPECT_THAT(lines.back(), HasSubstr("1.0 s: "));

  // Without CMake.
  const auto package = prefix_;
  const std::string flags =
      must_run(fmt::format("PKG_CONFIG_PATH=$(dirname $(find {} -name exmat.pc)) pkg-config "
                           "--cflags --libs exmat",
                           word(package)));
  if (!std::string(EXMAT_SANITIZE).empty()) return;
  const auto program = folder_ / "swing";
  must_run(fmt::format("cc {} -o {} {}", word(source), word(program), flags.substr(0, flags.find('\n'))));
  EXPECT_EQ(must_run(fmt::format("LD_LIBRARY_PATH=$(dirname $(find {} -name libexmat_runtime.so)) {} {}", word(package),
                                 word(program), word(files_.bundle()))),
            output);

  const Outcome missing = shell(word(folder_ / "build_page/swing") + " no_such_bundle.h5");
  EXPECT_EQ(missing.status, 2);
  EXPECT_THAT(missing.output, HasSubstr("no_such_bundle.h5"));
}

}  // namespace
}  // namespace exmat
