#include "runtime/python/objects.h"

// The module exmat._exmat: exmat.hpp for Python. The package beside it says what is for users.

PYBIND11_MODULE(_exmat, module) {
  using namespace exmat::python;  // NOLINT(google-build-using-namespace)
  module.doc() = "The compiled part of exmat. Use the package exmat.";
  module.attr("version") = exmat_version();
  bind_errors();
  bind_model(module);
  bind_reports(module);
  bind_states(module);
  BodyClass body = bind_body(module);
  WorldClass world = bind_world(module);
  BatchClass batch = bind_batch(module);
  bind_obstacles(module, body, world, batch);
  bind_drawing(module, body, world, batch);
  speak_in_words(module);
}
