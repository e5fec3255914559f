#include "runtime/api/reading.h"

namespace exmat::runtime {

std::mutex& reading() noexcept {
  static std::mutex mutex;
  return mutex;
}

}  // namespace exmat::runtime
