#include "runtime/python/objects.h"

namespace exmat::python {
namespace {

/// The class of exmat.errors that a status is raised as.
const char* class_of(exmat_status status) {
  switch (status) {
    case EXMAT_BAD_INPUT:
      return "BadInput";
    case EXMAT_INVALID_ARGUMENT:
      return "InvalidArgument";
    case EXMAT_NON_FINITE:
      return "NonFinite";
    case EXMAT_OK:
    case EXMAT_FAILURE:
      break;
  }
  return "Failure";
}

}  // namespace

void bind_errors() {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& error) {
      const py::object type = py::module_::import("exmat.errors").attr(class_of(error.status()));
      PyErr_SetString(type.ptr(), error.what());
    }
  });
}

}  // namespace exmat::python
