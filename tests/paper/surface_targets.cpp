#include "tests/paper/surface_targets.h"

#include <algorithm>
#include <memory>

#include "tests/paper/minimiser.h"

namespace exmat::precompute {
namespace {

constexpr double kTolerance = 1e-6;

// Vertices of the surface, ascending.
std::vector<std::int32_t> surface_vertices_of(const TriangleArray& surface) {
  std::vector<std::int32_t> vertices(surface.data(), surface.data() + surface.size());
  std::ranges::sort(vertices);
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

TriangleArray renumbered(const TriangleArray& surface) {
  const std::vector<std::int32_t> vertices = surface_vertices_of(surface);
  return surface.unaryExpr([&](std::int32_t vertex) {
    return static_cast<std::int32_t>(std::ranges::lower_bound(vertices, vertex) - vertices.begin());
  });
}

}  // namespace

SurfaceTargets::SurfaceTargets(const ObjectData& object, const ElasticSystem& system, const FullSpaceExamples& examples,
                               const SurfaceWeights& weights)
    : energy_(renumbered(object.surface), weights) {
  const std::vector<std::int32_t> vertices = surface_vertices_of(object.surface);
  rest_ = object.mesh.vertices(vertices, Eigen::all);
  const Eigen::MatrixXd all = system.extend(examples.pose_basis());
  fields_.resize(rest_.size(), all.cols());
  for (std::size_t i = 0; i < vertices.size(); ++i)
    fields_.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = all.middleRows<3>(3 * vertices[i]);
  for (Eigen::Index k = 0; k < examples.count(); ++k) {
    poses_.push_back(examples.pose(k));
    shapes_.push_back(energy_.shape(reconstruct(poses_.back())));
  }
  for (Eigen::Index k = 1; k < examples.count(); ++k) {
    Eigen::VectorXd gradient;
    energy(Eigen::VectorXd::Unit(examples.count(), 0), pose(k), gradient);
    gradient_tolerance_ = std::max(gradient_tolerance_, kTolerance * gradient.norm());
  }
}

VertexArray SurfaceTargets::reconstruct(const Eigen::VectorXd& z) const {
  VertexArray positions = rest_;
  Eigen::Map<Eigen::VectorXd>(positions.data(), positions.size()).noalias() += fields_ * z;
  return positions;
}

double SurfaceTargets::evaluate(const SurfaceEnergy::Blend& blend, const Eigen::VectorXd& z,
                                Eigen::VectorXd& gradient) const {
  VertexArray by_vertex;
  const double value = energy_.evaluate(blend, reconstruct(z), by_vertex);
  gradient.noalias() = fields_.transpose() * Eigen::Map<const Eigen::VectorXd>(by_vertex.data(), by_vertex.size());
  return value;
}

double SurfaceTargets::energy(const Eigen::VectorXd& weights, const Eigen::VectorXd& z,
                              Eigen::VectorXd& gradient) const {
  return evaluate(SurfaceEnergy::blend(shapes_, weights), z, gradient);
}

SurfaceTargets::Solved SurfaceTargets::solve(const Eigen::VectorXd& weights, Eigen::VectorXd& z) const {
  const SurfaceEnergy::Blend blend = SurfaceEnergy::blend(shapes_, weights);
  const MinimiserReport report =
      minimise([&](const Eigen::VectorXd& at, Eigen::VectorXd& gradient) { return evaluate(blend, at, gradient); },
               {.gradient_tolerance = gradient_tolerance_}, z);
  return {report.converged, report.iterations};
}

void use_surface_targets(const ObjectData& object, FullSpaceModel& model) {
  for (const FullSpaceExamples& examples : model.examples)
    model.target_methods.push_back(std::make_shared<SurfaceTargets>(object, model.system, examples));
}

}  // namespace exmat::precompute
