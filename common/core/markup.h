#pragma once

#include <string>

namespace exmat {

/// Text as it may stand in HTML and SVG, in attributes too.
std::string escaped(const std::string& text);

}  // namespace exmat
