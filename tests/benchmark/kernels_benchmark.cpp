#include <Eigen/Core>
#include <memory>

#include "runtime/scene/step_work.h"
#include "runtime/sim/step/vertex_positions.h"
#include "tests/benchmark/models.h"
#include "tests/benchmark/register.h"
#include "tests/support/random.h"

namespace exmat::benchmarks {
namespace {

using ::benchmark::DoNotOptimize;
using runtime::Kernels;
using runtime::ReducedElasticity;
using State = ::benchmark::State;

std::string sizes(int modes, int elements) { return "/r" + std::to_string(modes) + "/s" + std::to_string(elements); }

Eigen::VectorXd pose(Eigen::Index modes) { return 0.1 * test::random_vector(modes, 1); }

constexpr MaterialModel kMaterials[] = {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
                                        MaterialModel::kCorotational};

ReducedElasticity elasticity(MaterialModel material, int modes, int elements) {
  return ReducedElasticity(material, *bar_model(modes, elements).cubature);
}

void energy(State& state, MaterialModel material, int modes, int elements) {
  const ReducedElasticity kernel = elasticity(material, modes, elements);
  auto workspace = kernel.make_workspace();
  const Eigen::VectorXd q = pose(modes);
  for (auto _ : state) DoNotOptimize(kernel.energy(q, workspace));
  compare_with_dgemm(state, kernel.potential().force_flops() / 2);
}

void force(State& state, MaterialModel material, int modes, int elements) {
  const ReducedElasticity kernel = elasticity(material, modes, elements);
  auto workspace = kernel.make_workspace();
  const Eigen::VectorXd q = pose(modes);
  Eigen::VectorXd force(modes);
  for (auto _ : state) DoNotOptimize(kernel.force(q, workspace, force));
  compare_with_dgemm(state, kernel.potential().force_flops());
}

void force_and_stiffness(State& state, MaterialModel material, int modes, int elements) {
  const ReducedElasticity kernel = elasticity(material, modes, elements);
  auto workspace = kernel.make_workspace();
  const Eigen::VectorXd q = pose(modes);
  Eigen::VectorXd force(modes);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(modes, modes);
  for (auto _ : state) DoNotOptimize(kernel.force_and_stiffness(q, workspace, force, stiffness));
  compare_with_dgemm(state, kernel.potential().force_flops() + kernel.potential().stiffness_flops());
}

void polynomial(State& state, int modes) {
  const runtime::ReducedPolynomial kernel(*bar_model(modes, kElements[0]).polynomial);
  auto workspace = kernel.make_workspace();
  const Eigen::VectorXd q = pose(modes);
  Eigen::VectorXd force(modes);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(modes, modes);
  for (auto _ : state) DoNotOptimize(kernel.force_and_stiffness(q, workspace, force, stiffness));
  compare_with_dgemm(state, kernel.flops());
}

Eigen::MatrixXd positive_definite(Eigen::Index size) {
  const Eigen::MatrixXd random = test::random_matrix(size, size, 2);
  return random * random.transpose() + Eigen::MatrixXd::Identity(size, size);
}

void cholesky(State& state, int modes) {
  const Eigen::MatrixXd matrix = positive_definite(modes);
  runtime::AlignedArray factor(modes * runtime::padded(modes));
  for (auto _ : state) DoNotOptimize(runtime::kernels().cholesky(matrix.data(), modes, modes, factor.data()));
  compare_with_dgemm(state, modes * modes * modes / 3.0);
}

void solve(State& state, int modes) {
  const Eigen::MatrixXd matrix = positive_definite(modes);
  runtime::AlignedArray factor(modes * runtime::padded(modes)), x(modes);
  runtime::kernels().cholesky(matrix.data(), modes, modes, factor.data());
  for (auto _ : state) {
    std::fill_n(x.data(), modes, 1.0);
    runtime::kernels().cholesky_solve(factor.data(), modes, x.data());
    ::benchmark::ClobberMemory();
  }
  compare_with_dgemm(state, 2.0 * modes * modes);
}

const Eigen::Vector4d kWeights(0.4, 0.3, 0.2, 0.1), kNextWeights(0.399, 0.301, 0.2, 0.1);

void target_table(State& state, int modes) {
  const TargetTableData& data = *bar_model(modes, kElements[0]).targets;
  const runtime::TargetTable table(data);
  auto workspace = table.make_workspace();
  const Eigen::VectorXd weights = kWeights;
  Eigen::VectorXd target(modes);
  for (auto _ : state) {
    table.evaluate(weights, workspace, target);
    ::benchmark::ClobberMemory();
  }
  compare_with_dgemm(state, 2.0 * static_cast<double>(data.control_points.size()));
}

/// From the target of weights nearby, as one step leaves it to the next.
void target_solve(State& state, int modes, int elements) {
  const auto model = prepare(bar_model(modes, elements), Target::kSolve, false);
  const runtime::TargetSolver& solver = *model->examples.front().target;
  auto workspace = solver.make_workspace();
  const Eigen::VectorXd weights[2]{kWeights, kNextWeights};
  Eigen::VectorXd y(solver.dimension());
  solver.start(weights[0], y);
  solver.solve(weights[0], workspace, y);
  double flops = 0, iterations = 0;
  int turn = 0;
  for (auto _ : state) {
    const auto report = solver.solve(weights[++turn % 2], workspace, y);
    flops += target_flops(solver, report.iterations);
    iterations += report.iterations;
  }
  const auto count = static_cast<double>(state.iterations());
  state.counters["iterations_mean"] = iterations / count;
  compare_with_dgemm(state, flops / count);
}

void example_weights(State& state, int modes) {
  const ExampleSet& set = *bar_model(modes, kElements[0]).examples;
  const runtime::ExampleWeights kernel(set.gram, set.h0, set.hq);
  auto workspace = kernel.make_workspace();
  Eigen::VectorXd q = Eigen::VectorXd::Zero(modes), weights(kExamples);
  for (std::size_t k = 0; k < kExamples; ++k) q += kWeights[static_cast<Eigen::Index>(k)] * set.examples[k].pose;
  for (auto _ : state) {
    kernel.solve(q, workspace, weights);
    ::benchmark::ClobberMemory();
  }
  compare_with_dgemm(state, 2.0 * kExamples * (modes + kExamples));
}

void positions(State& state, int modes, int points) {
  const runtime::VertexPositions kernel(test::random_matrix(points, 3, 3), test::random_matrix(3 * points, modes, 4));
  auto workspace = runtime::VertexPositions::make_workspace(modes);
  const Eigen::VectorXd q = pose(modes);
  std::vector<float> xyz(static_cast<std::size_t>(3 * points));
  for (auto _ : state) {
    kernel.evaluate(q, workspace, xyz.data());
    ::benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(kernel.bytes()) * state.iterations());
  compare_with_dgemm(state, 6.0 * points * modes);
}

}  // namespace

void register_kernels() {
  for (const int r : kModes) {
    const std::string size = "/r" + std::to_string(r);
    for (const int s : kElements) {
      for (const MaterialModel material : kMaterials) {
        const std::string own =
            material == MaterialModel::kStVenantKirchhoff ? "" : "_" + std::string(name_of(material));
        add("kernel/energy" + own + sizes(r, s), [=](State& state) { energy(state, material, r, s); });
        add("kernel/force" + own + sizes(r, s), [=](State& state) { force(state, material, r, s); });
        add("kernel/force_and_stiffness" + own + sizes(r, s),
            [=](State& state) { force_and_stiffness(state, material, r, s); });
      }
      add("kernel/target_solve" + sizes(r, s), [=](State& state) { target_solve(state, r, s); });
    }
    add("kernel/polynomial" + size, [=](State& state) { polynomial(state, r); });
    add("kernel/cholesky" + size, [=](State& state) { cholesky(state, r); });
    add("kernel/solve" + size, [=](State& state) { solve(state, r); });
    add("kernel/target_table" + size, [=](State& state) { target_table(state, r); });
    add("kernel/weights" + size, [=](State& state) { example_weights(state, r); });
    for (const int points : {1000, 100000})
      add("kernel/positions_" + std::to_string(points) + size, [=](State& state) { positions(state, r, points); });
  }
}

}  // namespace exmat::benchmarks
