#pragma once

#include <CLI/CLI.hpp>

#include "precompute/solvers/ranks.h"

namespace exmat {

/// Takes --eps-NAME [VALUE] and --st-NAME [VALUE], also NAME=VALUE, out of the words of a command line: names are
/// SLEPc's and PETSc's, with - for _. A word that starts with - and no digit is not a value.
std::vector<std::pair<std::string, std::string>> take_solver_options(std::vector<char*>& words);

/// Throws InputError where one of the options writes files, which no command has claimed, or names an eigensolver that
/// does not serve.
void check_solver_options(const precompute::SolverSettings& settings);

/// Adds --eigensolver; the settings must outlive the program's parsing.
void add_solver_options(CLI::App& app, precompute::SolverSettings& settings);

}  // namespace exmat
