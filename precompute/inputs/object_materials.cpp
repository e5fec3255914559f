#include "precompute/inputs/object_materials.h"

#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

// The asset's value for every tet of the file, or the file's own.
Eigen::VectorXd base_values(const std::optional<double>& value, const char* name, Eigen::VectorXd TetMaterials::*member,
                            const std::optional<TetMaterials>& file_materials, Eigen::Index tets,
                            const AssetConfig& asset) {
  if (value) return Eigen::VectorXd::Constant(tets, *value);
  if (!file_materials)
    throw InputError({asset.file.string(), "/object/material/" + std::string(name), "a value",
                      "none here, and no material for every tet in " + asset.object_mesh.string(),
                      "give it in the asset"});
  return (*file_materials).*member;
}

void set(const std::optional<double>& value, const std::vector<std::int32_t>& tets, Eigen::VectorXd& values) {
  if (value) values(tets).setConstant(*value);
}

void require_poisson_ratios(const TetMaterials& materials, const AssetConfig& asset) {
  const double least = least_poisson_ratio(materials.model);
  for (Eigen::Index t = 0; t < materials.poisson_ratio.size(); ++t) {
    const double ratio = materials.poisson_ratio[t];
    if (ratio > least && ratio >= kLeastPoissonRatio && ratio <= kMostPoissonRatio) continue;
    throw InputError({asset.file.string(), "/object/material/poisson_ratio",
                      fmt::format("Poisson ratios {} and at most {} for {}",
                                  least < kLeastPoissonRatio ? fmt::format("of at least {}", kLeastPoissonRatio)
                                                             : fmt::format("above {}", least),
                                  kMostPoissonRatio, name_of(materials.model)),
                      fmt::format("{} in tet {}", ratio, t), "change it, or take another model"});
  }
}

}  // namespace

TetMaterials object_materials(const AssetConfig& asset, const TetMesh& file_mesh, const TetSets& sets,
                              const std::optional<TetMaterials>& file_materials,
                              const std::vector<std::int32_t>& kept_tets, InputFiles& files) {
  const auto base = [&](const std::optional<double>& value, const char* name, Eigen::VectorXd TetMaterials::*member) {
    return base_values(value, name, member, file_materials, file_mesh.tet_count(), asset);
  };
  TetMaterials materials{base(asset.material.density, "density", &TetMaterials::density),
                         base(asset.material.youngs_modulus, "youngs_modulus", &TetMaterials::youngs_modulus),
                         base(asset.material.poisson_ratio, "poisson_ratio", &TetMaterials::poisson_ratio),
                         asset.material.model,
                         asset.formulation,
                         asset.formulation == Formulation::kSmoothed ? kVarianceFactor : 0};
  for (const MaterialRegionConfig& region : asset.material_regions) {
    const auto tets = select_tets(file_mesh, sets, region.tets, asset.file.string());
    if (const auto* file = std::get_if<FileSelection>(&region.tets)) files.push_back(file->file);
    set(region.density, tets, materials.density);
    set(region.youngs_modulus, tets, materials.youngs_modulus);
    set(region.poisson_ratio, tets, materials.poisson_ratio);
  }
  for (const auto member : {&TetMaterials::density, &TetMaterials::youngs_modulus, &TetMaterials::poisson_ratio})
    materials.*member = Eigen::VectorXd((materials.*member)(kept_tets));
  require_poisson_ratios(materials, asset);
  return materials;
}

}  // namespace exmat::precompute
