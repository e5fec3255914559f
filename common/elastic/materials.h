#pragma once

#include "common/elastic/corotational.h"
#include "common/elastic/material_model.h"
#include "common/elastic/st_venant_kirchhoff.h"
#include "common/elastic/stable_neo_hookean.h"

namespace exmat {

/// work(material) with the struct of the model: chosen once, outside of loops over elements.
template <typename Work>
decltype(auto) with_material(MaterialModel model, Work&& work) {
  switch (model) {
    case MaterialModel::kStableNeoHookean:
      return work(StableNeoHookean{});
    case MaterialModel::kCorotational:
      return work(Corotational{});
    case MaterialModel::kStVenantKirchhoff:
      break;
  }
  return work(StVenantKirchhoff{});
}

}  // namespace exmat
