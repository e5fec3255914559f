#pragma once

#include <string>

namespace exmat {

/// Versions of the libraries of both programs: "HDF5 1.10.8, Eigen 3.4.0".
std::string library_versions();

}  // namespace exmat
