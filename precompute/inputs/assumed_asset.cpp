#include "precompute/inputs/assumed_asset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <string>
#include <string_view>

#include "common/core/error.h"
#include "precompute/mesh_io/surface_file.h"
#include "precompute/meshing/cage.h"

namespace exmat::precompute {
namespace {

constexpr std::array<std::string_view, 5> kExtensions = {".glb", ".gltf", ".obj", ".ply", ".stl"};
constexpr double kDensity = 1000, kGravity = 9.81;  // [kg/m^3], [m/s^2]
constexpr const char* kClamp = "_FIXED";

// With two digits: what is assumed is no measurement.
double rounded(double value) {
  const double unit = std::pow(10, std::floor(std::log10(value)) - 1);
  return std::round(value / unit) * unit;
}

double assumed_modulus(const VertexArray& vertices, const std::filesystem::path& file) {
  const double length = (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).maxCoeff();
  const double modulus = kBorneHeights * kDensity * kGravity * length;
  if (!std::isnormal(modulus) || !std::isnormal(length * length * length))
    throw InputError(
        {file.string(), "vertices", "a surface that has an extent [m]", fmt::format("one {:.3g} m long", length), ""});
  return rounded(modulus);
}

}  // namespace

bool is_surface_file(const std::filesystem::path& file) {
  return std::ranges::find(kExtensions, file.extension().string()) != kExtensions.end();
}

Json assumed_asset(const std::filesystem::path& surface, const std::filesystem::path& folder) {
  const SurfaceFile file = read_surface_file(surface);
  const auto here = std::filesystem::current_path();  // absolute() refuses an empty path
  const auto path = (here / surface).lexically_normal().lexically_proximate((here / folder).lexically_normal());
  Json asset = {{"name", surface.stem().string().substr(0, 64)},
                {"object",
                 {{"surface", path.string()},
                  {"cells", kDefaultCells},
                  {"material",
                   {{"model", "stable_neo_hookean"},
                    {"youngs_modulus", assumed_modulus(file.mesh.vertices, surface)},
                    {"poisson_ratio", 0.4},
                    {"density", kDensity}}}}},
                {"shape_space", {{"eigenfunctions", 20}}},
                {"basis", {{"size", 30}}},
                {"cubature", {{"elements", 60}}},
                {"seed", 1}};
  if (file.parts.contains(kClamp)) asset["object"]["fixed"] = {{"part", kClamp}};
  Json examples = Json::array();
  for (const MorphTarget& morph : file.morphs) examples.push_back({{"name", morph.name}, {"morph", morph.name}});
  if (!examples.empty()) asset["examples"] = examples;
  return asset;
}

}  // namespace exmat::precompute
