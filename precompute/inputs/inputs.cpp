#include "precompute/inputs/inputs.h"

#include <algorithm>
#include <fmt/format.h>
#include <map>

#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/core/log.h"
#include "common/mesh/checks.h"
#include "common/mesh/geometry.h"
#include "precompute/cache/sha256.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/inputs/correspondence_files.h"
#include "precompute/inputs/object_materials.h"
#include "precompute/inputs/object_size.h"
#include "precompute/inputs/object_skeleton.h"
#include "precompute/inputs/object_surface.h"
#include "precompute/inputs/skeleton_file.h"
#include "precompute/mesh_io/gltf_look.h"
#include "precompute/mesh_io/mesh_file.h"
#include "precompute/mesh_io/surface_file.h"
#include "precompute/mesh_io/vertex_selection.h"
#include "precompute/posing/missed_pose.h"
#include "precompute/render/embedding.h"

namespace exmat::precompute {
namespace {

constexpr double kInvertedLimit = 0.05, kMirrored = 0.95;
// RMS misfit of a pose by a cage, over the diagonal. The poses of docs/surfaces.md are missed by 0.15 % at most.
constexpr double kMissWarned = 0.02, kMissRefused = 0.1;

// A checked mesh with what its file said.
struct CheckedMesh {
  MeshFile file;
  MeshReport report;
  std::vector<std::int32_t> file_tets;
  VertexArray file_vertices;
};

std::vector<std::int32_t> flat_tets(const TetArray& tets) { return {tets.data(), tets.data() + tets.size()}; }

void log_report(const std::string& name, const TetMesh& mesh, const MeshReport& report) {
  log::info(fmt::format("{}: {} vertices, {} tets", name, mesh.vertex_count(), mesh.tet_count()));
  if (report.reoriented_tets > 0)
    log::warning(fmt::format("{}: re-oriented {} inverted tets", name, report.reoriented_tets));
  if (report.dropped_degenerate_tets > 0)
    log::warning(fmt::format("{}: dropped {} degenerate tets", name, report.dropped_degenerate_tets));
  if (report.dropped_vertices > 0)
    log::warning(fmt::format("{}: dropped {} unreferenced vertices", name, report.dropped_vertices));
  if (report.dropped_components > 0)
    log::warning(fmt::format("{}: dropped {} smaller components", name, report.dropped_components));
}

MeshFile read_recorded(const std::filesystem::path& path, const AssetConfig& asset, InputFiles& files) {
  MeshFile file = read_mesh(path);
  file.mesh.vertices *= asset.length_unit;
  files.insert(files.end(), file.files.begin(), file.files.end());
  return file;
}

CheckedMesh check(MeshFile file, const std::filesystem::path& path, const DropConfig& drop) {
  CheckedMesh checked{std::move(file), {}, {}, {}};
  checked.file_tets = flat_tets(checked.file.mesh.tets);
  checked.file_vertices = checked.file.mesh.vertices;
  checked.report = check_mesh(checked.file.mesh, path.string(),
                              {drop.degenerate_tets, drop.unreferenced_vertices, drop.smaller_components});
  log_report(path.string(), checked.file.mesh, checked.report);
  return checked;
}

// A selection by parts of the object's surface becomes one by ids of points of the object.
template <typename Selection>
Selection on_surface(const std::shared_ptr<const ObjectSurface>& surface, const Selection& selection,
                     const VertexArray& points) {
  return surface ? surface->resolved(selection, points) : selection;
}

// 1 for the selected vertices, whose ids are the file's; `absent` for all where none are selected.
class VertexFlagger {
 public:
  VertexFlagger(const AssetConfig& asset, const CheckedMesh& checked,
                const std::shared_ptr<const ObjectSurface>& surface, InputFiles& files)
      : asset_(asset), checked_(checked), surface_(surface), files_(files) {}

  FlagVector operator()(const std::optional<VertexSelection>& selection, std::uint8_t absent) const {
    if (!selection) return FlagVector::Constant(checked_.file.mesh.vertex_count(), absent);
    FlagVector in_file = FlagVector::Zero(checked_.file_vertices.rows());
    const VertexSelection resolved = on_surface(surface_, *selection, checked_.file_vertices);
    for (const auto vertex : select_vertices(checked_.file_vertices, resolved, asset_.file.string()))
      in_file[vertex] = 1;
    if (const auto* file = std::get_if<FileSelection>(&*selection)) files_.push_back(file->file);
    return in_file(checked_.report.kept_vertices);
  }

 private:
  const AssetConfig& asset_;
  const CheckedMesh& checked_;
  const std::shared_ptr<const ObjectSurface>& surface_;
  InputFiles& files_;
};

// The asset with the tets of its materials by ids where they were parts of the surface.
AssetConfig with_tets_of_surface(const AssetConfig& asset, const ObjectSurface& surface, const TetMesh& mesh) {
  AssetConfig result = asset;
  VertexArray centroids = VertexArray::Zero(mesh.tet_count(), 3);
  for (int corner = 0; corner < 4; ++corner) centroids += mesh.vertices(mesh.tets.col(corner), Eigen::all) / 4;
  for (MaterialRegionConfig& region : result.material_regions) region.tets = surface.resolved(region.tets, centroids);
  return result;
}

std::vector<std::int64_t> ids_of(const FlagVector& flags) {
  std::vector<std::int64_t> ids;
  for (Eigen::Index v = 0; v < flags.size(); ++v)
    if (flags[v] != 0) ids.push_back(v);
  return ids;
}

// Numbering of a mesh's vertices in its file.
struct FileNumbers {
  std::vector<std::int32_t> kept;  // new index -> index in the file
  Eigen::Index count = 0;          // in the file

  // File index -> new index, -1 for a vertex that was dropped.
  IndexVector inverse() const {
    IndexVector result = IndexVector::Constant(count, -1);
    for (std::size_t v = 0; v < kept.size(); ++v) result[kept[v]] = static_cast<std::int32_t>(v);
    return result;
  }
};

FileNumbers numbers_of(const CheckedMesh& checked) {
  return {checked.report.kept_vertices, checked.file_vertices.rows()};
}

// The bones of a JSON file for the vertices that the check of the mesh has left.
SkeletonData skeleton_of_tets(const std::filesystem::path& path, const CheckedMesh& checked, InputFiles& files) {
  SkeletonData skeleton = read_skeleton(path, checked.file_vertices.rows());
  files.push_back(path);
  skeleton.weights = RowMatrix(skeleton.weights(checked.report.kept_vertices, Eigen::all));
  if (skeleton.weights.isZero(0))
    throw InputError({path.string(), "/weights", "vertices that belong to tets", "none", ""});
  fill_weights(checked.file.mesh, skeleton.weights);
  return skeleton;
}

// Fixes the vertices that the object's bones hold. Refuses bones, of `file` at `place`, that hold all vertices, or so
// few that the body turns about them.
void pin_to_bones(ObjectInput& object, const SurfaceTree& surface, const std::filesystem::path& file,
                  const char* place) {
  const VertexArray& vertices = object.mesh.vertices;
  object.fixed = pin_to_bones(vertices, surface, *object.skeleton, object.warnings);
  const FlagVector& fixed = object.fixed;
  if (fixed.all())
    throw InputError(
        {file.string(), place, "a vertex of the tets that no joint holds", "all of them held",
         "let vertices hang on several joints, make more tets, or fix fewer by /object/fixed of the asset"});
  if (!fixed.any() || are_clamp(vertices, fixed)) return;
  std::string held;
  for (Eigen::Index b = 0; b < object.skeleton->weights.cols(); ++b) {
    const auto own = (fixed.array() != 0 && object.skeleton->weights.col(b).array() == 1).count();
    if (own > 0)
      held += fmt::format("{}{} by the joint \"{}\"", held.empty() ? "" : ", ", own,
                          object.skeleton->bones[static_cast<std::size_t>(b)]);
  }
  throw InputError(
      {file.string(), place, "joints that hold at least three vertices, which are not on one line", held,
       "let more vertices hang on a joint alone, make more tets, or fix some by /object/fixed of the asset"});
}

// Weights of the bones [v x b] at points in tets. A point outside of its tet hangs on no bone by less than 0 or more
// than 1, as its barycentric coordinates would have it.
RowMatrix weights_in_tets(const BarycentricPoints& points, const ObjectInput& object) {
  RowMatrix weights = points.interpolation(object.mesh) * object.skeleton->weights;
  weights = weights.cwiseMax(0);
  for (auto row : weights.rowwise()) row /= row.sum();
  return weights;
}

// Adds how the vertices of a render mesh hang on bones, by weights of each bone [v x b].
void add_bones(const RowMatrix& weights, RenderData& render) {
  const Eigen::Index most = (weights.array() > 0).rowwise().count().maxCoeff();
  render.bones.setZero(weights.rows(), most);
  render.bone_weights.setZero(weights.rows(), most);
  for (Eigen::Index v = 0; v < weights.rows(); ++v)
    for (Eigen::Index b = 0, k = 0; b < weights.cols(); ++b) {
      if (!(weights(v, b) > 0)) continue;
      render.bones(v, k) = static_cast<std::int32_t>(b);
      render.bone_weights(v, k++) = weights(v, b);
    }
}

// Adds the look of a render mesh that comes from glTF.
void add_look(const AssetConfig& asset, InputFiles& files, std::vector<std::string>& warnings, RenderData& render) {
  const std::string extension = lower_extension(*asset.render_mesh);
  if (extension != ".glb" && extension != ".gltf") return;
  std::optional<SurfaceLook> look = read_gltf_look(*asset.render_mesh, asset.length_unit);
  if (!look) return;
  files.insert(files.end(), look->images.begin(), look->images.end());
  for (const std::string& remark : look->remarks) {
    warnings.push_back(fmt::format("{}: {}", asset.render_mesh->string(), remark));
    log::warning(warnings.back());
  }
  render.look =
      Eigen::Map<const FlagVector>(reinterpret_cast<const std::uint8_t*>(look->glb.data()), std::ssize(look->glb));
  render.look_vertices = std::move(look->vertices);
  render.look_frames = std::move(look->frames);
}

// The examples as they are read, with what finds vertices of their files in their meshes.
class ExampleReader {
 public:
  ExampleReader(const AssetConfig& asset, const ObjectInput& object, InputFiles& files, StageCache& cache)
      : asset_(asset),
        object_(object),
        files_(files),
        cache_(cache),
        object_numbers_{object.kept_vertices, object.file_positions.rows()} {}

  ExampleInput read();

 private:
  struct Mesh {
    FileNumbers numbers;
    VertexArray file_vertices;
  };

  void read_rest();
  void read_pose(const ExampleConfig& example);
  bool read_surface_pose(const ExampleConfig& example);
  std::string judge_miss(const SurfacePose& fitted, const VertexArray& posed, const ExampleConfig& example) const;
  MeshFile read_tets(const ExampleConfig& example);
  bool poses_rest(const MeshFile& file) const;
  void read_correspondences(PoseInput& example);
  void read_landmark_file();
  void read_regions();
  FlagVector flagged(const VertexArray& file_vertices, const FileNumbers& numbers, const VertexSelection& selection);
  IndexVector selected(const VertexArray& file_vertices, const FileNumbers& numbers, const VertexSelection& selection);

  const AssetConfig& asset_;
  const ObjectInput& object_;
  InputFiles& files_;
  StageCache& cache_;
  FileNumbers object_numbers_;
  std::map<std::string, Mesh> meshes_;  // of the examples, by name
  std::vector<std::int32_t> rest_file_tets_;
  FileNumbers rest_numbers_;
  std::vector<KnownPose> known_poses_;  // of the object's surface
  ExampleInput input_;
};

void refuse_inverted(const PoseInput& pose) {
  if (pose.inverted_fraction > kInvertedLimit)
    throw InputError({pose.file.string(), "tets", "a pose that turns less than 5 % of the volume inside out",
                      fmt::format("{:.1f} %", 100 * pose.inverted_fraction),
                      pose.inverted_fraction > kMirrored ? "it is a mirror image; export it without a negative scale"
                                                         : "mend the pose"});
  if (pose.inverted_fraction > 0)
    log::warning(
        fmt::format("example {}: {:.2f} % of its volume is inverted", pose.name, 100 * pose.inverted_fraction));
}

// Also of fewer vertices than the rest example's file, where those left out are not of its tets.
bool ExampleReader::poses_rest(const MeshFile& file) const {
  const auto& kept = rest_numbers_.kept;
  return flat_tets(file.mesh.tets) == rest_file_tets_ &&
         file.mesh.vertex_count() > *std::max_element(kept.begin(), kept.end());
}

void ExampleReader::read_rest() {
  input_.rest = {"rest", asset_.object_mesh, object_.mesh};
  input_.rest.column = -1;
  rest_file_tets_ = object_.file_tets;
  rest_numbers_ = object_numbers_;
  for (std::size_t k = 0; k < asset_.examples.size(); ++k) {
    const ExampleConfig& example = asset_.examples[k];
    if (!example.rest) continue;
    const auto& path = example.file(asset_.object_mesh);
    const auto checked = check(read_tets(example), path, example.drop);
    input_.object_is_rest = false;
    input_.rest = {example.name, path, checked.file.mesh};
    rest_file_tets_ = checked.file_tets;
    rest_numbers_ = numbers_of(checked);
    meshes_[example.name] = {rest_numbers_, checked.file_vertices};
    read_correspondences(input_.rest);
  }
  const bool name_is_taken = std::ranges::find(asset_.examples, "rest", &ExampleConfig::name) != asset_.examples.end();
  if (input_.object_is_rest && name_is_taken) input_.rest.name = "object_rest";
}

// Tets of a file, or those that fill a surface of its own.
MeshFile ExampleReader::read_tets(const ExampleConfig& example) {
  if (!example.surface) return read_recorded(example.mesh, asset_, files_);
  const SurfaceFile surface = read_recorded_surface(*example.surface, asset_, files_);
  SurfaceMesh mesh = surface.mesh;
  if (example.morph) mesh.vertices = morph_target(surface, *example.morph, *example.surface);
  MeshFile file;
  file.mesh = cage_of(mesh, asset_, example.surface->string(), cache_);
  return file;
}

// The fault of a pose that no elastic body takes, or none. Warns of one that the cage misses; refuses one that it
// misses by far.
std::string ExampleReader::judge_miss(const SurfacePose& fitted, const VertexArray& posed,
                                      const ExampleConfig& example) const {
  const SurfaceMesh& rest = object_.surface->file().mesh;
  const std::string fault = fault_of_pose(rest, posed);
  if (fitted.rms <= kMissWarned) return fault;
  const std::string found = fmt::format("{:.1f} % (RMS), {:.1f} % at most", 100 * fitted.rms, 100 * fitted.farthest);
  const std::string advice = reason_of_miss(rest, posed, fitted);
  if (fitted.rms > kMissRefused && !asset_.alignment.accept)
    throw InputError({example.file(asset_.object_mesh).string(), "example " + example.name,
                      fmt::format("a pose that the cage follows within {:g} % of its size", 100 * kMissRefused), found,
                      advice});
  log::warning(fmt::format("example {}: the cage misses the pose by {} of its size; {}", example.name, found, advice));
  return fault;
}

// A pose of the object's surface, on the object's own tets. False where the example's surface has other vertices.
bool ExampleReader::read_surface_pose(const ExampleConfig& example) {
  const std::optional<VertexArray> posed = object_.surface->posed(example, files_);
  if (!posed) return false;
  if (!input_.object_is_rest)
    throw InputError({asset_.file.string(), "/examples, " + example.name,
                      "poses of the rest example, since one is marked rest", "a pose of the object's surface",
                      "leave the rest example out: the object at rest is it"});
  if (known_poses_.empty()) known_poses_.push_back(object_.surface->rest());
  const SurfacePose fitted = object_.surface->pose(*posed, known_poses_, "example " + example.name, cache_);
  const std::string fault = judge_miss(fitted, *posed, example);
  known_poses_.push_back({*posed, fitted.positions});
  PoseInput pose{example.name, example.file(asset_.object_mesh), {}};
  // The cage is kept whole, so its vertices are the file's.
  pose.mesh = {fitted.positions, object_.mesh.tets};
  pose.surface = SurfaceMiss{fitted.rms, fitted.farthest, fitted.iterations};
  pose.fault = fault;
  meshes_[example.name] = {rest_numbers_, fitted.positions};
  read_correspondences(pose);
  input_.poses.push_back(std::move(pose));
  return true;
}

void ExampleReader::read_pose(const ExampleConfig& example) {
  if (object_.surface && (example.surface || example.morph) && read_surface_pose(example)) return;
  MeshFile file = read_tets(example);
  const auto& path = example.file(asset_.object_mesh);
  PoseInput pose{example.name, path, {}};
  pose.same_connectivity = poses_rest(file);
  if (pose.same_connectivity) {
    pose.mesh = {file.mesh.vertices(rest_numbers_.kept, Eigen::all), input_.rest.mesh.tets};
    meshes_[example.name] = {{rest_numbers_.kept, file.mesh.vertex_count()}, file.mesh.vertices};
    if (!pose.mesh.vertices.allFinite())
      throw InputError({path.string(), "vertices", "finite numbers", "NaN or infinity", "export the pose again"});
    require_extent(pose.mesh.vertices, path.string());
    const Eigen::VectorXd volumes = tet_volumes(pose.mesh);
    const double all = volumes.cwiseAbs().sum();
    pose.inverted_fraction = all > 0 ? (-volumes).cwiseMax(0).sum() / all : 0;
    refuse_inverted(pose);
  } else {
    const auto checked = check(std::move(file), path, example.drop);
    pose.mesh = checked.file.mesh;
    meshes_[example.name] = {numbers_of(checked), checked.file_vertices};
  }
  read_correspondences(pose);
  input_.poses.push_back(std::move(pose));
}

IndexVector ExampleReader::selected(const VertexArray& file_vertices, const FileNumbers& numbers,
                                    const VertexSelection& selection) {
  const auto ids = select_vertices(file_vertices, selection, asset_.file.string());
  if (const auto* file = std::get_if<FileSelection>(&selection)) files_.push_back(file->file);
  const IndexVector inverse = numbers.inverse();
  std::vector<std::int32_t> kept;
  for (const auto id : ids)
    if (inverse[id] >= 0) kept.push_back(inverse[id]);
  return Eigen::Map<const IndexVector>(kept.data(), std::ssize(kept));
}

FlagVector ExampleReader::flagged(const VertexArray& file_vertices, const FileNumbers& numbers,
                                  const VertexSelection& selection) {
  FlagVector flags = FlagVector::Zero(std::ssize(numbers.kept));
  for (const auto vertex : selected(file_vertices, numbers, selection)) flags[vertex] = 1;
  return flags;
}

void ExampleReader::read_regions() {
  const Mesh object{object_numbers_, object_.file_positions};
  const Mesh& rest = input_.object_is_rest ? object : meshes_.at(input_.rest.name);
  for (std::size_t i = 0; i < asset_.regions.size(); ++i) {
    const RegionConfig& config = asset_.regions[i];
    const auto on_object = [&](const VertexSelection& selection) {
      return on_surface(object_.surface, selection, object.file_vertices);
    };
    RegionInput region{
        config.name, flagged(object.file_vertices, object.numbers, on_object(config.vertices)), {}, config.examples};
    if (!(region.inside.array() != 0 && object_.fixed.array() == 0).any())
      throw InputError({asset_.file.string(), fmt::format("/regions/{}/vertices", i),
                        "vertices of the object, some of them not fixed", "none", "choose others"});
    if (config.example_vertices)
      region.inside_example =
          flagged(rest.file_vertices, rest.numbers,
                  input_.object_is_rest ? on_object(*config.example_vertices) : *config.example_vertices);
    for (PoseInput& pose : input_.poses)
      if (std::ranges::find(config.examples, pose.name) != config.examples.end()) pose.in_whole_body = false;
    input_.regions.push_back(std::move(region));
  }
  input_.whole_body = input_.regions.empty() || std::ranges::any_of(input_.poses, &PoseInput::in_whole_body);
}

// The dense map and the corresponding parts of one example.
void ExampleReader::read_correspondences(PoseInput& example) {
  const Mesh& mesh = meshes_.at(example.name);
  const auto at = std::ranges::find(asset_.examples, example.name, &ExampleConfig::name);
  example.column = 1 + (at - asset_.examples.begin());
  for (const ExampleMapConfig& map : asset_.alignment.maps) {
    if (map.example != example.name) continue;
    const IndexVector in_file = read_vertex_map(map.file, object_numbers_.count, mesh.numbers.count);
    files_.push_back(map.file);
    const IndexVector inverse = mesh.numbers.inverse();
    example.on_object = in_file(object_numbers_.kept);
    for (auto& vertex : example.on_object)
      if (vertex >= 0) vertex = inverse[vertex];
  }
  for (const CorrespondingRegionConfig& region : asset_.alignment.regions) {
    example.parts.emplace_back();
    for (const auto& [name, vertices] : region.examples)
      if (name == example.name) example.parts.back() = selected(mesh.file_vertices, mesh.numbers, vertices);
  }
}

void ExampleReader::read_landmark_file() {
  if (!asset_.alignment.landmarks) return;
  const auto& file = *asset_.alignment.landmarks;
  std::vector<Eigen::Index> sizes{object_numbers_.count};
  std::vector<IndexVector> inverses{object_numbers_.inverse()};
  for (const ExampleConfig& example : asset_.examples) {
    const FileNumbers& numbers = meshes_.at(example.name).numbers;
    sizes.push_back(numbers.count);
    inverses.push_back(numbers.inverse());
  }
  input_.landmarks = read_landmarks(file, sizes);
  files_.push_back(file);
  for (Eigen::Index column = 0; column < input_.landmarks.cols(); ++column)
    for (auto& vertex : input_.landmarks.col(column)) {
      if (vertex < 0) continue;
      const auto in_file = vertex;
      vertex = inverses[static_cast<std::size_t>(column)][in_file];
      if (vertex < 0)
        throw InputError({file.string(), "", "vertices that belong to tets",
                          fmt::format("{}, which was dropped from its mesh", in_file + 1), ""});
    }
}

ExampleInput ExampleReader::read() {
  read_rest();
  for (const auto& example : asset_.examples)
    if (!example.rest) read_pose(example);
  read_regions();
  read_landmark_file();
  for (const CorrespondingRegionConfig& region : asset_.alignment.regions)
    input_.parts.push_back(selected(object_.file_positions, object_numbers_,
                                    on_surface(object_.surface, region.object, object_.file_positions)));
  return std::move(input_);
}

}  // namespace

ObjectInput read_object(const AssetConfig& asset, InputFiles& files) {
  StageCache none;
  return read_object(asset, files, none);
}

ObjectInput read_object(const AssetConfig& asset, InputFiles& files, StageCache& cache) {
  require_files(asset);
  ObjectInput object;
  MeshFile file;
  if (asset.object_surface) {
    object.surface = std::make_shared<const ObjectSurface>(asset, files, cache);
    file.mesh = object.surface->cage().mesh;
  } else {
    file = read_recorded(asset.object_mesh, asset, files);
  }
  const auto checked = check(std::move(file), asset.object_mesh, asset.object_drop);
  const VertexFlagger flag(asset, checked, object.surface, files);
  object.mesh = checked.file.mesh;
  const TetMesh file_mesh{checked.file_vertices,
                          Eigen::Map<const TetArray>(checked.file_tets.data(), std::ssize(checked.file_tets) / 4, 4)};
  object.materials =
      object_materials(object.surface ? with_tets_of_surface(asset, *object.surface, file_mesh) : asset, file_mesh,
                       checked.file.tet_sets, checked.file.materials, checked.report.kept_tets, files);
  require_numbers(object.mesh, object.materials, asset.file.string());
  if (object.surface) object.marks = object.surface->marks_at(object.mesh.vertices);
  object.fixed = flag(asset.fixed, 0);
  if (object.surface && object.surface->file().skeleton) {
    object.skeleton = skeleton_of_cage(*object.surface);
    if (!asset.fixed) pin_to_bones(object, object.surface->tree(), asset.object_mesh, "/skins");
  } else if (asset.object_skeleton) {
    object.skeleton = skeleton_of_tets(*asset.object_skeleton, checked, files);
    if (!asset.fixed)
      pin_to_bones(object, SurfaceTree(object.mesh.vertices, surface_triangles(object.mesh.tets)),
                   *asset.object_skeleton, "/weights");
  }
  if (asset.clamp_follows && !object.skeleton) object.skeleton = clamp_bone(object.mesh, object.fixed);
  object.contact = flag(asset.contact_vertices, 1);
  if (asset.training.loads)
    for (const ForceLoadConfig& force : asset.training.loads->forces)
      object.pushed.push_back(ids_of(flag(force.vertices, 0)));
  object.file_tets = checked.file_tets;
  object.kept_vertices = checked.report.kept_vertices;
  object.kept_tets = checked.report.kept_tets;
  object.file_positions = checked.file_vertices;
  return object;
}

ExampleInput read_examples(const AssetConfig& asset, const ObjectInput& object, InputFiles& files) {
  StageCache none;
  return read_examples(asset, object, files, none);
}

ExampleInput read_examples(const AssetConfig& asset, const ObjectInput& object, InputFiles& files, StageCache& cache) {
  return ExampleReader(asset, object, files, cache).read();
}

RenderData read_render_mesh(const AssetConfig& asset, const ObjectInput& object, InputFiles& files,
                            std::vector<std::string>& warnings) {
  const std::string name = asset.render_mesh->string();
  const bool is_object = object.surface && asset.render_mesh == asset.object_surface;
  SurfaceMesh surface =
      is_object ? object.surface->file().mesh : read_recorded_surface(*asset.render_mesh, asset, files).mesh;
  const Embedding embedding =
      is_object ? object.surface->embedding() : embed_points(object.mesh, surface.vertices, name);
  const double share = embedding.farthest / bounding_box_diagonal(object.mesh.vertices);
  if (share > kFarOutside) {
    warnings.push_back(
        fmt::format("{}: a vertex is {:.3g} m outside the object, {:.0f} % of the diagonal of its bounding box; does "
                    "the render mesh "
                    "stand where the object does, in metres?",
                    name, embedding.farthest, 100 * share));
    log::warning(warnings.back());
  }
  const auto& [tets, weights, distances] = embedding.points;
  RenderData render;
  render.vertices = std::move(surface.vertices);
  render.tets = tets;
  render.barycentric = weights;
  render.triangles = std::move(surface.triangles);
  render.outside = embedding.outside;
  render.farthest = embedding.farthest;
  render.bones.resize(render.tets.size(), 0);
  render.bone_weights.resize(render.tets.size(), 0);
  if (is_object && object.surface->file().skeleton) add_bones(object.surface->file().skeleton->weights, render);
  if (asset.object_skeleton) add_bones(weights_in_tets(embedding.points, object), render);
  add_look(asset, files, warnings, render);
  return render;
}

std::string hash_inputs(const InputFiles& files, const std::string& salt) {
  Sha256 hash;
  // With their lengths, so that no byte can change sides.
  for (const auto& path : files) hash.add(fmt::format("\n{} bytes\n", hash.add_file(path)));
  hash.add(salt);
  return hash.digest();
}

}  // namespace exmat::precompute
