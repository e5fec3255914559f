#include <cstdint>
#include <cstdlib>
#include <exception>
#include <new>
#include <string_view>
#include <typeinfo>

#include "common/core/error.h"
#include "exmat/exmat.h"
#include "runtime/api/failures.h"

// The module has no exceptions: what throws leaves it through the host, which throws one of its own with the status and
// the message, and puts the stack pointer back. Nothing in between is destroyed: what a refused call had allocated
// stays allocated. Steps throw nothing.

namespace {

// The Itanium ABI: a class with one base at its beginning.
struct SingleBase {
  const void* vtable;
  const char* name;
  const std::type_info* base;
};

bool has_one_base(const std::type_info& type) {
  return std::string_view(typeid(type).name()) == "N10__cxxabiv120__si_class_type_infoE";
}

bool is_a(const std::type_info* type, const std::type_info& wanted) {
  for (; *type != wanted; type = reinterpret_cast<const SingleBase*>(type)->base)
    if (!has_one_base(*type)) return false;
  return true;
}

}  // namespace

extern "C" {

[[noreturn]] __attribute__((import_module("exmat"), import_name("thrown"))) void exmat_host_thrown(std::int32_t status,
                                                                                                   const char* message);

void* __cxa_allocate_exception(std::size_t size) noexcept { return std::malloc(size); }

void __cxa_free_exception(void* object) noexcept { std::free(object); }

[[noreturn]] void __cxa_throw(void* object, std::type_info* type, void (*)(void*)) {
  const char* const message =
      is_a(type, typeid(std::exception)) ? static_cast<const std::exception*>(object)->what() : "unknown failure";
  const bool is_input = is_a(type, typeid(exmat::InputError));
  const bool is_argument = is_a(type, typeid(exmat::runtime::InvalidArgument));
  exmat_host_thrown(is_input ? EXMAT_BAD_INPUT : is_argument ? EXMAT_INVALID_ARGUMENT : EXMAT_FAILURE, message);
}

// Handlers are left out by the compiler; these are named and never reached.
void* __cxa_begin_catch(void* object) noexcept { return object; }
void __cxa_end_catch() noexcept {}
[[noreturn]] void __cxa_rethrow() { std::abort(); }
}
