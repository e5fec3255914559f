#pragma once

#include <string>

namespace exmat {

/// Of what both programs are built on: "HDF5 1.10.8, Eigen 3.4.0".
std::string library_versions();

}  // namespace exmat
