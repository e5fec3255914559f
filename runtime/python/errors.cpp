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

/// Calls a function as pybind11 does, and says in Python's words where it has no such arguments.
PyCFunctionWithKeywords call = nullptr;
PyObject* call_in_words(PyObject* self, PyObject* arguments, PyObject* named) {
  PyObject* const result = call(self, arguments, named);
  if (result != nullptr || PyErr_ExceptionMatches(PyExc_TypeError) == 0) return result;
  try {
    const py::error_already_set thrown;
    const py::object words = py::module_::import("exmat.errors").attr("in_words")(py::str(thrown.value()));
    PyErr_SetObject(PyExc_TypeError, words.ptr());
  } catch (py::error_already_set& other) {
    other.restore();
  }
  return nullptr;
}

/// In place of a constructor where a class has none.
int refuse_call(PyObject* self, PyObject* /*arguments*/, PyObject* /*named*/) {
  try {
    const auto name = py::type::of(py::handle(self)).attr("__name__");
    const py::object words = py::module_::import("exmat.errors").attr("without_constructor")(name);
    PyErr_SetObject(PyExc_TypeError, words.ptr());
  } catch (py::error_already_set& other) {
    other.restore();
  }
  return -1;
}

/// `value` may be a function of pybind11, which is alone in having a capsule for its self, or hold one.
void speak(const py::object& value) {
  const py::object function = py::getattr(value, "__func__", value);
  if (PyCFunction_Check(function.ptr()) == 0) return;
  PyMethodDef* const method = reinterpret_cast<PyCFunctionObject*>(function.ptr())->m_ml;
  const auto present = reinterpret_cast<PyCFunctionWithKeywords>(reinterpret_cast<void (*)()>(method->ml_meth));
  if (PyCapsule_CheckExact(PyCFunction_GET_SELF(function.ptr())) == 0 || present == call_in_words) return;
  call = present;
  method->ml_meth = reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(call_in_words));
}

}  // namespace

void speak_in_words(const py::handle& scope) {
  if (PyType_Check(scope.ptr()) != 0) {
    initproc& make = reinterpret_cast<PyTypeObject*>(scope.ptr())->tp_init;
    if (make == py::detail::pybind11_object_init) make = refuse_call;
  }
  for (const auto& [name, value] : py::dict(scope.attr("__dict__"))) {
    if (PyObject_IsInstance(value.ptr(), reinterpret_cast<PyObject*>(&PyProperty_Type)) == 1) {
      for (const char* part : {"fget", "fset"}) speak(value.attr(part));
    } else if (PyType_Check(value.ptr()) != 0 && scope.ptr() != value.ptr()) {
      speak_in_words(value);
    } else {
      speak(py::reinterpret_borrow<py::object>(value));
    }
  }
}

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
