#include <array>
#include <pybind11/stl.h>

#include "runtime/python/objects.h"

namespace exmat::python {
namespace {

using Shared = std::shared_ptr<BodyObject>;

