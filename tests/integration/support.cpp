#include "tests/integration/support.h"

#include <cmath>
#include <cstdlib>
#include <fcntl.h>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/mesh/geometry.h"
#include "precompute/study/measure/runs.h"
#include "tests/support/box_mesh.h"

namespace exmat::test {
namespace {

constexpr int kNoSuchProgram = 127;

const Json kBarAsset = Json::parse(R"({
  "name": "bar",
  "object": {
    "mesh": "bar.msh",
    "material": { "model": "stvk", "youngs_modulus": 1e6, "poisson_ratio": 0.4, "density": 1000 },
    "fixed": { "box": { "min": [-1e-6, -1, -1], "max": [1e-6, 2, 2] } }
  },
  "shape_space": { "eigenfunctions": 20 },
  "examples": [ { "name": "rest", "mesh": "rest.msh", "rest": true }, { "name": "twist", "mesh": "twist.msh" } ],
  "basis": { "size": 30, "linear_modes": 15, "training": "none" },
  "cubature": { "elements": 60 }
})");

const Json kSmall = Json::parse(R"({
  "shape_space": { "eigenfunctions": 6 },
  "basis": { "size": 8, "linear_modes": 5 },
  "cubature": { "elements": 12, "training_poses": 40 }
})");

std::filesystem::path write_bar_files(const TemporaryFolder& folder, const BarFiles& bar,
                                      const std::vector<Json>& asset_patches) {
  write_msh(folder.path("bar.msh"), box_mesh(bar.cells, bar.lengths));
  TetMesh example = box_mesh(bar.example_cells, bar.lengths);
  write_msh(folder.path("rest.msh"), example);
  example.vertices = twisted(example.vertices, bar) * bar.pose_rotation.transpose();
  write_msh(folder.path("twist.msh"), example);
  Json asset = Json::object();
  for (const Json& patch : asset_patches) asset.merge_patch(patch);
  return folder.write("asset.json", asset.dump(2));
}

int exit_status(int wait_status) {
  return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);
}

}  // namespace

Outcome execute(const std::filesystem::path& program, const std::vector<std::string>& arguments) {
  const TemporaryFolder folder;
  const auto output = folder.path("output"), errors = folder.path("errors");
  posix_spawn_file_actions_t redirections;
  posix_spawn_file_actions_init(&redirections);
  posix_spawn_file_actions_addopen(&redirections, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&redirections, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_addopen(&redirections, STDERR_FILENO, errors.c_str(), O_WRONLY | O_CREAT, 0600);
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t child = 0;
  const int failure = posix_spawnp(&child, argv[0], &redirections, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&redirections);
  if (failure != 0) return {kNoSuchProgram, "", ""};
  int wait_status = 0;
  EXPECT_EQ(waitpid(child, &wait_status, 0), child);
  return {exit_status(wait_status), read_file(output), read_file(errors)};
}

Outcome exmat_precompute(const std::vector<std::string>& arguments) {
  return execute(EXMAT_BINARY_DIR "/bin/exmat-precompute", arguments);
}

Outcome exmat_runtime(const std::vector<std::string>& arguments) {
  return execute(EXMAT_BINARY_DIR "/bin/exmat-runtime", arguments);
}

VertexArray twisted(const VertexArray& vertices, const BarFiles& bar) {
  VertexArray posed = vertices;
  const double y0 = bar.lengths[1] / 2, z0 = bar.lengths[2] / 2;
  for (auto x : posed.rowwise()) {
    const double angle = bar.twist * x[0] / bar.lengths[0], y = x[1] - y0, z = x[2] - z0;
    x[1] = y0 + std::cos(angle) * y - std::sin(angle) * z;
    x[2] = z0 + std::sin(angle) * y + std::cos(angle) * z;
    if (bar.bend == 0) continue;
    const double radius = bar.lengths[0] / bar.bend, turn = bar.bend * x[0] / bar.lengths[0], away = radius + z0 - x[2];
    x[0] = away * std::sin(turn);
    x[2] = z0 + radius - away * std::cos(turn);
  }
  return posed;
}

std::filesystem::path write_bar(const TemporaryFolder& folder, const BarFiles& bar, const Json& changes) {
  return write_bar_files(folder, bar, {kBarAsset, changes});
}

std::filesystem::path write_small_bar(const TemporaryFolder& folder, const Json& changes) {
  return write_bar_files(folder, {.cells = {8, 2, 1}, .example_cells = {6, 2, 2}}, {kBarAsset, kSmall, changes});
}

std::vector<int> end_vertices(const VertexArray& vertices) {
  const double end = vertices.col(0).maxCoeff() - 1e-9;
  std::vector<int> ids;
  for (Eigen::Index v = 0; v < vertices.rows(); ++v)
    if (vertices(v, 0) >= end) ids.push_back(static_cast<int>(v));
  return ids;
}

void write_msh(const std::filesystem::path& path, const TetMesh& mesh) {
  std::string text = fmt::format("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    text += fmt::format("{} {} {} {}\n", v + 1, mesh.vertices(v, 0), mesh.vertices(v, 1), mesh.vertices(v, 2));
  text += fmt::format("$EndNodes\n$Elements\n{}\n", mesh.tet_count());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    text += fmt::format("{} 4 2 1 1", t + 1);
    for (const int vertex : mesh.tets.row(t)) text += fmt::format(" {}", vertex + 1);
    text += '\n';
  }
  std::ofstream(path, std::ios::binary) << text << "$EndElements\n";
}

Built build(const std::filesystem::path& asset, const std::optional<Needs>& needs) {
  const AssetConfig config = load_asset(asset);
  Built built;
  built.model = precompute::build_reduced_model(config, precompute::resolve_needs(config, needs), built.report);
  return built;
}

ReducedModel through_bundle(const ReducedModel& model, const std::filesystem::path& path) {
  write_bundle(model, path);
  return read_bundle(path);
}

std::filesystem::path write_scene(const TemporaryFolder& folder, const Json& members) {
  Json scene = {{"bundle", "bundle.h5"}};
  scene.merge_patch(members);
  return folder.write("scene.json", scene.dump(2));
}

MotionError error_against_full_space(const std::filesystem::path& scene, int frames, int every) {
  SceneConfig config = load_scene(scene);
  config.trajectory = "positions";  // that the run loads, and never writes
  const ReducedModel data = read_bundle(config.bundle);
  std::vector<double> times;
  for (int i = 1; i <= frames; ++i) times.push_back(every * i * config.time_step);
  const auto reduced = precompute::run_reduced(config, times).frames;
  const auto full = precompute::run_full_space(config, data, times);
  double distance = 0, size = 0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    distance += (reduced.positions[i] - full.positions[i]).squaredNorm();
    size += (full.positions[i] - data.object->mesh.vertices).squaredNorm();
  }
  return {std::sqrt(distance / size), std::sqrt(size / static_cast<double>(frames * data.object->mesh.vertex_count()))};
}

double mass_product(const TetMesh& mesh, const Eigen::VectorXd& density, const Eigen::VectorXd& a,
                    const Eigen::VectorXd& b) {
  const Eigen::VectorXd masses = tet_volumes(mesh).cwiseProduct(density);
  double product = 0;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    Eigen::Vector3d a_sum = Eigen::Vector3d::Zero(), b_sum = Eigen::Vector3d::Zero();
    double corners = 0;
    for (const int vertex : mesh.tets.row(t)) {
      a_sum += a.segment<3>(3 * vertex);
      b_sum += b.segment<3>(3 * vertex);
      corners += a.segment<3>(3 * vertex).dot(b.segment<3>(3 * vertex));
    }
    product += masses[t] / 20 * (a_sum.dot(b_sum) + corners);
  }
  return product;
}

}  // namespace exmat::test
