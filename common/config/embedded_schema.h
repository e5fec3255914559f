#pragma once

#include <string_view>

namespace exmat {

/// Text of schemas/NAME.json as of the build. Throws std::logic_error for an unknown name.
std::string_view embedded_schema(std::string_view name);

}  // namespace exmat
