#include "runtime/scene/step_work.h"

#include <algorithm>

namespace exmat::runtime {
namespace {

/// Evaluations of the force: at the first iterate, once an iteration, and in line searches.
double evaluations(const StepReport& report) { return 1 + report.newton_iterations + report.line_search_evaluations; }

double square(Eigen::Index size) { return static_cast<double>(size * size); }

double doubles(double count) { return sizeof(double) * count; }

double internal_force_bytes(const InternalForce& force, const StepReport& report) {
  if (force.polynomial()) return evaluations(report) * force.bytes();
  return evaluations(report) * force.cubature().potential().force_bytes() +
         std::max(1, report.factorisations) * force.cubature().potential().stiffness_bytes();
}

/// The sum over the control points, of terms of one and two examples over those of all terms.
void add_table(const TargetTable& table, StepWork& work) {
  const double numbers = static_cast<double>(table.piece_rows() * table.modes());
  work.target_flops += 2 * numbers;
  work.bytes += doubles(numbers);
}

void add_solver(const TargetSolver& solver, int iterations, StepWork& work) {
  if (iterations == 0) return;
  work.target_flops += target_flops(solver, iterations);
  const auto gradient = static_cast<double>(9 * solver.elements() * solver.dimension());
  work.bytes += doubles((2 + iterations) * gradient);
}

/// Adds the work of one example force.
void add_examples(const ExampleModel& examples, int target_iterations, StepWork& work) {
  const Eigen::Index modes = examples.filter.rows(), count = examples.weights.examples();
  const auto numbers = static_cast<double>(count * (modes + count));  // load, and the slopes of one turn
  work.weights_flops += 2 * numbers;
  work.bytes += doubles(numbers);
  if (examples.table)
    add_table(*examples.table, work);
  else
    add_solver(*examples.target, target_iterations, work);
  work.other_flops += 2 * square(modes);
  work.bytes += doubles(2 * square(modes));
}

/// The report counts the iterations of all targets together: each that is solved for is taken to need as many.
void add_examples(const Model& model, const StepScene& scene, const StepReport& report, StepWork& work) {
  int solved = 0;
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    if (acts(scene.examples[i]) && model.examples[i].target) ++solved;
  for (std::size_t i = 0; i < scene.examples.size(); ++i)
    if (acts(scene.examples[i])) add_examples(model.examples[i], report.target_iterations / std::max(1, solved), work);
}

}  // namespace

StepWork& StepWork::operator+=(const StepWork& more) {
  weights_flops += more.weights_flops;
  target_flops += more.target_flops;
  other_flops += more.other_flops;
  bytes += more.bytes;
  return *this;
}

/// One stiffness and one factorisation, whatever the number of iterations; force and solve in each of them.
double target_flops(const TargetSolver& solver, int iterations) {
  const auto d = static_cast<double>(solver.dimension());
  const ElementPotential& elements = solver.potential();
  return (1 + iterations) * elements.force_flops() + elements.stiffness_flops() + d * d * d / 3 +
         iterations * 2 * d * d;
}

StepWork step_work(const Model& model, const StepScene& scene, const StepReport& report) {
  StepWork work;
  const double matrix = square(model.modes());
  const double damping = scene.stiffness_damping > 0 ? 1 : 0;
  work.other_flops = (evaluations(report) + damping) * 2 * matrix;
  work.bytes = internal_force_bytes(model.internal_force, report) +
               doubles((evaluations(report) + damping + 2 * report.factorisations + report.newton_iterations) * matrix);
  add_examples(model, scene, report, work);
  return work;
}

}  // namespace exmat::runtime
