#include "precompute/pipeline/inputs.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fstream>
#include <memory>
#include <openssl/evp.h>

#include "common/core/error.h"
#include "common/core/log.h"
#include "common/mesh/checks.h"
#include "common/mesh/geometry.h"
#include "precompute/mesh_io/mesh_file.h"
#include "precompute/mesh_io/vertex_selection.h"
#include "precompute/pipeline/object_materials.h"

namespace exmat::precompute {
namespace {

constexpr double kInvertedLimit = 0.05;

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

MeshFile read_recorded(const std::filesystem::path& path, InputFiles& files) {
  MeshFile file = read_mesh(path);
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

// 1 for the selected vertices, whose ids are the file's; `absent` for all where none are selected.
FlagVector flag(const std::optional<VertexSelection>& selection, std::uint8_t absent, const AssetConfig& asset,
                const CheckedMesh& checked, InputFiles& files) {
  if (!selection) return FlagVector::Constant(checked.file.mesh.vertex_count(), absent);
  FlagVector in_file = FlagVector::Zero(checked.file_vertices.rows());
  for (const auto vertex : select_vertices(checked.file_vertices, *selection, asset.file.string())) in_file[vertex] = 1;
  if (const auto* file = std::get_if<FileSelection>(&*selection)) files.push_back(file->file);
  return in_file(checked.report.kept_vertices);
}

VertexArray posed_vertices(const VertexArray& file_vertices, const std::vector<std::int32_t>& kept) {
  return file_vertices(kept, Eigen::all);
}

PoseInput make_pose(const ExampleConfig& example, const VertexArray& vertices, const TetArray& tets) {
  if (!vertices.allFinite())
    throw InputError({example.mesh.string(), "vertices", "finite numbers", "NaN or infinity", "export the pose again"});
  const Eigen::VectorXd volumes = tet_volumes({vertices, tets});
  const double inverted = -volumes.cwiseMin(0).sum();
  const double total = volumes.cwiseAbs().sum();
  PoseInput pose{example.name, vertices, inverted / total};
  if (pose.inverted_fraction > kInvertedLimit)
    throw InputError({example.mesh.string(), "tets", "a pose that turns less than 5 % of the volume inside out",
                      fmt::format("{:.1f} %", 100 * pose.inverted_fraction), "mend the pose"});
  if (inverted > 0)
    log::warning(
        fmt::format("example {}: {:.2f} % of its volume is inverted", example.name, 100 * pose.inverted_fraction));
  return pose;
}

}  // namespace

ObjectInput read_object(const AssetConfig& asset, InputFiles& files) {
  const auto checked = check(read_recorded(asset.object_mesh, files), asset.object_mesh, asset.object_drop);
  ObjectInput object;
  object.mesh = checked.file.mesh;
  const TetMesh file_mesh{checked.file_vertices,
                          Eigen::Map<const TetArray>(checked.file_tets.data(), std::ssize(checked.file_tets) / 4, 4)};
  object.materials = object_materials(asset, file_mesh, checked.file.materials, checked.report.kept_tets, files);
  object.fixed = flag(asset.fixed, 0, asset, checked, files);
  object.contact = flag(asset.contact_vertices, 1, asset, checked, files);
  object.file_tets = checked.file_tets;
  object.kept_vertices = checked.report.kept_vertices;
  object.kept_tets = checked.report.kept_tets;
  return object;
}

ExampleInput read_examples(const AssetConfig& asset, const ObjectInput& object, InputFiles& files) {
  ExampleInput input{true, "rest", object.mesh, {}};
  std::vector<std::int32_t> rest_file_tets = object.file_tets, kept_vertices = object.kept_vertices;
  for (const auto& example : asset.examples) {
    if (!example.rest) continue;
    const auto checked = check(read_recorded(example.mesh, files), example.mesh, example.drop);
    input = {false, example.name, checked.file.mesh, {}};
    rest_file_tets = checked.file_tets;
    kept_vertices = checked.report.kept_vertices;
  }
  for (const auto& example : asset.examples) {
    if (example.rest) continue;
    if (input.object_is_rest && example.name == input.rest_name) input.rest_name = "object_rest";
    const MeshFile file = read_recorded(example.mesh, files);
    if (flat_tets(file.mesh.tets) != rest_file_tets)
      throw InputError(
          {example.mesh.string(), "tets",
           "the connectivity of " + (input.object_is_rest ? "the object" : "the rest example " + input.rest_name),
           "another mesh", "pose the rest example's own mesh; this version does not register poses on other meshes"});
    if (file.mesh.vertex_count() <= *std::max_element(kept_vertices.begin(), kept_vertices.end()))
      throw InputError({example.mesh.string(), "vertices", "as many as its rest example",
                        std::to_string(file.mesh.vertex_count()), "export the pose again"});
    input.poses.push_back(make_pose(example, posed_vertices(file.mesh.vertices, kept_vertices), input.rest.tets));
  }
  return input;
}

std::string hash_inputs(const InputFiles& files, const std::string& salt) {
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
  EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr);
  std::vector<char> buffer(1 << 20);
  for (const auto& path : files) {
    std::ifstream stream(path, std::ios::binary);
    if (!stream) throw InputError({path.string(), "", "a readable file", "none", "check the path"});
    while (stream.read(buffer.data(), static_cast<std::streamsize>(buffer.size())), stream.gcount() > 0)
      EVP_DigestUpdate(context.get(), buffer.data(), static_cast<std::size_t>(stream.gcount()));
  }
  EVP_DigestUpdate(context.get(), salt.data(), salt.size());
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  EVP_DigestFinal_ex(context.get(), digest.data(), &size);
  std::string text;
  for (unsigned i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
  return text;
}

}  // namespace exmat::precompute
