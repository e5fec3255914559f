#include <filesystem>

#include "precompute/mesh_io/mesh_file.h"
#include "runtime/sim/space/full/full_step.h"
#include "tests/benchmark/register.h"

namespace exmat::benchmarks {
namespace {

constexpr int kCycle = 500;

/// A body of the examples with all vertices, pushed where it is farthest from its clamp; 4 ms, BDF2, damped.
struct FullBody {
  runtime::FullSpace space;
  runtime::StepScene scene;

  FullBody(const char* file, double youngs_modulus, double density, double push,
           bool (*clamped)(const Eigen::Vector3d&), const Eigen::Vector3d& axis) {
    const TetMesh mesh = precompute::read_mesh(std::filesystem::path(EXMAT_SOURCE_DIR) / "examples" / file).mesh;
    const Eigen::Index tets = mesh.tet_count();
    TetMaterials materials;
    materials.density = Eigen::VectorXd::Constant(tets, density);
    materials.youngs_modulus = Eigen::VectorXd::Constant(tets, youngs_modulus);
    materials.poisson_ratio = Eigen::VectorXd::Constant(tets, 0.4);
    materials.model = MaterialModel::kStableNeoHookean;
    materials.formulation = Formulation::kSmoothed;
    materials.variance_factor = kVarianceFactor;
    FlagVector fixed(mesh.vertex_count());
    for (Eigen::Index v = 0; v < fixed.size(); ++v) fixed[v] = clamped(mesh.vertices.row(v).transpose()) ? 1 : 0;
    space = runtime::FullSpace(mesh, materials, fixed);
    Eigen::Index farthest = 0;
    (mesh.vertices * axis).maxCoeff(&farthest);
    const Eigen::Index place = 3 * (farthest - fixed.head(farthest).cast<Eigen::Index>().sum());
    scene.time_step = 0.004;
    scene.gravity = {0, 0, -1};
    scene.mass_damping = 0.2;
    scene.stiffness_damping = 0.01;
    scene.newton = runtime::kRealTimeNewton;
    runtime::ScriptedForce& force = scene.forces.emplace_back();
    force.force = Eigen::VectorXd::Zero(space.size());
    force.force.segment<3>(place) = push * Eigen::Vector3d(0, 1, 0.5);
    force.start = 0.2;
    force.end = 1;
  }
};

const FullBody& bar() {
  static const FullBody body(
      "01_twisted_bar/bar.msh", 1e6, 1000, 2000, [](const Eigen::Vector3d& x) { return x[0] < 0.01; },
      Eigen::Vector3d::UnitX());
  return body;
}

const FullBody& teddy() {
  static const FullBody body(
      "07_teddy_global/object.msh", 1e5, 300, 4,
      [](const Eigen::Vector3d& x) {
        return std::abs(x[0]) <= 0.4 && x[1] >= 0.3 && x[1] <= 0.5 && x[2] >= 0.5 && x[2] <= 1.4;
      },
      Eigen::Vector3d::UnitX());
  return body;
}

void time_full_steps(::benchmark::State& state, const FullBody& body, const runtime::FullAccuracy& accuracy,
                     const runtime::NewtonSettings& newton) {
  runtime::StepScene scene = body.scene;
  scene.newton = newton;
  runtime::FullWorkspace workspace(body.space, scene, accuracy);
  const runtime::State start = make_state(body.space, workspace);
  runtime::State one = start;
  int steps = 0;
  std::int64_t iterations = 0;
  for (auto _ : state) {
    if (steps++ == kCycle) {
      one = start;
      steps = 1;
    }
    iterations += step(body.space, scene, one, workspace).cg_iterations;
  }
  state.counters["cg_iterations"] = static_cast<double>(iterations) / static_cast<double>(state.iterations());
}

}  // namespace

void register_full_space() {
  for (const auto& [name, body] : {std::pair{"bar", &bar}, std::pair{"teddy", &teddy}}) {
    const auto of = body;
    add(std::string("full/") + name + "/real_time", [of](::benchmark::State& state) {
      time_full_steps(state, of(), runtime::kRealTime, runtime::kRealTimeNewton);
    });
    add(std::string("full/") + name + "/1e-6", [of](::benchmark::State& state) {
      time_full_steps(state, of(), {}, {20, 1e-6});
    });
  }
}

}  // namespace exmat::benchmarks
