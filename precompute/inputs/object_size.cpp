#include "precompute/inputs/object_size.h"

#include <fmt/format.h>

#include "common/core/log.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

constexpr double kGravity = 9.81;  // [m/s^2]

}  // namespace

std::string remark_on_size(const TetMesh& mesh, const TetMaterials& materials) {
  const double length = (mesh.vertices.colwise().maxCoeff() - mesh.vertices.colwise().minCoeff()).maxCoeff();
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  const double density = materials.density.dot(volumes) / volumes.sum(),
               modulus = materials.youngs_modulus.dot(volumes) / volumes.sum();
  const double strain = density * kGravity * length / modulus;
  const std::string advice = "are its numbers millimetres? They are read as metres, its material as kg/m^3 and Pa";
  if (strain > 1)
    return fmt::format(
        "the object is {:.3g} m long and too soft to bear its own weight ({:.3g} kg/m^3 x 9.81 m/s^2 x "
        "its length is {:.3g} times its Young's modulus of {:.3g} Pa); {}",
        length, density, strain, modulus, advice);
  if (length > kLargest) return fmt::format("the object is {:.3g} m long; {}", length, advice);
  return {};
}

void warn_of_size(const ObjectInput& object, const std::string& name, std::vector<std::string>& warnings) {
  const std::string remark = remark_on_size(object.mesh, object.materials);
  if (remark.empty()) return;
  warnings.push_back(name + ": " + remark);
  log::warning(warnings.back());
}

}  // namespace exmat::precompute
