#pragma once

#include <cstdint>

#include "common/mesh/tet_mesh.h"
#include "common/model/reduced_model.h"

namespace exmat::precompute {

/// Most modes r of a polynomial. It has r^4 / 8 numbers: 0.7 GB at this limit.
inline constexpr Eigen::Index kMostPolynomialModes = 160;

/// Throws InputError, with the memory, where `modes` > kMostPolynomialModes.
void require_polynomial_modes(Eigen::Index modes);

/// The reduced energy of St.Venant-Kirchhoff over all elements of the mesh as its derivatives at rest. `basis` is U,
/// 3n x r. Exact to rounding; the same for every number of threads. Barbic and James 2005, section 4; time as
/// polynomial_flops, memory as polynomial_bytes and about 64 MB. Throws as require_polynomial_modes.
PolynomialData reduced_polynomial(const TetMesh& mesh, const TetMaterials& materials, const RowMatrix& basis);

/// Floating-point operations that reduced_polynomial takes, to about 30 percent.
double polynomial_flops(Eigen::Index modes, Eigen::Index elements);

/// Bytes of PolynomialData, which is also what the run time holds.
std::int64_t polynomial_bytes(Eigen::Index modes);

}  // namespace exmat::precompute
