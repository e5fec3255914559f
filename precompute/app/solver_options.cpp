#include "precompute/app/solver_options.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <string_view>

#include "common/console/console.h"
#include "common/core/error.h"

namespace exmat {
namespace {

using precompute::Eigensolver;

bool is_solver_option(const std::string& word) { return word.starts_with("--eps-") || word.starts_with("--st-"); }

bool is_value(const std::string& word) {
  return !word.starts_with("-") || (word.size() > 1 && std::isdigit(static_cast<unsigned char>(word[1])) != 0);
}

std::string with_dashes(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> take_solver_options(std::vector<char*>& words) {
  std::vector<std::pair<std::string, std::string>> options;
  std::vector<char*> rest;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string word = words[i];
    if (i == 0 || !is_solver_option(word)) {
      rest.push_back(words[i]);
      continue;
    }
    const std::size_t equals = word.find('=');
    std::string name = word.substr(2, equals == std::string::npos ? equals : equals - 2), value;
    std::replace(name.begin(), name.end(), '-', '_');
    if (equals != std::string::npos)
      value = word.substr(equals + 1);
    else if (i + 1 < words.size() && is_value(words[i + 1]))
      value = words[++i];
    options.emplace_back(name, value);
  }
  words = rest;
  return options;
}

void check_solver_options(const precompute::SolverSettings& settings) {
  for (const auto& [name, value] : settings.options)
    for (const char* writes : {"view", "monitor"})
      if (name.find(writes) != std::string::npos)
        throw InputError({"--" + with_dashes(name), "", "an option that writes no file",
                          std::string("one with \"") + writes + "\" in its name", "leave it out"});
  // Others do not know the inverse that they are given, or work on dense matrices: hours for some thousand vertices.
  constexpr std::array<std::string_view, 4> kTypes{"krylovschur", "arnoldi", "lanczos", "lobpcg"};
  for (const auto& [name, value] : settings.options)
    if (name == "eps_type" && std::ranges::find(kTypes, value) == kTypes.end())
      throw InputError({"--eps-type", "", "one of krylovschur, arnoldi, lanczos, lobpcg", "'" + value + "'", ""});
}

void add_solver_options(CLI::App& app, precompute::SolverSettings& settings) {
  const std::map<std::string, Eigensolver> names{{"auto", Eigensolver::kAuto},
                                                 {"direct", Eigensolver::kDirect},
                                                 {"mixed", Eigensolver::kMixed},
                                                 {"gamg", Eigensolver::kGamg},
                                                 {"lobpcg", Eigensolver::kLobpcg}};
  CLI::Option& option = *app.add_option(
      "--eigensolver", settings.eigensolver,
      "direct (MUMPS), mixed (factors in single precision), with less memory gamg (multigrid) or lobpcg, or "
      "auto, which goes by the mesh; --eps-NAME VALUE and --st-NAME VALUE are passed on to SLEPc and PETSc");
  take_words(option, names);
  option.option_text("{auto,direct,mixed,gamg,lobpcg} [auto]");
}

}  // namespace exmat
