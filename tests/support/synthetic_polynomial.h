#pragma once

#include "common/model/reduced_model.h"

namespace exmat::test {

/// Tensors of the quartic energy from its definition: E_j = L q + Q(q, q) for each element's Green strain, inner
/// products of L and Q in the elasticity tensor. Shares no code with either stage. Costs n_t r^4.
PolynomialData make_polynomial(const CubatureData& cubature);

}  // namespace exmat::test
