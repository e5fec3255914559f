#pragma once

#include <new>
#include <stdexcept>

#include "common/core/error.h"
#include "exmat/exmat.h"

namespace exmat::runtime {

/// An argument that a caller of the C API got wrong.
class InvalidArgument : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// On Windows the name printf stands for another language of formats than the one that is used there, too.
#if defined __MINGW32__
#define EXMAT_PRINTF gnu_printf
#else
#define EXMAT_PRINTF printf
#endif

/// Keeps the message for exmat_last_error(), cut to what fits, and returns `status`. No allocation.
[[gnu::format(EXMAT_PRINTF, 2, 3)]] exmat_status fail(exmat_status status, const char* format, ...) noexcept;

/// This thread's last message.
const char* last_failure() noexcept;

/// Runs what may throw; `function` is the C function that does so. Messages name no other function: those of C++ and
/// Python, which pass them on, have other names.
template <typename Action>
exmat_status guarded(const char* function, Action&& action) noexcept {
  try {
    action();
    return EXMAT_OK;
  } catch (const InvalidArgument& error) {
    return fail(EXMAT_INVALID_ARGUMENT, "%s: %s", function, error.what());
  } catch (const InputError& error) {
    return fail(EXMAT_BAD_INPUT, "%s", error.what());
  } catch (const std::bad_alloc&) {
    return fail(EXMAT_FAILURE, "%s: out of memory", function);
  } catch (const std::exception& error) {
    return fail(EXMAT_FAILURE, "%s: %s", function, error.what());
  } catch (...) {
    return fail(EXMAT_FAILURE, "%s: unknown failure", function);
  }
}

}  // namespace exmat::runtime
