#include "common/elastic/material_model.h"

namespace exmat {
namespace {

// Stable neo-Hookean has less energy than at rest when shrunk to 0.6 of its size from -0.88 downwards.
constexpr double kLeastOfStableNeoHookean = -0.8;

}  // namespace

double least_poisson_ratio(MaterialModel model) {
  return model == MaterialModel::kStableNeoHookean ? kLeastOfStableNeoHookean : -1;
}

}  // namespace exmat
