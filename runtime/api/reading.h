#pragma once

#include <mutex>

namespace exmat::runtime {

/// Held while a bundle is read: HDF5 is not made for several threads.
std::mutex& reading() noexcept;

}  // namespace exmat::runtime
