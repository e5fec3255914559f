#pragma once

#include <string>
#include <vector>

namespace exmat {

/// The known name that a misspelt one most probably means: the least edit distance, at most a third of its letters or
/// 2. Empty where none is so near.
std::string nearest_name(const std::string& name, const std::vector<std::string>& known);

}  // namespace exmat
