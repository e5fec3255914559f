#include "precompute/inputs/assumed_asset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <set>
#include <string>
#include <string_view>

#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/geometry.h"
#include "precompute/mesh_io/surface_file.h"
#include "precompute/meshing/cage.h"

namespace exmat::precompute {
namespace {

constexpr double kDensity = 1000, kGravity = 9.81;  // [kg/m^3], [m/s^2]
constexpr double kLostByClamp = 0.02;               // share of a pose that a clamp may lose by standing still
constexpr std::array<const char*, 2> kClamps{"_FIXED", "_PINNED"};
constexpr std::size_t kLongestName = 64, kMostExamples = 64;  // of schemas/asset.json

// With two digits: what is assumed is no measurement.
double rounded(double value) {
  const double unit = std::pow(10, std::floor(std::log10(value)) - 1);
  return std::round(value / unit) * unit;
}

double assumed_modulus(const VertexArray& vertices, const std::filesystem::path& file) {
  const double length = longest_box_edge(vertices);
  const double modulus = kBorneHeights * kDensity * kGravity * length;
  if (!std::isnormal(modulus) || !std::isnormal(length * length * length))
    throw InputError(
        {file.string(), "vertices", "a surface that has an extent [m]", fmt::format("one {:.3g} m long", length), ""});
  return rounded(modulus);
}

// As many bytes at most, cut between characters of UTF-8.
std::string cut(const std::string& text, std::size_t bytes) {
  if (text.size() <= bytes) return text;
  while (bytes > 0 && (static_cast<unsigned char>(text[bytes]) & 0xc0U) == 0x80U) --bytes;
  return text.substr(0, bytes);
}

// True if all vertices go the same way, but for what a file's digits leave: no pose of a free body.
bool is_shift(const VertexArray& rest, const VertexArray& posed) {
  const VertexArray moves = posed - rest;
  const double differ = (moves.colwise().maxCoeff() - moves.colwise().minCoeff()).maxCoeff();
  return differ <= 1e-5 * bounding_box_diagonal(rest);
}

// True if a clamp that stands still loses much of a pose, which is placed by the mean of what it does there.
bool moves_clamp(const VertexArray& rest, const VertexArray& posed, const FlagVector& fixed) {
  std::vector<Eigen::Index> clamp;
  for (Eigen::Index v = 0; v < fixed.size(); ++v)
    if (fixed[v] != 0) clamp.push_back(v);
  if (clamp.empty()) return false;
  const VertexArray moves = posed - rest;
  const Eigen::RowVector3d mean = moves(clamp, Eigen::all).colwise().mean();
  const VertexArray placed = moves.rowwise() - mean;
  return placed(clamp, Eigen::all).norm() > kLostByClamp * placed.norm();
}

}  // namespace

std::vector<std::string> example_names(const std::vector<std::string>& morphs) {
  constexpr std::array<std::string_view, 5> kReserved{".", "..", "gram", "h0", "hq"};
  std::set<std::string> taken(morphs.begin(), morphs.end());  // a safe name goes to the target that has it
  std::vector<std::string> names;
  for (const std::string& morph : morphs) {
    std::string name = morph;
    for (char& c : name)
      if (c == '/' || static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '_';
    name = cut(name, kLongestName);
    if (std::ranges::find(kReserved, name) != kReserved.end()) name += '_';
    if (name == morph && std::ranges::find(names, name) == names.end()) {
      names.push_back(name);
      continue;
    }
    const std::string stem = cut(name, kLongestName - 6);
    for (int number = 2; taken.contains(name); ++number) name = fmt::format("{} {}", stem, number);
    taken.insert(name);
    names.push_back(name);
  }
  return names;
}

Json assumed_asset(const std::filesystem::path& surface, const std::filesystem::path& folder) {
  const SurfaceFile file = read_surface_file(surface);
  const auto here = current_folder();  // absolute() refuses an empty path
  const auto path = (here / surface).lexically_normal().lexically_proximate((here / folder).lexically_normal());
  Json asset = {{"name", cut(surface.stem().string(), kLongestName)},
                {"object",
                 {{"surface", path.string()},
                  {"cells", kDefaultCells},
                  {"material",
                   {{"model", "stable_neo_hookean"},
                    {"youngs_modulus", assumed_modulus(file.mesh.vertices, surface)},
                    {"poisson_ratio", 0.4},
                    {"density", kDensity}}}}},
                {"shape_space", {{"tolerance", 0.02}}},
                {"seed", 1}};
  const FlagVector* fixed = nullptr;
  for (const char* clamp : kClamps) {
    const auto part = file.parts.find(clamp);
    if (part == file.parts.end()) continue;
    asset["object"]["fixed"] = {{"part", clamp}};
    fixed = &part->second;
  }
  Json examples = Json::array();
  std::vector<std::string> morphs;
  bool follows = false;
  for (const MorphTarget& morph : file.morphs) {
    follows = follows || (fixed != nullptr && moves_clamp(file.mesh.vertices, morph.positions, *fixed));
    if (asset["object"].contains("fixed") || !is_shift(file.mesh.vertices, morph.positions))
      morphs.push_back(morph.name);
    else
      log::info(fmt::format("the morph target \"{}\" moves the body as a whole and is left out", morph.name));
  }
  if (morphs.size() > kMostExamples) {
    log::info(fmt::format("{}: of {} morph targets the first {} are examples; an asset file may name others",
                          surface.string(), morphs.size(), kMostExamples));
    morphs.resize(kMostExamples);
  }
  if (follows) asset["object"]["fixed"]["follow"] = true;
  const std::vector<std::string> names = example_names(morphs);
  for (std::size_t k = 0; k < names.size(); ++k) examples.push_back({{"name", names[k]}, {"morph", morphs[k]}});
  if (!examples.empty()) asset["examples"] = examples;
  return asset;
}

}  // namespace exmat::precompute
