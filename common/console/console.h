#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <map>
#include <string>

namespace exmat {

/// Options that both programs and all their commands take.
struct CommonOptions {
  int threads = 0;  ///< 0: as many as OpenMP gives
  std::string log_level = "info";
  std::string progress = "auto";
};

/// Adds --threads, --log-level and --progress to a program, to be given before or after the name of a command.
void add_common_options(CLI::App& app, CommonOptions& options);

/// Connects exmat::log and progress reports to stderr and sets the number of OpenMP threads. Call it once the options
/// are parsed.
void apply(const CommonOptions& options);

/// A check for options: a finite number in [low, high], or one above 0.
CLI::Validator number_between(double low, double high);
CLI::Validator positive_number();
/// The same of a whole number.
CLI::Validator whole_number_between(std::int64_t low, std::int64_t high);

/// Lets an option be one of these words, in any case, which stand for values.
template <typename Value>
void take_words(CLI::Option& option, const std::map<std::string, Value>& words) {
  option.transform(CLI::Transformer(words, CLI::ignore_case))->transform(CLI::IsMember(words, CLI::ignore_case));
}

/// Parses, runs `action` and turns what it throws into one message on stderr and an exit status: 0 done (also --help
/// and --version), 1 a failure while working or in writing to stdout, 2 bad usage or bad input. Signals that end the
/// program leave no temporary file; a file that grows beyond its limit (ulimit -f) is a failure.
int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action);

}  // namespace exmat
