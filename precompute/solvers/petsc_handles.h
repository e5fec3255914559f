#pragma once

// Private to precompute/solvers: PETSc and SLEPc objects that free themselves, and errors as exceptions.

#include <slepceps.h>
#include <string>
#include <utility>

#include "common/core/error.h"
#include "common/mesh/assembly.h"

namespace exmat::precompute {

/// Starts PETSc, once per program.
void start_solvers();

/// PETSc's message on its last error.
std::string& last_petsc_message();

inline void check_petsc(PetscErrorCode code, const char* what) {
  if (code == 0) return;
  const char* text = nullptr;
  PetscErrorMessage(code, &text, nullptr);
  throw WorkError(std::string("PETSc: ") + what + " failed: " + (text != nullptr ? text : "unknown error") + ": " +
                  last_petsc_message());
}

template <typename Object, PetscErrorCode (*destroy)(Object*)>
class Handle {
 public:
  Handle() = default;
  ~Handle() { destroy(&object_); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  Handle(Handle&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }

  Object get() const { return object_; }
  Object* out() { return &object_; }

 private:
  Object object_ = nullptr;
};

using MatHandle = Handle<Mat, MatDestroy>;
using VecHandle = Handle<Vec, VecDestroy>;
using EpsHandle = Handle<EPS, EPSDestroy>;
using KspHandle = Handle<KSP, KSPDestroy>;
using NullSpaceHandle = Handle<MatNullSpace, MatNullSpaceDestroy>;

}  // namespace exmat::precompute
