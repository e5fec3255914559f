#pragma once

#include <cstdint>

namespace exmat::precompute {

/// Bytes that this process may still take: what the system has to give, as far as the process's own limit allows.
std::int64_t available_memory();

}  // namespace exmat::precompute
