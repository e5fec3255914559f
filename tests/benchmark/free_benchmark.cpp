#include <fmt/format.h>
#include <memory>

#include "tests/benchmark/models.h"
#include "tests/benchmark/register.h"
#include "tests/benchmark/steps.h"
#include "tests/support/surfaces.h"

namespace exmat::benchmarks {
namespace {

constexpr double kSpin = 2;        // [rad/s]
constexpr double kFlyingAt = 100;  // [m] above the floor

/// The lower side of the bar, its vertices taken again and again until there are `count` that share its area.
ContactData underside(const ReducedModel& model, int count) {
  const ContactData all = test::surface_contact(model);
  const double lowest = all.positions.col(2).minCoeff();
  std::vector<Eigen::Index> low;
  for (Eigen::Index i = 0; i < all.areas.size(); ++i)
    if (all.positions(i, 2) < lowest + 1e-9) low.push_back(i);
  ContactData data{IndexVector(count), VertexArray(count, 3), Eigen::VectorXd(count),
                   RowMatrix(3 * count, all.basis.cols())};
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index from = low[static_cast<std::size_t>(i) % low.size()];
    data.vertices[i] = all.vertices[from];
    data.positions.row(i) = all.positions.row(from);
    data.areas[i] = all.areas[from] * static_cast<double>(low.size()) / count;
    data.basis.middleRows<3>(3 * i) = all.basis.middleRows<3>(3 * from);
  }
  return data;
}

/// With examples, spinning.
void time_flight(::benchmark::State& state, int modes, int elements) {
  const auto model = prepare(bar_model(modes, elements, true), Target::kTable, false);
  runtime::StepScene scene = swing(*model, Target::kTable);
  scene.gravity = Eigen::Vector3d(0, -3, 0);
  runtime::State start = make_state(*model);
  runtime::FrameMotion motion;
  motion.angular_velocity = kSpin * Eigen::Vector3d(0.3, 0.9, 0.2).normalized();
  set_motion(*model, motion, start);
  time_steps(state, *model, scene, start);
}

/// Floors whose top is at this height below the middle of the bar.
enum class Floor { kPlane, kBox, kMesh, kHeightField };

runtime::Shape floor_of(Floor kind, double height) {
  constexpr double kHalf = 4;
  constexpr int kCells = 40;
  const runtime::Box box{{0, 0, height - 0.5}, {kHalf, kHalf, 0.5}, Eigen::Matrix3d::Identity()};
  switch (kind) {
    case Floor::kPlane:
      return runtime::Plane{Eigen::Vector3d(0, 0, height), Eigen::Vector3d::UnitZ()};
    case Floor::kBox:
      return box;
    case Floor::kMesh: {
      SurfaceMesh surface = test::box_surface({kCells, kCells, 2}, {2 * kHalf, 2 * kHalf, 1});
      surface.vertices.rowwise() -= box.half_extents.transpose();
      return runtime::MeshShape{std::make_shared<runtime::RigidMesh>(surface.vertices, surface.triangles, 0),
                                box.centre};
    }
    case Floor::kHeightField: {
      const Eigen::Vector2d spacing = Eigen::Vector2d::Constant(2 * kHalf / kCells);
      return runtime::HeightFieldShape{
          std::make_shared<runtime::HeightField>(RowMatrix::Constant(kCells + 1, kCells + 1, height), spacing),
          Eigen::Vector3d(-kHalf, -kHalf, 0)};
    }
  }
  return box;
}

/// On a floor, or high above it; no examples.
void time_contact(::benchmark::State& state, int vertices, bool flying, Floor kind = Floor::kPlane) {
  ReducedModel data = bar_model(20, 30, true);
  data.contact = underside(data, vertices);
  const auto model = prepare(data, Target::kNone, false);
  runtime::StepScene scene = swing(*model, Target::kNone);
  scene.gravity = Eigen::Vector3d(0, 0, -9.81);
  const double floor = data.contact->positions.col(2).minCoeff() - (flying ? kFlyingAt : 0);
  scene.obstacles.push_back(runtime::Obstacle{floor_of(kind, floor), runtime::RigidMotion(), 1e6, 1e3, 0.5});
  runtime::State start = make_state(*model);
  runtime::prepare_contacts(*model, 1, start);
  time_steps(state, *model, scene, start);
  state.counters["near_vertices"] = flying ? 0 : vertices;
}

}  // namespace

void register_free_bodies() {
  for (const auto& [modes, elements] : {std::pair{20, 23}, {30, 60}, {42, 23}})
    add(fmt::format("free/r{}/s{}", modes, elements),
        [=](::benchmark::State& state) { time_flight(state, modes, elements); });
  add("contact/away/1000", [](::benchmark::State& state) { time_contact(state, 1000, true); });
  for (const int vertices : {4, 30, 100, 300, 1000})
    add(fmt::format("contact/near/{}", vertices),
        [=](::benchmark::State& state) { time_contact(state, vertices, false); });
  for (const auto& [name, kind] : {std::pair{"plane", Floor::kPlane},
                                   {"box", Floor::kBox},
                                   {"mesh", Floor::kMesh},
                                   {"height_field", Floor::kHeightField}})
    add(fmt::format("ground/{}/100", name),
        [=, shape = kind](::benchmark::State& state) { time_contact(state, 100, false, shape); });
}

}  // namespace exmat::benchmarks
