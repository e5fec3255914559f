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

/// Without the function of C that found the fault, which the user has not called.
std::string text_of(const Error& error) {
  const std::string text = error.what();
  const std::size_t end = text.find(": ");
  return text.starts_with("exmat_") && end != std::string::npos ? text.substr(end + 2) : text;
}

}  // namespace

void bind_errors() {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& error) {
      const py::object type = py::module_::import("exmat.errors").attr(class_of(error.status()));
      PyErr_SetString(type.ptr(), text_of(error).c_str());
    }
  });
}

}  // namespace exmat::python
