#include "runtime/sim/step/integrator.h"

namespace exmat::runtime {

void backward_euler_form(const StepHistory& history, double time_step, StepForm& form) noexcept {
  form.velocity_factor = 1 / time_step;
  form.acceleration_factor = 1 / (time_step * time_step);
  form.velocity_centre = history.q;
  form.acceleration_centre = history.q + time_step * history.momentum;
}

void bdf2_form(const StepHistory& history, double time_step, StepForm& form) noexcept {
  const double h = 2 * time_step / 3;
  form.velocity_factor = 1 / h;
  form.acceleration_factor = 1 / (h * h);
  form.velocity_centre = (4 * history.q - history.q_previous) / 3;
  form.acceleration_centre = form.velocity_centre + h / 3 * (4 * history.momentum - history.momentum_previous);
}

void newmark_form(const StepHistory& history, const Eigen::VectorXd& acceleration, double time_step,
                  StepForm& form) noexcept {
  form.velocity_factor = 2 / time_step;
  form.acceleration_factor = 4 / (time_step * time_step);
  form.velocity_centre = history.q + time_step / 2 * history.v;
  form.acceleration_centre =
      form.velocity_centre + time_step / 2 * history.momentum + time_step * time_step / 4 * acceleration;
}

}  // namespace exmat::runtime
