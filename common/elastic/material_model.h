#pragma once

#include "common/core/names.h"

namespace exmat {

enum class MaterialModel { kStVenantKirchhoff, kStableNeoHookean, kCorotational };

template <>
inline constexpr std::array<std::string_view, 3> kNames<MaterialModel>{"stvk", "stable_neo_hookean", "corotational"};

/// Below this Poisson ratio a material has states of less energy than its rest; all of them end at 0.5. -1 for
/// St.Venant-Kirchhoff and corotational, whose energies are positive definite in their strains down to it.
double least_poisson_ratio(MaterialModel model);

/// Poisson ratios of an object, bounds included, as schemas/asset.json has them: nearer to -1 and 0.5 stiffnesses
/// against shear and against compression are so far apart that modes are not found.
inline constexpr double kLeastPoissonRatio = -0.999, kMostPoissonRatio = 0.49999;

}  // namespace exmat
