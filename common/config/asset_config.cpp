#include "common/config/asset_config.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <map>
#include <set>
#include <string>

#include "common/config/config.h"
#include "common/config/json_file.h"
#include "common/config/json_values.h"
#include "common/config/selection_reader.h"
#include "common/core/error.h"
#include "common/core/input_file.h"

namespace exmat {
namespace {

const std::map<std::string, double> kUnits{{"m", 1},     {"dm", 0.1},    {"cm", 0.01},
                                           {"mm", 1e-3}, {"in", 0.0254}, {"ft", 0.3048}};  // [m]

// Names in /examples of the bundle that are no examples, and what HDF5 takes for the group itself.
constexpr std::array<std::string_view, 5> kReservedNames = {"gram", "h0", "hq", ".", ".."};

class AssetReader {
 public:
  explicit AssetReader(const std::filesystem::path& file) : file_(file) {}

  AssetConfig read(const Json& json) {
    AssetConfig asset;
    asset.file = file_;
    asset.name = json["name"];
    read_object(json["object"], asset);
    read_shape_space(json, asset);
    read_examples(member_or(json, "examples", Json::array()), asset);
    read_regions(member_or(json, "regions", Json::array()), asset);
    if (asset.clamp_follows && asset.examples.empty()) refuse("/object/fixed/follow", "examples to follow", "none");
    if (asset.clamp_follows && !asset.regions.empty())
      refuse("/object/fixed/follow", "examples of the whole body alone", "regions");
    read_alignment(member_or(json, "alignment", Json::object()), asset);
    read_basis(member_or(json, "basis", Json::object()), asset);
    read_cubature(member_or(json, "cubature", Json::object()), asset);
    const Json targets = member_or(json, "targets", Json::object());
    asset.target_tolerance = targets.value("tolerance", asset.target_tolerance);
    asset.internal_force = choice_or(json, "internal_force", asset.internal_force);
    const Json contact = member_or(json, "contact", Json::object());
    if (contact.contains("vertices")) asset.contact_vertices = read_selection(contact["vertices"], "/contact/vertices");
    asset.contact_count = optional_member<int>(contact, "count");
    asset.needs = optional_member<std::vector<std::string>>(json, "needs");
    if (asset.clamp_follows && asset.needs) check_needs_of_followers(*asset.needs);
    asset.seed = json.value("seed", asset.seed);
    return asset;
  }

 private:
  /// A clamp that follows examples goes by their weights, and their force is linear.
  void check_needs_of_followers(const std::vector<std::string>& needs) const {
    if (std::ranges::count(needs, "examples") == 0)
      refuse("/needs", "\"examples\" among them, which the clamp follows (object.fixed.follow)", "none");
    if (std::ranges::count(needs, "target_elasticity") > 0)
      refuse("/needs", "no \"target_elasticity\" beside object.fixed.follow, whose example force is linear", "it");
  }

  void read_object(const Json& json, AssetConfig& asset) const {
    read_object_mesh(json, asset);
    const Json material = member_or(json, "material", Json::object());
    asset.material.model = choice_or(material, "model", asset.material.model);
    asset.material.youngs_modulus = optional_member<double>(material, "youngs_modulus");
    asset.material.poisson_ratio = optional_member<double>(material, "poisson_ratio");
    asset.material.density = optional_member<double>(material, "density");
    asset.formulation = choice_or(json, "formulation", asset.formulation);
    const Json parts = member_or(json, "materials", Json::array());
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const Json& part = parts[i];
      asset.material_regions.push_back({read_tets(part["tets"], fmt::format("/object/materials/{}/tets", i)),
                                        optional_member<double>(part, "youngs_modulus"),
                                        optional_member<double>(part, "poisson_ratio"),
                                        optional_member<double>(part, "density")});
    }
    if (json.contains("fixed")) {
      asset.fixed = read_selection(json["fixed"], "/object/fixed");
      asset.clamp_follows = json["fixed"].value("follow", asset.clamp_follows);
    }
    asset.object_drop = read_drop(json);
    asset.render_mesh = asset.object_surface;
    if (json.contains("render_mesh")) asset.render_mesh = resolve_path(file_, json["render_mesh"]);
  }

  void read_object_mesh(const Json& json, AssetConfig& asset) const {
    const bool has_mesh = json.contains("mesh"), has_surface = json.contains("surface");
    if (has_mesh == has_surface) refuse("/object", "mesh (tets) or surface (triangles)", has_mesh ? "both" : "neither");
    asset.object_mesh = resolve_path(file_, json[has_mesh ? "mesh" : "surface"]);
    if (has_surface) asset.object_surface = asset.object_mesh;
    asset.length_unit = kUnits.at(json.value("unit", "m")) * json.value("scale", 1.0);
    asset.cells = optional_member<int>(json, "cells");
    asset.cell_size = optional_member<double>(json, "cell_size");
    for (const char* member : {"cells", "cell_size"})
      if (has_mesh && json.contains(member))
        refuse(fmt::format("/object/{}", member), "none beside object.mesh, which has its tets", "one");
    if (asset.cells && asset.cell_size) refuse("/object", "cells or cell_size", "both");
    if (!json.contains("skeleton")) return;
    if (has_surface) refuse("/object/skeleton", "none beside object.surface, whose glTF file has its bones", "one");
    asset.object_skeleton = resolve_path(file_, json["skeleton"]);
  }

  TetSelection read_tets(const Json& json, const std::string& place) const {
    if (json.contains("set")) return SetSelection{json["set"]};
    return std::visit([](const auto& selection) { return TetSelection(selection); }, read_selection(json, place));
  }

  VertexSelection read_selection(const Json& json, const std::string& place) const {
    return exmat::read_selection(json, file_, place);
  }

  static DropConfig read_drop(const Json& json) {
    const auto names = member_or(json, "drop", Json::array()).get<std::set<std::string>>();
    return {names.contains("degenerate_tets"), names.contains("unreferenced_vertices"),
            names.contains("smaller_components")};
  }

  static void read_shape_space(const Json& json, AssetConfig& asset) {
    const Json shape_space = member_or(json, "shape_space", Json::object());
    asset.eigenfunctions = shape_space.value("eigenfunctions", asset.eigenfunctions);
    asset.pose_tolerance = optional_member<double>(shape_space, "tolerance");
    asset.weighting = choice_or(shape_space, "weighting", asset.weighting);
  }

  void read_examples(const Json& json, AssetConfig& asset) const {
    for (std::size_t i = 0; i < json.size(); ++i) {
      const std::string place = fmt::format("/examples/{}", i);
      const Json& example = json[i];
      ExampleConfig config{example["name"], {}, example.value("rest", false), read_drop(example)};
      read_shape(example, place, asset, config);
      check_example(config, asset.examples, place);
      asset.examples.push_back(std::move(config));
    }
  }

  // The mesh, surface or morph target of an example.
  void read_shape(const Json& json, const std::string& place, const AssetConfig& asset, ExampleConfig& example) const {
    if (json.contains("mesh")) example.mesh = resolve_path(file_, json["mesh"]);
    if (json.contains("surface")) example.surface = resolve_path(file_, json["surface"]);
    example.morph = optional_member<std::string>(json, "morph");
    example.frame = optional_member<std::int64_t>(json, "frame");
    const bool has_surface = example.surface || example.morph;
    if (json.contains("mesh") == has_surface)
      refuse(place, "mesh (tets), or surface or morph (triangles)", has_surface ? "both" : "none of them");
    const bool of_object = has_surface && (!example.surface || example.frame);
    if (of_object && !asset.object_surface)
      refuse(place, "object.surface, whose vertices a morph target or a point cache moves", "object.mesh");
    const bool is_cache = example.surface && lower_extension(*example.surface) == ".pc2";
    if (is_cache != example.frame.has_value())
      refuse(place, is_cache ? "the frame of the point cache" : "no frame but of a point cache (.pc2)",
             is_cache ? "none" : "a frame");
    if (is_cache && example.morph) refuse(place, "a frame or a morph target", "both");
    if (example.rest && of_object)
      refuse(place, "a rest example with a mesh or surface of its own", "a pose of the object's surface");
  }

  void check_example(const ExampleConfig& example, const std::vector<ExampleConfig>& earlier,
                     const std::string& place) const {
    const bool is_reserved = std::ranges::find(kReservedNames, example.name) != kReservedNames.end();
    if (is_reserved || example.name.find('/') != std::string::npos)
      refuse(place + "/name", "a name without '/' that is none of \".\", \"..\", \"gram\", \"h0\" and \"hq\"",
             "\"" + example.name + "\"");
    for (std::size_t i = 0; i < earlier.size(); ++i) {
      if (earlier[i].name == example.name)
        refuse(place + "/name", "another name for each example",
               fmt::format("\"{}\", that of /examples/{} too", example.name, i));
      if (earlier[i].rest && example.rest)
        refuse(place + "/rest", "at most one rest example", fmt::format("another one: /examples/{}", i));
    }
  }

  void read_regions(const Json& json, AssetConfig& asset) const {
    for (std::size_t i = 0; i < json.size(); ++i) {
      const std::string place = fmt::format("/regions/{}", i);
      const Json& region = json[i];
      RegionConfig config{region["name"], read_selection(region["vertices"], place + "/vertices"), std::nullopt, {}};
      if (region.contains("example_vertices"))
        config.example_vertices = read_selection(region["example_vertices"], place + "/example_vertices");
      for (std::size_t k = 0; k < region["examples"].size(); ++k)
        config.examples.push_back(pose_name(region["examples"][k], asset, fmt::format("{}/examples/{}", place, k)));
      check_region(config, asset.regions, place);
      asset.regions.push_back(std::move(config));
    }
  }

  void check_region(const RegionConfig& region, const std::vector<RegionConfig>& earlier,
                    const std::string& place) const {
    if (region.name == "." || region.name == ".." || region.name.find('/') != std::string::npos)
      refuse(place + "/name", "a name without '/' that is neither \".\" nor \"..\"", "\"" + region.name + "\"");
    const auto same = std::ranges::find(earlier, region.name, &RegionConfig::name);
    if (same != earlier.end())
      refuse(place + "/name", "another name for each region",
             fmt::format("\"{}\", that of /regions/{} too", region.name, same - earlier.begin()));
  }

  std::string pose_name(const std::string& name, const AssetConfig& asset, const std::string& place) const {
    const auto found = std::ranges::find(asset.examples, name, &ExampleConfig::name);
    if (found == asset.examples.end()) refuse(place, "the name of an example", fmt::format("\"{}\"", name));
    if (found->rest)
      refuse(place, "the name of a posed example", fmt::format("\"{}\", the rest pose, which every region has", name));
    return name;
  }

  void read_alignment(const Json& json, AssetConfig& asset) const {
    AlignmentConfig& alignment = asset.alignment;
    alignment.method = choice_or(json, "method", alignment.method);
    alignment.frame = choice_or(json, "frame", alignment.frame);
    if (json.contains("landmarks")) alignment.landmarks = resolve_path(file_, json["landmarks"]);
    const Json maps = member_or(json, "map", Json::array());
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const std::string place = fmt::format("/alignment/map/{}/example", i);
      alignment.maps.push_back({example_name(maps[i]["example"], asset, place), resolve_path(file_, maps[i]["file"])});
      for (std::size_t j = 0; j < i; ++j)
        if (alignment.maps[j].example == alignment.maps[i].example)
          refuse(place, "one map for each example", fmt::format("\"{}\" again", alignment.maps[i].example));
    }
    const Json regions = member_or(json, "regions", Json::array());
    for (std::size_t i = 0; i < regions.size(); ++i)
      alignment.regions.push_back(read_part(regions[i], asset, fmt::format("/alignment/regions/{}", i)));
    alignment.accept = json.value("accept", alignment.accept);
    check_alignment(alignment);
  }

  CorrespondingRegionConfig read_part(const Json& json, const AssetConfig& asset, const std::string& place) const {
    CorrespondingRegionConfig region{read_selection(json["object"], place + "/object"), {}};
    for (std::size_t i = 0; i < json["examples"].size(); ++i) {
      const Json& example = json["examples"][i];
      const std::string here = fmt::format("{}/examples/{}", place, i);
      region.examples.push_back({example_name(example["example"], asset, here + "/example"),
                                 read_selection(example["vertices"], here + "/vertices")});
    }
    return region;
  }

  std::string example_name(const std::string& name, const AssetConfig& asset, const std::string& place) const {
    if (std::ranges::find(asset.examples, name, &ExampleConfig::name) == asset.examples.end())
      refuse(place, "the name of an example", fmt::format("\"{}\"", name));
    return name;
  }

  void check_alignment(const AlignmentConfig& alignment) const {
    const auto require = [&](bool is_there, AlignmentMethod method, const char* what) {
      if (alignment.method == method && !is_there)
        refuse("/alignment/method", fmt::format("{} beside the method \"{}\"", what, name_of(method)), "none");
    };
    require(alignment.landmarks.has_value(), AlignmentMethod::kLandmarks, "alignment.landmarks");
    require(!alignment.maps.empty(), AlignmentMethod::kMap, "alignment.map");
    require(alignment.landmarks || !alignment.regions.empty(), AlignmentMethod::kCoupled,
            "alignment.landmarks or alignment.regions");
    if (!alignment.regions.empty() && alignment.method != AlignmentMethod::kCoupled)
      refuse("/alignment/regions", "none but with the method \"coupled\"",
             fmt::format("the method \"{}\"", name_of(alignment.method)));
  }

  void read_basis(const Json& json, AssetConfig& asset) const {
    asset.basis_size = optional_member<int>(json, "size");
    asset.basis_tolerance = optional_member<double>(json, "tolerance");
    if (asset.basis_tolerance && asset.basis_size) refuse("/basis", "size or tolerance", "both");
    asset.linear_modes = json.value("linear_modes", asset.linear_modes);
    asset.example_fields = json.value("example_fields", asset.example_fields);
    TrainingConfig& training = asset.training;
    training.from = choice_or(json, "training", training.from);
    training.space = choice_or(json, "training_space", training.space);
    training.segments = json.value("training_segments", training.segments);
    training.seconds = optional_member<double>(json, "training_seconds");
    training.seed = optional_member<std::uint64_t>(json, "training_seed");
    if (json.contains("loads")) training.loads = read_loads(json["loads"]);
    if (training.from == Training::kLoads && !training.loads)
      refuse("/basis/loads", "the loads that \"training\": \"loads\" asks for", "none");
  }

  LoadsConfig read_loads(const Json& json) const {
    LoadsConfig loads;
    const Json forces = member_or(json, "forces", Json::array());
    for (std::size_t i = 0; i < forces.size(); ++i)
      loads.forces.push_back({read_selection(forces[i]["vertices"], fmt::format("/basis/loads/forces/{}/vertices", i)),
                              forces[i]["force"]});
    const Json examples = member_or(json, "examples", Json::object());
    loads.example_stiffness = optional_member<double>(examples, "stiffness");
    loads.example_damping = optional_member<double>(examples, "damping");
    loads.example_bias = optional_member<double>(examples, "bias");
    if (json.contains("gravity"))
      for (std::size_t axis = 0; axis < 3; ++axis)
        loads.gravity[static_cast<Eigen::Index>(axis)] = json["gravity"][axis];
    loads.speed = json.value("speed", loads.speed);
    return loads;
  }

  void read_cubature(const Json& json, AssetConfig& asset) const {
    asset.cubature_elements = optional_member<int>(json, "elements");
    asset.cubature_tolerance = optional_member<double>(json, "tolerance");
    if (asset.cubature_elements && asset.cubature_tolerance) refuse("/cubature", "elements or tolerance", "both");
    asset.cubature_method = choice_or(json, "method", asset.cubature_method);
    asset.training_poses = json.value("training_poses", asset.training_poses);
  }

  [[noreturn]] void refuse(const std::string& place, const std::string& expected, const std::string& found) const {
    throw InputError({file_.string(), place, expected, found, ""});
  }

  std::filesystem::path file_;
};

}  // namespace

AssetConfig load_asset(const std::filesystem::path& file) { return asset_of(read_json(file), file); }

std::vector<NamedFile> named_files(const AssetConfig& asset) {
  std::vector<NamedFile> files;
  const auto add = [&](const std::filesystem::path& file, std::string place, const char* kind) {
    files.push_back({file, std::move(place), kind});
  };
  const auto add_ids = [&](const auto& selection, const std::string& place) {
    if (const auto* ids = std::get_if<FileSelection>(&selection)) add(ids->file, place + "/file", "a text file of ids");
  };
  add(asset.object_mesh, asset.object_surface ? "/object/surface" : "/object/mesh",
      asset.object_surface ? "a surface" : "a mesh of tets");
  if (asset.object_skeleton) add(*asset.object_skeleton, "/object/skeleton", "a JSON file of bones");
  if (asset.render_mesh) add(*asset.render_mesh, "/object/render_mesh", "a surface");
  if (asset.fixed) add_ids(*asset.fixed, "/object/fixed");
  for (std::size_t i = 0; i < asset.material_regions.size(); ++i)
    add_ids(asset.material_regions[i].tets, fmt::format("/object/materials/{}/tets", i));
  for (std::size_t i = 0; i < asset.examples.size(); ++i) {
    const ExampleConfig& example = asset.examples[i];
    if (!example.mesh.empty()) add(example.mesh, fmt::format("/examples/{}/mesh", i), "a mesh of tets");
    if (example.surface) add(*example.surface, fmt::format("/examples/{}/surface", i), "a surface");
  }
  for (std::size_t i = 0; i < asset.regions.size(); ++i) {
    add_ids(asset.regions[i].vertices, fmt::format("/regions/{}/vertices", i));
    if (const auto& own = asset.regions[i].example_vertices)
      add_ids(*own, fmt::format("/regions/{}/example_vertices", i));
  }
  if (asset.alignment.landmarks) add(*asset.alignment.landmarks, "/alignment/landmarks", "a text file of landmarks");
  for (std::size_t i = 0; i < asset.alignment.maps.size(); ++i)
    add(asset.alignment.maps[i].file, fmt::format("/alignment/map/{}/file", i), "a text file of vertex numbers");
  for (std::size_t i = 0; i < asset.alignment.regions.size(); ++i) {
    const CorrespondingRegionConfig& part = asset.alignment.regions[i];
    add_ids(part.object, fmt::format("/alignment/regions/{}/object", i));
    for (std::size_t k = 0; k < part.examples.size(); ++k)
      add_ids(part.examples[k].vertices, fmt::format("/alignment/regions/{}/examples/{}/vertices", i, k));
  }
  if (asset.training.loads)
    for (std::size_t i = 0; i < asset.training.loads->forces.size(); ++i)
      add_ids(asset.training.loads->forces[i].vertices, fmt::format("/basis/loads/forces/{}/vertices", i));
  if (asset.contact_vertices) add_ids(*asset.contact_vertices, "/contact/vertices");
  return files;
}

void require_files(const AssetConfig& asset) {
  for (const auto& [file, place, kind] : named_files(asset)) require_file(file, asset.file, place, kind);
}

AssetConfig asset_of(const Json& json, const std::filesystem::path& file) {
  check_against_schema(json, "asset", file);
  check_numbers(json, file);
  return AssetReader(file).read(json);
}

}  // namespace exmat
