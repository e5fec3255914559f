#include "common/console/console.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <iostream>
#include <limits>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <omp.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/nearest_name.h"
#include "common/core/progress.h"

namespace exmat {
namespace {

// Shorter stages pass without a line.
constexpr double kQuietSeconds = 2.0;
constexpr int kMostThreads = 4096;

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

/// Names out of files may hold characters that move a terminal's cursor, or begin a line of their own.
std::string printable(std::string_view text) {
  std::string shown(text);
  std::ranges::replace_if(
      shown, [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return shown;
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

/// Signals of a terminal, of a supervisor, of timers and of limits. One that the program was started to ignore, as by
/// nohup, stays ignored.
void catch_signals() {
  for (const int signal :
       {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGXCPU, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF})
    if (std::signal(signal, end_by_signal) == SIG_IGN) std::signal(signal, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a write then fails, with a reason
}

/// Commands and groups of options, which the parser keeps likewise.
std::vector<const CLI::App*> parts_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

void refuse_empty_values(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options())
    for (const std::string& value : option->results())
      if (value.empty())
        throw InputError({option->get_name(), "", "a value", "an empty one", "give one, or leave the option out"});
  for (const CLI::App* part : parts_of(app)) refuse_empty_values(*part);
}

void flush_output() {
  const bool written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (!written) throw WorkError(fmt::format("cannot write to standard output: {}", std::strerror(errno)));
}

/// Adds the options of a program or a command, and of its groups, as words of the command line.
void add_options(const CLI::App& app, std::vector<std::string>& names) {
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  for (const CLI::App* part : parts_of(app))
    if (part->get_name().empty()) add_options(*part, names);
}

/// The first word that is meant as an option, and is none, with the one that it may have meant; empty: there is none.
std::string unknown_option(const CLI::App& app) {
  std::vector<std::string> names;
  add_options(app, names);
  for (const CLI::App* command : app.get_subcommands()) add_options(*command, names);
  for (const std::string& word : app.remaining(true)) {
    if (!word.starts_with("-") || word == "--") continue;
    const std::string option = word.substr(0, word.find('='));
    const std::string nearest = nearest_name(option, names);
    return fmt::format("there is no option '{}'{}", option,
                       nearest.empty() ? "" : fmt::format("; did you mean {}?", nearest));
  }
  return {};
}

/// The parser's message, with what an option without a value is, with all names of an option that is missing, and with
/// the command or the option that a word may have meant.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  std::string message = error.what();
  const auto commands = parts_of(app);
  const bool is_of_words = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr ||
                           dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
  if (is_of_words && (commands.empty() || !app.get_subcommands().empty()))
    if (const std::string unknown = unknown_option(app); !unknown.empty()) return unknown;
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr && message.ends_with(" missing"))
    return fmt::format("{}: expected {}, found none; give one, or leave the option out",
                       message.substr(0, message.find(':')), message.ends_with(" TEXT missing") ? "a path" : "a value");
  for (const CLI::App* command : commands)
    for (const CLI::Option* option : command->get_options())
      if (message == option->get_name() + " is required") message = option->get_name(false, true) + " is required";
  if (!app.get_subcommands().empty()) return message;
  std::vector<std::string> names;
  names.reserve(commands.size());
  for (const CLI::App* command : commands) names.push_back(command->get_name());
  for (const std::string& word : app.remaining()) {
    if (word.starts_with("-")) continue;
    const std::string nearest = nearest_name(word, names);
    return fmt::format("there is no command '{}'; {}", word,
                       nearest.empty() ? fmt::format("commands are {}", fmt::join(names, ", "))
                                       : fmt::format("did you mean {}?", nearest));
  }
  return message;
}

}  // namespace

CLI::Validator number_between(double low, double high) {
  const auto check = [low, high](const std::string& text) {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    const bool is_number = !text.empty() && *end == '\0';
    if (is_number && value >= low && value <= high) return std::string();  // not-a-number is in no range
    return fmt::format("expected a number from {:g} to {:g}, found '{}'", low, high, text);
  };
  return {check, fmt::format("FLOAT in [{:g} - {:g}]", low, high)};
}

CLI::Validator whole_number_between(std::int64_t low, std::int64_t high) {
  const auto check = [low, high](const std::string& text) {
    std::int64_t value = 0;
    if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return std::string();
    return fmt::format("expected a whole number from {} to {}, found '{}'", low, high, text);
  };
  return {check, fmt::format("INT in [{} - {}]", low, high)};
}

CLI::Validator positive_number() {
  return number_between(std::numeric_limits<double>::min(), std::numeric_limits<double>::max()).description("POSITIVE");
}

void add_common_options(CLI::App& app, CommonOptions& options) {
  app.fallthrough();
  app.footer("Every command also takes --version, --threads, --log-level and --progress: see " + app.get_name() +
             " --help.");
  app.add_option("--threads", options.threads, "OpenMP threads; 0: all cores. Results do not depend on it")
      ->check(whole_number_between(0, kMostThreads))
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
  log::set_sink(
      [logger](log::Level level, std::string_view message) { logger->log(spdlog_level(level), printable(message)); });
  set_progress_sink(make_progress_sink(options.progress));
  if (options.threads > 0)
    omp_set_num_threads(options.threads);
  else if (omp_get_max_threads() > kMostThreads)
    throw InputError({"OMP_NUM_THREADS", "", fmt::format("at most {} threads", kMostThreads),
                      std::to_string(omp_get_max_threads()), ""});
  constexpr std::string_view kSets[] = {"portable", "avx2", "avx512"};
  const char* const set = std::getenv("EXMAT_SIMD");
  if (set != nullptr && std::ranges::find(kSets, set) == std::end(kSets))
    throw InputError({"EXMAT_SIMD", "", fmt::format("{}", fmt::join(kSets, ", ")), set,
                      "leave it out for the fastest of this machine"});
}

int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action) {
  catch_signals();
  const CommandFiles files;
  try {
    app.parse(argc, argv);
    refuse_empty_values(app);
    action();
    flush_output();
    return static_cast<int>(ExitStatus::kDone);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help, --version
      app.exit(error);
      std::cout.flush();
      if (std::cout.good() && std::fflush(stdout) == 0) return static_cast<int>(ExitStatus::kDone);
      std::fputs((app.get_name() + ": cannot write to standard output\n").c_str(), stderr);
      return static_cast<int>(ExitStatus::kFailure);
    }
    std::fputs(
        fmt::format("{}: {}; see {} --help\n", app.get_name(), usage_message(app, error), app.get_name()).c_str(),
        stderr);
    return static_cast<int>(ExitStatus::kBadInput);
  } catch (const InputError& error) {
    std::fputs((app.get_name() + ": " + printable(error.what()) + "\n").c_str(), stderr);
    return static_cast<int>(ExitStatus::kBadInput);
  } catch (const std::bad_alloc&) {
    std::fputs((app.get_name() + ": not enough memory\n").c_str(), stderr);
  } catch (const std::exception& error) {
    // The library names no file if printing fails.
    const bool printing = std::ferror(stdout) != 0 && dynamic_cast<const WorkError*>(&error) == nullptr;
    std::fputs(fmt::format("{}: {}{}\n", app.get_name(), printing ? "cannot write to standard output: " : "",
                           printable(error.what()))
                   .c_str(),
               stderr);
  }
  return static_cast<int>(ExitStatus::kFailure);
}

}  // namespace exmat
