#pragma once

#include <Eigen/Core>
#include <fmt/format.h>
#include <string>

namespace exmat::runtime {

/// One line of a result on stdout.
inline void print(const char* name, const std::string& value) { fmt::print("{:<22} {}\n", name, value); }

/// Says that positions are measured from another place than 0, where they are.
inline void print_origin(const Eigen::Vector3d& origin, const char* what) {
  if (!origin.isZero(0))
    print("origin", fmt::format("{:.0f} {:.0f} {:.0f} m, {}", origin.x(), origin.y(), origin.z(), what));
}

}  // namespace exmat::runtime
