#pragma once

#include <string_view>

namespace exmat {

/// Version of the project, as in CMakeLists.txt: "0.1.0".
std::string_view version();

}  // namespace exmat
