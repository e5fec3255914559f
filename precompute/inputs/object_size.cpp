#include "precompute/inputs/object_size.h"

#include <fmt/format.h>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/number_limits.h"
#include "common/mesh/geometry.h"

namespace exmat::precompute {
namespace {

constexpr double kUsualGravity = 9.81;  // [m/s^2]
constexpr double kSoftest = 1e12;       // weight of a column as high as the body is long over Young's modulus, at most

}  // namespace

std::string remark_on_size(const TetMesh& mesh, const TetMaterials& materials) {
  const double length = longest_box_edge(mesh.vertices);
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  const double density = materials.density.dot(volumes) / volumes.sum(),
               modulus = materials.youngs_modulus.dot(volumes) / volumes.sum();
  const double strain = density * kUsualGravity * length / modulus;
  const std::string advice =
      "are its numbers millimetres or centimetres? Then say so by object.unit of the asset, \"mm\" or \"cm\" "
      "(--write-asset FILE writes the asset of a surface); they are read as metres, its material as kg/m^3 and Pa";
  if (strain > 1)
    return fmt::format(
        "the object is {:.3g} m long and too soft to bear its own weight ({:.3g} kg/m^3 x 9.81 m/s^2 x "
        "its length is {:.3g} times its Young's modulus of {:.3g} Pa); {}",
        length, density, strain, modulus, advice);
  if (length > kLargest) return fmt::format("the object is {:.3g} m long; {}", length, advice);
  if (length < kSmallest)
    return fmt::format(
        "the object is {:.3g} m long; is that its size in metres? If not, mend object.unit or object.scale of the "
        "asset (--write-asset FILE writes the asset of a surface)",
        length);
  const double far = mesh.vertices.cwiseAbs().maxCoeff();
  if (const double gap = lost_detail(far, length); gap > 0)
    return fmt::format(
        "the object is {:.3g} m long and up to {:.3g} m from the origin, where numbers of 16 digits are {:.1g} m "
        "apart: finer detail is lost; move it to the origin, and place bodies by their scene",
        length, far, gap);
  return {};
}

void require_numbers(const TetMesh& mesh, const TetMaterials& materials, const std::string& file) {
  const double length = longest_box_edge(mesh.vertices);
  const auto require = [&](const char* member, const Eigen::VectorXd& values, double factor, const char* product) {
    for (const double value : {values.minCoeff(), values.maxCoeff()}) {
      if (value * factor >= 1e-60 && value * factor <= 1e60) continue;
      throw InputError({file, std::string("/object/material/") + member,
                        fmt::format("a number whose {} is from 1e-60 to 1e60", product),
                        fmt::format("{:g} of a body {:.3g} m long", value, length), "mend the number or its unit"});
    }
  };
  require("density", materials.density, length * length * length, "product with the cube of the length");
  require("youngs_modulus", materials.youngs_modulus, length, "product with the length");
  const double weight = materials.density.maxCoeff() * kUsualGravity * length,
               softest = materials.youngs_modulus.minCoeff();
  if (softest * kSoftest < weight)
    throw InputError(
        {file, "/object/material/youngs_modulus",
         fmt::format("at least {:.2g} Pa, {:g} of density x 9.81 m/s^2 x length, below which modes are not found",
                     weight / kSoftest, 1 / kSoftest),
         fmt::format("{:g} of a body {:.3g} m long", softest, length), "mend the number or its unit"});
}

void warn_of_size(const ObjectInput& object, const std::string& name, std::vector<std::string>& warnings) {
  const std::string remark = remark_on_size(object.mesh, object.materials);
  if (remark.empty()) return;
  warnings.push_back(name + ": " + remark);
  log::warning(warnings.back());
}

}  // namespace exmat::precompute
