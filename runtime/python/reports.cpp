#include <algorithm>
#include <array>
#include <pybind11/stl.h>

#include "runtime/python/objects.h"

// Reports of the library, as Python reads them.

namespace exmat::python {
namespace {

using Vector3 = std::array<double, 3>;

void bind_report(py::module_& module) {
  py::class_<exmat_report>(module, "Report", "What the steps of one call did: sums, unless said otherwise.")
      .def_readonly("steps", &exmat_report::steps, "Steps taken.")
      .def_readonly("status", &exmat_report::status,
                    "Bits of all steps: 1 non-finite, 2 iteration limit, 4 stagnated, 8 target not converged, 16 "
                    "subnormal numbers set to zero and 32 asleep, which are no faults.")
      .def_readonly("newton_iterations", &exmat_report::newton_iterations, "Newton iterations.")
      .def_readonly("factorisations", &exmat_report::factorisations, "Factorisations of the Hessian.")
      .def_readonly("line_search_evaluations", &exmat_report::line_search_evaluations, "Of line searches.")
      .def_readonly("projections", &exmat_report::projections, "Hessians that were made positive definite.")
      .def_readonly("target_iterations", &exmat_report::target_iterations, "Newton iterations towards targets.")
      .def_readonly("residual", &exmat_report::residual,
                    "Of the equation of motion at the end of the last step [kg^(1/2) m/s^2].")
      .def_readonly("seconds", &exmat_report::seconds, "Wall clock [s].")
      .def_readonly(
          "lost_applied", &exmat_report::lost_applied,
          "Share of the work of applied forces that the modes lose, of a body with a Capacity; else negative.")
      .def_readonly("lost_contact", &exmat_report::lost_contact, "The same of contact forces.")
      .def("__repr__", [](const exmat_report& report) {
        return py::str("Report(steps={}, status={}, newton_iterations={}, residual={:.3g}, seconds={:.3g})")
            .format(report.steps, report.status, report.newton_iterations, report.residual, report.seconds);
      });
}

void bind_energies(py::module_& module) {
  py::class_<exmat_energies>(module, "Energies", "Of the last step [J].")
      .def_readonly("kinetic", &exmat_energies::kinetic, "Of the body in the world [J].")
      .def_readonly("elastic", &exmat_energies::elastic, "[J].")
      .def_readonly("potential", &exmat_energies::potential, "Of gravity, 0 at rest [J].")
      .def_readonly("contact", &exmat_energies::contact, "Of a world: the springs between its bodies [J].")
      .def_property_readonly(
          "total", [](const exmat_energies& now) { return now.kinetic + now.elastic + now.potential + now.contact; },
          "Their sum [J].")
      .def("__repr__", [](const exmat_energies& now) {
        return py::str("Energies(kinetic={:.6g}, elastic={:.6g}, potential={:.6g}, contact={:.6g})")
            .format(now.kinetic, now.elastic, now.potential, now.contact);
      });
}

exmat_motion make_motion(const Vector3& position, const std::array<double, 4>& orientation, const Vector3& linear,
                         const Vector3& angular) {
  exmat_motion motion{};
  std::ranges::copy(position, motion.position);
  std::ranges::copy(orientation, motion.orientation);
  std::ranges::copy(linear, motion.linear_velocity);
  std::ranges::copy(angular, motion.angular_velocity);
  return motion;
}

void bind_motion(py::module_& module) {
  py::class_<exmat_motion>(
      module, "Motion", "How a body moves as a whole, or the frame of an obstacle, world frame. Its arrays are copies.")
      .def(py::init(&make_motion), py::kw_only(), py::arg("position") = Vector3{},
           py::arg("orientation") = std::array<double, 4>{1, 0, 0, 0}, py::arg("linear_velocity") = Vector3{},
           py::arg("angular_velocity") = Vector3{}, "Shapes (3,), (4,), (3,), (3,), as the properties.")
      .def_property_readonly(
          "position", [](const exmat_motion& motion) { return array_of(motion.position, 3); },
          "Displacement of the centre of mass from rest, or place of the frame, shape (3,) [m].")
      .def_property_readonly(
          "orientation", [](const exmat_motion& motion) { return array_of(motion.orientation, 4); },
          "Unit quaternion, w first, shape (4,).")
      .def_property_readonly(
          "linear_velocity", [](const exmat_motion& motion) { return array_of(motion.linear_velocity, 3); },
          "Of the centre of mass, or of the frame's origin, shape (3,) [m/s].")
      .def_property_readonly(
          "angular_velocity", [](const exmat_motion& motion) { return array_of(motion.angular_velocity, 3); },
          "Shape (3,) [rad/s].");
}

void bind_world_report(py::module_& module) {
  py::class_<exmat_world_report>(module, "WorldReport", "What the steps of one call of a world did.")
      .def_readonly("steps", &exmat_world_report::steps, "Steps taken.")
      .def_readonly("newton_iterations", &exmat_world_report::newton_iterations,
                    "Of the island of most, summed over the steps.")
      .def_readonly("unconverged_islands", &exmat_world_report::unconverged_islands,
                    "Bodies that touch and were not solved to the tolerance, in all steps.")
      .def_readonly("pairs", &exmat_world_report::pairs, "Of bodies whose bounds overlapped in the last step.")
      .def_readonly("touching_pairs", &exmat_world_report::touching_pairs,
                    "Of those, with vertices that could touch in the last step.")
      .def_readonly("islands", &exmat_world_report::islands,
                    "Bodies that touch and were solved together in the last step.")
      .def_readonly("largest_island", &exmat_world_report::largest_island, "Most bodies of an island in any step.")
      .def_readonly("seconds", &exmat_world_report::seconds, "Wall clock [s].")
      .def_readonly("asleep", &exmat_world_report::asleep, "Bodies that slept through the last step.")
      .def_readonly("divided_islands", &exmat_world_report::divided_islands,
                    "Bodies that touch and took several smaller steps, in all steps.")
      .def("__repr__", [](const exmat_world_report& report) {
        return py::str("WorldReport(steps={}, newton_iterations={}, touching_pairs={}, islands={}, seconds={:.3g})")
            .format(report.steps, report.newton_iterations, report.touching_pairs, report.islands, report.seconds);
      });
}

void bind_contact_law(py::module_& module) {
  py::class_<exmat_contact_law>(module, "ContactLaw", "How bodies of a world touch, per area of their surfaces.")
      .def_readonly("stiffness", &exmat_contact_law::stiffness, "Pressure per depth [N/m^3].")
      .def_readonly("damping", &exmat_contact_law::damping, "Pressure per approach velocity [N s/m^3].")
      .def_readonly("friction", &exmat_contact_law::friction, "Coulomb's coefficient.")
      .def_readonly("release", &exmat_contact_law::release, "How fast what overlaps at the start is let out [m/s].")
      .def_property_readonly(
          "self_contact", [](const exmat_contact_law& law) { return law.self == 1; },
          "Whether bodies touch themselves, too.")
      .def("__repr__", [](const exmat_contact_law& law) {
        return py::str("ContactLaw(stiffness={:g}, damping={:g}, friction={:g}, self_contact={})")
            .format(law.stiffness, law.damping, law.friction, law.self == 1);
      });
}

}  // namespace

void bind_reports(py::module_& module) {
  bind_report(module);
  bind_world_report(module);
  bind_energies(module);
  bind_motion(module);
  bind_contact_law(module);
}

}  // namespace exmat::python
