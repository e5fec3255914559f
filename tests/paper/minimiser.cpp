#include "tests/paper/minimiser.h"

#include <algorithm>
#include <exception>
#include <petsctao.h>

#include "precompute/solvers/petsc_handles.h"

namespace exmat::precompute {
namespace {

using TaoHandle = Handle<Tao, TaoDestroy>;

struct Context {
  const SmoothFunction& function;
  Eigen::VectorXd point, gradient;
  std::exception_ptr thrown;  // kept until PETSc has returned
};

PetscErrorCode evaluate(Tao, Vec x, PetscReal* value, Vec gradient, void* data) {
  auto& context = *static_cast<Context*>(data);
  const PetscScalar* input = nullptr;
  PetscScalar* output = nullptr;
  PetscErrorCode code = VecGetArrayRead(x, &input);
  if (code != 0) return code;
  std::copy(input, input + context.point.size(), context.point.data());
  code = VecRestoreArrayRead(x, &input);
  if (code != 0) return code;
  try {
    *value = context.function(context.point, context.gradient);
  } catch (...) {
    context.thrown = std::current_exception();
    return PETSC_ERR_USER;
  }
  code = VecGetArrayWrite(gradient, &output);
  if (code != 0) return code;
  std::copy(context.gradient.data(), context.gradient.data() + context.gradient.size(), output);
  return VecRestoreArrayWrite(gradient, &output);
}

MinimiserReport report_of(Tao tao) {
  MinimiserReport report;
  PetscInt iterations = 0, evaluations = 0;
  PetscReal violation = 0, step = 0;
  TaoConvergedReason reason = TAO_CONTINUE_ITERATING;
  check_petsc(TaoGetSolutionStatus(tao, &iterations, &report.value, &report.gradient_norm, &violation, &step, &reason),
              "status of the minimiser");
  check_petsc(TaoGetCurrentFunctionEvaluations(tao, &evaluations), "status of the minimiser");
  report.converged = reason > 0;
  report.iterations = static_cast<int>(iterations);
  report.evaluations = static_cast<int>(evaluations);
  return report;
}

}  // namespace

MinimiserReport minimise(const SmoothFunction& function, const MinimiserSettings& settings, Eigen::VectorXd& x) {
  start_solvers();
  Context context{function, x, Eigen::VectorXd::Zero(x.size()), nullptr};
  TaoHandle tao;
  VecHandle solution;
  check_petsc(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, static_cast<PetscInt>(x.size()), x.data(), solution.out()),
              "vector");
  check_petsc(TaoCreate(PETSC_COMM_SELF, tao.out()), "minimiser");
  check_petsc(TaoSetType(tao.get(), TAOLMVM), "minimiser type");
  check_petsc(TaoSetObjectiveAndGradient(tao.get(), nullptr, evaluate, &context), "function");
  check_petsc(TaoSetTolerances(tao.get(), settings.gradient_tolerance, 0, 0), "tolerance");
  check_petsc(TaoSetMaximumIterations(tao.get(), settings.max_iterations), "iteration limit");
  check_petsc(TaoSetSolution(tao.get(), solution.get()), "start");
  const PetscErrorCode code = TaoSolve(tao.get());
  if (context.thrown) std::rethrow_exception(context.thrown);
  check_petsc(code, "minimisation");
  return report_of(tao.get());
}

}  // namespace exmat::precompute
