#include "runtime/api/failures.h"

#include <cstdarg>
#include <cstdio>

namespace exmat::runtime {
namespace {

thread_local char last_message[4096] = "";

}  // namespace

exmat_status fail(exmat_status status, const char* format, ...) noexcept {
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(last_message, sizeof last_message, format, arguments);
  va_end(arguments);
  return status;
}

const char* last_failure() noexcept { return last_message; }

}  // namespace exmat::runtime
