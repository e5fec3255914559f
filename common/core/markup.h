#pragma once

#include <string>

namespace exmat {

/// Text as it may stand in HTML, SVG and other XML, in attributes too.
std::string escaped(const std::string& text);

}  // namespace exmat
