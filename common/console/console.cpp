#include "common/console/console.h"

#include <cstdio>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <omp.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/progress.h"

namespace exmat {
namespace {

// Shorter stages pass without a line.
constexpr double kQuietSeconds = 2.0;

spdlog::level::level_enum spdlog_level(log::Level level) {
  switch (level) {
    case log::Level::kDebug:
      return spdlog::level::debug;
    case log::Level::kInfo:
      return spdlog::level::info;
    case log::Level::kWarning:
      return spdlog::level::warn;
    case log::Level::kError:
      return spdlog::level::err;
  }
  return spdlog::level::info;
}

std::string describe(const ProgressReport& report) {
  std::string text = report.stage;
  if (report.total > 0) text += fmt::format(": {} of {}", report.done, report.total);
  text += fmt::format(", {:.0f} s", report.elapsed_seconds);
  if (report.remaining_seconds >= 0 && !report.finished)
    text += fmt::format(", about {:.0f} s left", report.remaining_seconds);
  return text;
}

void print_plain(const ProgressReport& report) {
  if (report.elapsed_seconds >= kQuietSeconds && !report.finished)
    std::fputs((describe(report) + "\n").c_str(), stderr);
}

// One line of the terminal, rewritten.
void print_line(const ProgressReport& report) {
  if (report.elapsed_seconds < kQuietSeconds) return;
  std::fputs(report.finished ? "\r\033[K" : ("\r\033[K" + describe(report)).c_str(), stderr);
}

void print_json(const ProgressReport& report) {
  nlohmann::ordered_json line{{"stage", report.stage},
                              {"done", report.done},
                              {"total", report.total},
                              {"elapsed_seconds", report.elapsed_seconds},
                              {"finished", report.finished}};
  if (report.remaining_seconds >= 0) line["remaining_seconds"] = report.remaining_seconds;
  std::fputs((line.dump() + "\n").c_str(), stderr);
}

ProgressSink make_progress_sink(const std::string& mode) {
  if (mode == "none") return {};
  if (mode == "json") return print_json;
  if (mode == "auto" && isatty(STDERR_FILENO) != 0) return print_line;
  return print_plain;
}

}  // namespace

void add_common_options(CLI::App& app, CommonOptions& options) {
  app.fallthrough();
  app.footer("Every command also takes --version, --threads, --log-level and --progress: see " + app.get_name() +
             " --help.");
  app.add_option("--threads", options.threads, "OpenMP threads; 0: all cores. Results do not depend on it")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str();
  app.add_option("--log-level", options.log_level, "debug, info, warning or error")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}))
      ->capture_default_str();
  app.add_option("--progress", options.progress, "auto, plain, json (one object a line on stderr) or none")
      ->check(CLI::IsMember({"auto", "plain", "json", "none"}))
      ->capture_default_str();
}

void apply(const CommonOptions& options) {
  const auto logger = std::make_shared<spdlog::logger>("exmat", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern("[%H:%M:%S] [%l] %v");
  logger->set_level(spdlog::level::from_str(options.log_level));
  log::set_sink([logger](log::Level level, std::string_view message) { logger->log(spdlog_level(level), message); });
  set_progress_sink(make_progress_sink(options.progress));
  if (options.threads > 0) omp_set_num_threads(options.threads);
}

int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action) {
  try {
    app.parse(argc, argv);
    action();
    return static_cast<int>(ExitStatus::kDone);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    std::fputs((app.get_name() + ": " + error.what() + "; see " + app.get_name() + " --help\n").c_str(), stderr);
    return static_cast<int>(ExitStatus::kBadInput);
  } catch (const InputError& error) {
    std::fputs((app.get_name() + ": " + error.what() + "\n").c_str(), stderr);
    return static_cast<int>(ExitStatus::kBadInput);
  } catch (const std::bad_alloc&) {
    std::fputs((app.get_name() + ": not enough memory\n").c_str(), stderr);
  } catch (const std::exception& error) {
    std::fputs((app.get_name() + ": " + error.what() + "\n").c_str(), stderr);
  }
  return static_cast<int>(ExitStatus::kFailure);
}

}  // namespace exmat
