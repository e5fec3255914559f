#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace exmat {

enum class MaterialModel { kStVenantKirchhoff, kStableNeoHookean, kCorotational };

/// "stvk", "stable_neo_hookean" or "corotational"; nothing for a name that this version does not know.
std::optional<MaterialModel> material_from_name(std::string_view name);
std::string_view name_of(MaterialModel model);

/// "\"stvk\", \"stable_neo_hookean\" or \"corotational\"", for messages.
std::string material_names();

/// Below this Poisson ratio a material has states of less energy than its rest; all of them end at 0.5. -1 for
/// St.Venant-Kirchhoff and corotational, whose energies are positive definite in their strains down to it.
double least_poisson_ratio(MaterialModel model);

}  // namespace exmat
