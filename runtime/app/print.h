#pragma once

#include <fmt/format.h>
#include <string>

namespace exmat::runtime {

/// One line of a result on stdout.
inline void print(const char* name, const std::string& value) { fmt::print("{:<22} {}\n", name, value); }

}  // namespace exmat::runtime
