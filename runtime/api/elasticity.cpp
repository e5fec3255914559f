#include <algorithm>
#include <cinttypes>
#include <mutex>

#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/handles.h"
#include "runtime/api/reading.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

exmat_status exmat_model_read_elasticity(const exmat_model* model, const double* q, std::int64_t modes, double* energy,
                                         double* force, double* tangent) noexcept {
  EXMAT_REQUIRE(model);
  EXMAT_REQUIRE(q);
  const InternalForce& elasticity = model->model().internal_force;
  EXMAT_REQUIRE_LENGTH(modes, elasticity.modes());
  if (const double* const far = find_far(q, modes))
    return fail(EXMAT_INVALID_ARGUMENT, "%s: q: %g: expected finite numbers of at most %g", __func__, *far, kFarthest);
  return guarded(__func__, [&] {
    InternalForce::Workspace workspace = elasticity.make_workspace();
    const Eigen::VectorXd at = Eigen::Map<const Eigen::VectorXd>(q, modes);
    Eigen::VectorXd gradient(modes);
    Eigen::MatrixXd hessian(modes, modes);
    const double value = tangent != nullptr ? elasticity.force_and_stiffness(at, workspace, gradient, hessian)
                                            : elasticity.force(at, workspace, gradient);
    if (energy != nullptr) *energy = value;
    if (force != nullptr) std::copy_n(gradient.data(), modes, force);
    if (tangent != nullptr)
      Eigen::Map<Eigen::MatrixXd>(tangent, modes, modes) = hessian.selfadjointView<Eigen::Lower>();
  });
}

exmat_status exmat_matrix_create(const exmat_model* model, std::int32_t kind, exmat_matrix** matrix) noexcept {
  EXMAT_REQUIRE(matrix);
  *matrix = nullptr;
  EXMAT_REQUIRE(model);
  if (kind != EXMAT_MASS && kind != EXMAT_STIFFNESS)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: kind = %" PRId32 ": expected 0 or 1", __func__, kind);
  return guarded(__func__, [&] {
    const ReducedModel data = [&] {
      const std::lock_guard lock(reading());
      return read_groups(*model->source, {"object"});
    }();
    const ObjectData& object = *data.object;
    *matrix = new exmat_matrix{kind == EXMAT_STIFFNESS
                                   ? elastic_stiffness(object.mesh, object.materials)
                                   : expand_to_vectors(scalar_mass(object.mesh, object.materials.density))};
  });
}

void exmat_matrix_destroy(exmat_matrix* matrix) noexcept { delete matrix; }

std::int64_t exmat_matrix_entries(const exmat_matrix* matrix) noexcept {
  return matrix != nullptr ? matrix->entries.nonZeros() : -1;
}

exmat_status exmat_matrix_read(const exmat_matrix* matrix, std::int64_t* starts, std::int64_t* columns, double* values,
                               std::int64_t entries) noexcept {
  EXMAT_REQUIRE(matrix);
  EXMAT_REQUIRE(starts);
  EXMAT_REQUIRE(columns);
  EXMAT_REQUIRE(values);
  const SparseMatrix& from = matrix->entries;
  EXMAT_REQUIRE_LENGTH(entries, from.nonZeros());
  std::copy_n(from.outerIndexPtr(), from.rows() + 1, starts);
  std::copy_n(from.innerIndexPtr(), entries, columns);
  std::copy_n(from.valuePtr(), entries, values);
  return EXMAT_OK;
}
