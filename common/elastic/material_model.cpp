#include "common/elastic/material_model.h"

#include <array>

namespace exmat {
namespace {

struct Entry {
  MaterialModel model;
  std::string_view name;
};

constexpr std::array<Entry, 3> kEntries{{{MaterialModel::kStVenantKirchhoff, "stvk"},
                                         {MaterialModel::kStableNeoHookean, "stable_neo_hookean"},
                                         {MaterialModel::kCorotational, "corotational"}}};

// Stable neo-Hookean has less energy than at rest when shrunk to 0.6 of its size from -0.88 downwards.
constexpr double kLeastOfStableNeoHookean = -0.8;

}  // namespace

std::optional<MaterialModel> material_from_name(std::string_view name) {
  for (const Entry& entry : kEntries)
    if (entry.name == name) return entry.model;
  return std::nullopt;
}

std::string_view name_of(MaterialModel model) {
  for (const Entry& entry : kEntries)
    if (entry.model == model) return entry.name;
  return "";
}

std::string material_names() {
  std::string text;
  for (std::size_t i = 0; i < kEntries.size(); ++i) {
    if (i > 0) text += i + 1 < kEntries.size() ? ", " : " or ";
    text.append("\"").append(kEntries[i].name).append("\"");
  }
  return text;
}

double least_poisson_ratio(MaterialModel model) {
  return model == MaterialModel::kStableNeoHookean ? kLeastOfStableNeoHookean : -1;
}

}  // namespace exmat
