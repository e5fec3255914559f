#pragma once

#include <string>

namespace exmat {

/// docs/bundle_format.md: the tables of schemas/bundle.json and schemas/trajectory.json. A test keeps the committed
/// page equal to it.
std::string format_page();

}  // namespace exmat
