#include "precompute/study/sweep/settings.h"

#include <algorithm>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/core/error.h"
#include "precompute/cubature/cubature.h"
#include "precompute/polynomial/internal_force.h"

namespace exmat::precompute {
namespace {

constexpr std::size_t kMostPoints = 2000;

bool has_examples(const SceneConfig& scene) { return scene.examples || !scene.regions.empty(); }

// The scene's own way to find targets; one for all its example forces.
std::string own_target(const SceneConfig& scene) {
  if (scene.examples) return std::string(name_of(scene.examples->target));
  return scene.regions.empty() ? kNoTarget : std::string(name_of(scene.regions.front().force.target));
}

// Each setting of `points` once with each of `values`.
template <typename Value, typename Member, typename T>
void multiply(std::vector<PointSettings>& points, const std::vector<Value>& values, T Member::*member) {
  if (values.empty()) return;
  std::vector<PointSettings> product;
  for (const PointSettings& point : points)
    for (const Value& value : values) {
      product.push_back(point);
      product.back().*member = value;
    }
  points = std::move(product);
}

// There always is a scene.
bool learns_from_scene(const PointSettings& point) {
  return point.training == name_of(Training::kAuto) || point.training == name_of(Training::kScene);
}

// Settings without effect are left as they are in the files, so that equal points are seen to be equal.
PointSettings normalised(PointSettings point, const PointSettings& own, const AssetConfig& asset, bool examples) {
  if (point.internal_force == kAllElements)
    point.cubature_elements.reset();
  else if (!point.cubature_elements && !asset.cubature_tolerance)
    point.cubature_elements = 2 * point.basis_size;
  if (learns_from_scene(point) && learns_from_scene(own)) point.training = own.training;
  if (!examples) point.eigenfunctions = own.eigenfunctions;
  if (!examples) point.target = kNoTarget;
  if (!examples) point.elastic_stiffness.reset();
  return point;
}

std::vector<PointSettings> product(const SweepConfig& sweep, const PointSettings& own) {
  std::vector<PointSettings> points{own};
  multiply(points, sweep.eigenfunctions, &PointSettings::eigenfunctions);
  multiply(points, sweep.basis_size, &PointSettings::basis_size);
  multiply(points, sweep.linear_modes, &PointSettings::linear_modes);
  multiply(points, sweep.training, &PointSettings::training);
  multiply(points, sweep.cubature_elements, &PointSettings::cubature_elements);
  multiply(points, sweep.material, &PointSettings::material);
  multiply(points, sweep.time_step, &PointSettings::time_step);
  multiply(points, sweep.integrator, &PointSettings::integrator);
  multiply(points, sweep.internal_force, &PointSettings::internal_force);
  multiply(points, sweep.target, &PointSettings::target);
  multiply(points, sweep.precision, &PointSettings::precision);
  multiply(points, sweep.space, &PointSettings::space);
  multiply(points, sweep.elastic_stiffness, &PointSettings::elastic_stiffness);
  return points;
}

void require_possible(const PointSettings& point, const AssetConfig& asset, const StudyConfig& study,
                      std::size_t sweep) {
  if (point.training == name_of(Training::kLoads) && !asset.training.loads)
    throw InputError({study.file.string(), fmt::format("/sweeps/{}/training", sweep),
                      "\"auto\", \"none\" or \"scene\", since the asset declares no loads", "\"loads\"",
                      "declare them in the asset's basis.loads, or leave it out"});
  if (point.internal_force != "polynomial") return;
  try {
    require_polynomial(from_name<MaterialModel>(point.material).value(), point.basis_size);
  } catch (const InputError& error) {
    const Complaint& complaint = error.complaint();
    throw InputError({study.file.string(), fmt::format("/sweeps/{}/internal_force", sweep), complaint.expected,
                      complaint.found, complaint.advice + "; give it a sweep of its own"});
  }
}

}  // namespace

PointSettings own_settings(const AssetConfig& asset, const SceneConfig& scene) {
  PointSettings own;
  own.eigenfunctions = asset.eigenfunctions;
  own.basis_size = asset.basis_size.value_or(kBasisSize);
  own.linear_modes = asset.linear_modes;
  own.training = name_of(asset.training.from);
  own.cubature_elements = asset.cubature_elements;
  own.material = name_of(asset.material.model);
  own.time_step = scene.time_step;
  own.integrator = name_of(scene.integrator);
  own.internal_force =
      name_of(scene.internal_force == ForceMethod::kAuto ? asset.internal_force : scene.internal_force);
  if (asset.cubature_method == CubatureMethod::kAllElements) own.internal_force = kAllElements;
  own.target = own_target(scene);
  own.precision = name_of(scene.precision);
  own.space = name_of(scene.space.space);
  return normalised(own, own, asset, has_examples(scene));
}

std::vector<PointSettings> expand_all(const StudyConfig& study, const AssetConfig& asset, const SceneConfig& scene) {
  PointSettings own = own_settings(asset, scene);
  const PointSettings normal = own;
  own.cubature_elements = asset.cubature_elements;  // 2 r follows the point's r
  std::vector<PointSettings> points;
  for (std::size_t i = 0; i < study.sweeps.size(); ++i)
    for (const PointSettings& raw : product(study.sweeps[i], own)) {
      points.push_back(normalised(raw, normal, asset, has_examples(scene)));
      require_possible(points.back(), asset, study, i);
    }
  return points;
}

std::vector<PointSettings> expand(const StudyConfig& study, const AssetConfig& asset, const SceneConfig& scene) {
  std::vector<PointSettings> points;
  for (const PointSettings& point : expand_all(study, asset, scene)) {
    if (std::ranges::find(points, point) == points.end()) points.push_back(point);
    if (points.size() > kMostPoints)
      throw InputError({study.file.string(), "/sweeps", fmt::format("at most {} points", kMostPoints), "more", ""});
  }
  return points;
}

AssetConfig with_settings(AssetConfig asset, const PointSettings& settings) {
  asset.eigenfunctions = settings.eigenfunctions;
  asset.pose_tolerance.reset();
  asset.basis_size = settings.basis_size;
  asset.linear_modes = settings.linear_modes;
  asset.training.from = from_name<Training>(settings.training).value();
  asset.material.model = from_name<MaterialModel>(settings.material).value();
  if (settings.cubature_elements || settings.internal_force == kAllElements) asset.cubature_tolerance.reset();
  if (settings.internal_force == kAllElements)
    asset.cubature_method = CubatureMethod::kAllElements;
  else if (asset.cubature_method == CubatureMethod::kAllElements)
    asset.cubature_method = CubatureOptions{}.method;
  asset.cubature_elements = settings.cubature_elements;
  return asset;
}

SceneConfig with_force(SceneConfig scene, const PointSettings& settings) {
  if (!settings.elastic_stiffness) return scene;
  const auto make_elastic = [&](ExampleForceConfig& force) {
    force.law = ExampleForceLaw::kElastic;
    force.stiffness = *settings.elastic_stiffness;
  };
  if (scene.examples) make_elastic(*scene.examples);
  for (RegionForceConfig& region : scene.regions) make_elastic(region.force);
  return scene;
}

SceneConfig with_settings(SceneConfig scene, const PointSettings& settings) {
  scene = with_force(std::move(scene), settings);
  scene.time_step = settings.time_step;
  scene.integrator = from_name<Integrator>(settings.integrator).value();
  scene.internal_force = settings.internal_force == kAllElements
                             ? ForceMethod::kCubature
                             : from_name<ForceMethod>(settings.internal_force).value();
  scene.precision = from_name<Precision>(settings.precision).value();
  scene.space.space = from_name<Space>(settings.space).value();
  // A scene without examples has none to set.
  const TargetSource target = from_name<TargetSource>(settings.target).value_or(TargetSource::kAuto);
  if (scene.examples) scene.examples->target = target;
  for (RegionForceConfig& region : scene.regions) region.force.target = target;
  scene.instances = 1;
  scene.trajectory = "positions";  // is never written
  return scene;
}

nlohmann::ordered_json to_json(const PointSettings& settings) {
  nlohmann::ordered_json json{{"eigenfunctions", settings.eigenfunctions},
                              {"basis_size", settings.basis_size},
                              {"linear_modes", settings.linear_modes},
                              {"training", settings.training}};
  json["cubature_elements"] = nullptr;
  if (settings.cubature_elements) json["cubature_elements"] = *settings.cubature_elements;
  json["material"] = settings.material;
  json["time_step"] = settings.time_step;
  json["integrator"] = settings.integrator;
  json["internal_force"] = settings.internal_force;
  json["target"] = settings.target;
  json["precision"] = settings.precision;
  json["space"] = settings.space;
  json["elastic_stiffness"] = nullptr;
  if (settings.elastic_stiffness) json["elastic_stiffness"] = *settings.elastic_stiffness;
  return json;
}

PointSettings settings_from_json(const nlohmann::ordered_json& json) {
  PointSettings settings;
  settings.eigenfunctions = json.at("eigenfunctions").get<int>();
  settings.basis_size = json.at("basis_size").get<int>();
  settings.linear_modes = json.at("linear_modes").get<int>();
  settings.training = json.at("training").get<std::string>();
  if (!json.at("cubature_elements").is_null()) settings.cubature_elements = json.at("cubature_elements").get<int>();
  settings.material = json.at("material").get<std::string>();
  settings.time_step = json.at("time_step").get<double>();
  settings.integrator = json.at("integrator").get<std::string>();
  settings.internal_force = json.at("internal_force").get<std::string>();
  settings.target = json.at("target").get<std::string>();
  settings.precision = json.at("precision").get<std::string>();
  settings.space = json.at("space").get<std::string>();
  if (!json.at("elastic_stiffness").is_null()) settings.elastic_stiffness = json.at("elastic_stiffness").get<double>();
  return settings;
}

std::string describe(const PointSettings& settings) {
  std::string text = fmt::format("m {}, r {} of {} linear modes, training {}, ", settings.eigenfunctions,
                                 settings.basis_size, settings.linear_modes, settings.training);
  if (settings.cubature_elements) text += fmt::format("s {}, ", *settings.cubature_elements);
  text += fmt::format("{}, {:g} ms, {}, {}, target {}", settings.material, 1e3 * settings.time_step,
                      settings.integrator, settings.internal_force, settings.target);
  if (settings.precision == name_of(Precision::kMixed)) text += ", mixed precision";
  if (settings.space != name_of(Space::kReduced)) text += fmt::format(", space {}", settings.space);
  if (settings.elastic_stiffness) text += fmt::format(", elastic force of {:g}", *settings.elastic_stiffness);
  return text;
}

}  // namespace exmat::precompute
