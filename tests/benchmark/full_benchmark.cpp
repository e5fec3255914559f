#include <filesystem>
#include <map>

#include "common/mesh/geometry.h"
#include "precompute/mesh_io/mesh_file.h"
#include "runtime/sim/space/full/full_step.h"
#include "tests/benchmark/register.h"

namespace exmat::benchmarks {
namespace {

constexpr int kCycle = 500;

/// A body of the examples with all vertices, pushed where it is farthest from its clamp; 4 ms, BDF2, damped.
struct FullBody {
  runtime::FullModel model;
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
    model = runtime::FullModel(runtime::FullSpace(mesh, materials, fixed));
    Eigen::Index farthest = 0;
    (mesh.vertices * axis).maxCoeff(&farthest);
    const Eigen::Index place = 3 * (farthest - fixed.head(farthest).cast<Eigen::Index>().sum());
    scene.time_step = 0.004;
    scene.gravity = {0, 0, -1};
    scene.mass_damping = 0.2;
    scene.stiffness_damping = 0.01;
    runtime::ScriptedForce& force = scene.forces.emplace_back();
    force.on_vertices = Eigen::VectorXd::Zero(model.space.size());
    force.on_vertices.segment<3>(place) = push * Eigen::Vector3d(0, 1, 0.5);
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

/// On a floor below its free half, with a push that slides it there.
struct OnFloor {
  FullBody body;
  runtime::ContactSet set;

  explicit OnFloor(const FullBody& of) : body(of) {
    const TetMesh mesh =
        precompute::read_mesh(std::filesystem::path(EXMAT_SOURCE_DIR) / "examples/01_twisted_bar/bar.msh").mesh;
    ContactData data;
    const TriangleArray surface = surface_triangles(mesh.tets);
    std::map<std::int32_t, double> areas;
    for (Eigen::Index f = 0; f < surface.rows(); ++f) {
      const Eigen::RowVector3d a = mesh.vertices.row(surface(f, 0)), b = mesh.vertices.row(surface(f, 1)),
                               c = mesh.vertices.row(surface(f, 2));
      for (int i = 0; i < 3; ++i)
        if (body.model.space.place(surface(f, i)) >= 0) areas[surface(f, i)] += (b - a).cross(c - a).norm() / 6;
    }
    data.vertices.resize(std::ssize(areas));
    data.areas.resize(data.vertices.size());
    data.positions.resize(data.vertices.size(), 3);
    Eigen::Index k = 0;
    for (const auto& [vertex, area] : areas) {
      data.vertices[k] = vertex;
      data.areas[k] = area;
      data.positions.row(k++) = mesh.vertices.row(vertex);
    }
    data.basis.setZero(3 * k, 1);
    set = runtime::ContactSet(data);
    body.model.contacts.emplace(set, body.model.space, Eigen::Vector3d::Zero());
    const Eigen::Vector3d below(0, 0, mesh.vertices.col(2).minCoeff() - 0.02);
    body.scene.obstacles = {runtime::Obstacle{runtime::Plane{below, Eigen::Vector3d::UnitZ()}, {}, 1e6, 1e4, 0.4}};
    body.scene.gravity = {0, 0, -9.81};
  }
};

void time_full_steps_on_a_floor(::benchmark::State& state, const OnFloor& on) {
  runtime::FullWorkspace workspace(on.body.model, on.body.scene, runtime::kRealTime);
  const runtime::State start = make_state(on.body.model, workspace);
  runtime::ContactWorkspace contact(on.set, 1);
  runtime::State one = start;
  one.contacts = on.set.make_state(1);
  for (int i = 0; i < 100; ++i) step(on.body.model, on.body.scene, one, workspace, {&one.contacts, &contact});
  std::int64_t iterations = 0, touching = 0;
  for (auto _ : state) {
    const runtime::FullReport report = step(on.body.model, on.body.scene, one, workspace, {&one.contacts, &contact});
    iterations += report.cg_iterations;
    touching += report.contacts;
  }
  state.counters["cg_iterations"] = static_cast<double>(iterations) / static_cast<double>(state.iterations());
  state.counters["touching"] = static_cast<double>(touching) / static_cast<double>(state.iterations());
}

void time_full_steps(::benchmark::State& state, const FullBody& body, const runtime::FullAccuracy& accuracy,
                     const runtime::NewtonSettings& newton) {
  runtime::StepScene scene = body.scene;
  scene.space.newton = newton;
  runtime::FullWorkspace workspace(body.model, scene, accuracy);
  const runtime::State start = make_state(body.model, workspace);
  runtime::State one = start;
  int steps = 0;
  std::int64_t iterations = 0;
  for (auto _ : state) {
    if (steps++ == kCycle) {
      one = start;
      steps = 1;
    }
    iterations += step(body.model, scene, one, workspace).cg_iterations;
  }
  state.counters["cg_iterations"] = static_cast<double>(iterations) / static_cast<double>(state.iterations());
}

}  // namespace

void register_full_space() {
  add("full/bar/floor", [](::benchmark::State& state) {
    static const OnFloor on(bar());
    time_full_steps_on_a_floor(state, on);
  });
  for (const auto& [name, body] : {std::pair{"bar", &bar}, std::pair{"teddy", &teddy}}) {
    const auto of = body;
    add(std::string("full/") + name + "/real_time", [of](::benchmark::State& state) {
      time_full_steps(state, of(), runtime::kRealTime, runtime::SpaceSettings{}.newton);
    });
    add(std::string("full/") + name + "/1e-6", [of](::benchmark::State& state) {
      time_full_steps(state, of(), {}, {20, 1e-6});
    });
  }
}

}  // namespace exmat::benchmarks
