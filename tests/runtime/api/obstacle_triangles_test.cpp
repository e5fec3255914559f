#include <Eigen/Geometry>
#include <array>
#include <gtest/gtest.h>
#include <vector>

#include "common/bundle/bundle.h"
#include "exmat/exmat.hpp"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

/// Triangles of obstacles, and the cost of a push, as hosts read them.
class ObstacleReading : public ::testing::Test {
 protected:
  ObstacleReading() {
    bar_.model.contact = test::surface_contact(bar_.model);
    write_bundle(bar_.model, folder_ / "bar.h5");
  }
  exmat::Model model() const {
    exmat_settings settings = default_settings();
    settings.use_contact = 1;
    return {(folder_ / "bar.h5").string(), settings};
  }
  static Eigen::Vector3d corner(const std::vector<double>& corners, std::size_t number) {
    return Eigen::Vector3d(corners.data() + 3 * number);
  }

  test::Bar bar_ = test::make_bar();
  test::TemporaryFolder folder_;
};

// A slab of 2 x 3 x 0.5 m: by the divergence theorem, and its faces' areas.
TEST_F(ObstacleReading, TrianglesOfAMeshEncloseItWhereItStands) {
  const std::vector<double> vertices{0, 0, 0, 2, 0, 0, 0, 3, 0, 2, 3, 0, 0, 0, 0.5, 2, 0, 0.5, 0, 3, 0.5, 2, 3, 0.5};
  const std::vector<std::int32_t> triangles{0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                            2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  const exmat::Model model = this->model();
  exmat::Body body(model);
  exmat_obstacle placed = default_obstacle();
  placed.point[1] = 7;
  placed.orientation[0] = placed.orientation[2] = std::sqrt(0.5);  // z becomes x
  const std::int64_t id = body.world().add_shape(exmat::Shape::mesh(vertices, triangles), placed);
  exmat_motion motion{};
  motion.position[2] = 100;  // is not that of the obstacle's frame
  motion.orientation[0] = 1;
  body.world().move_obstacle(id, motion);
  const std::vector<double> corners = body.world().obstacle_triangles(id);
  ASSERT_EQ(corners.size(), 9 * 12U);
  double volume = 0, area = 0;
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < 36; i += 3) {
    const Eigen::Vector3d a = corner(corners, i), b = corner(corners, i + 1), c = corner(corners, i + 2);
    volume += a.dot(b.cross(c)) / 6;
    area += (b - a).cross(c - a).norm() / 2;
    box.extend(a).extend(b).extend(c);
  }
  EXPECT_NEAR(volume, 3, 1e-12);
  EXPECT_NEAR(area, 2 * (6 + 1 + 1.5), 1e-12);
  EXPECT_LE((box.min() - Eigen::Vector3d(0, 7, -2)).norm(), 1e-12);
  EXPECT_LE((box.max() - Eigen::Vector3d(0.5, 10, 0)).norm(), 1e-12);
}

TEST_F(ObstacleReading, TrianglesOfGroundAreItsCells) {
  constexpr int kColumns = 4, kRows = 3;
  std::vector<double> heights;
  for (int i = 0; i < kColumns * kRows; ++i) heights.push_back(std::sin(i));
  const exmat::Model model = this->model();
  exmat::Body body(model);
  const std::int64_t id =
      body.world().add_shape(exmat::Shape::height_field(heights, kColumns, {0.5, 0.25}), default_obstacle());
  const std::vector<double> corners = body.world().obstacle_triangles(id);
  ASSERT_EQ(corners.size(), 9U * 2 * (kColumns - 1) * (kRows - 1));
  double area = 0;
  for (std::size_t i = 0; i < corners.size() / 3; i += 3) {
    std::array<Eigen::Vector3d, 3> at{corner(corners, i), corner(corners, i + 1), corner(corners, i + 2)};
    for (const Eigen::Vector3d& point : at) {
      const auto column = std::lround(point.x() / 0.5), row = std::lround(point.y() / 0.25);
      EXPECT_EQ(point.z(), heights[static_cast<std::size_t>(row * kColumns + column)]);
    }
    const double upward = (at[1] - at[0]).cross(at[2] - at[0]).z() / 2;
    EXPECT_GT(upward, 0);
    area += upward;
  }
  EXPECT_NEAR(area, 1.5 * 0.5, 1e-12);
}

TEST_F(ObstacleReading, OtherShapesHaveNoTriangles) {
  const exmat::Model model = this->model();
  exmat::Body body(model);
  const std::int64_t id = body.world().add_obstacle(default_obstacle());
  EXPECT_EQ(exmat_world_obstacle_triangles(exmat_body_world(body.get()), id), 0);
  EXPECT_TRUE(body.world().obstacle_triangles(id).empty());
  EXPECT_EQ(exmat_world_obstacle_triangles(exmat_body_world(body.get()), id + 1), -1);
  EXPECT_EQ(exmat_world_obstacle_triangles(nullptr, id), -1);
  EXPECT_THROW(body.world().obstacle_triangles(id + 1), exmat::Error);
  double one = 0;
  EXPECT_EQ(exmat_world_read_obstacle_triangles(exmat_body_world(body.get()), id, &one, 1), EXMAT_INVALID_ARGUMENT);
}

// Reports of a body that has a capacity, beside what the capacity says of the same forces.
TEST_F(ObstacleReading, ReportsOfAPressedBodyHoldItsLostWork) {
  const exmat::Model model = this->model();
  exmat::Body body(model);
  const std::array<std::int64_t, 1> last{static_cast<std::int64_t>(model.vertices()) - 1};
  const exmat::Points tip = exmat::Points::vertices(model, last);
  const std::array<double, 3> force{0.2, -0.1, -0.4};
  EXPECT_LT(body.step(1).lost_applied, 0);
  {
    const exmat::Capacity capacity(model, 0.1);
    body.set_capacity(&capacity);
    EXPECT_EQ(body.step(1).lost_applied, 0);
    body.apply_forces(tip, force);
    exmat_report report = body.step(1);
    EXPECT_NEAR(report.lost_applied, capacity.lost(body, tip, force), 1e-12);
    EXPECT_GT(report.lost_applied, 0.01);
    EXPECT_EQ(report.lost_contact, 0);
    exmat_obstacle press = default_obstacle();
    press.shape = EXMAT_SPHERE;
    for (int axis = 0; axis < 3; ++axis) press.point[axis] = tip.rest()[static_cast<std::size_t>(axis)];
    press.point[0] += 0.98;
    body.world().add_obstacle(press);
    report = body.step(3);
    EXPECT_GT(report.lost_contact, 0.01);
    EXPECT_EQ(report.lost_contact, capacity.contact_lost(body));
    body.clear_forces();
  }
  EXPECT_EQ(body.step(1).lost_applied, 0);
  body.set_capacity(nullptr);
  EXPECT_LT(body.step(1).lost_contact, 0);
  const exmat::Model other = this->model();
  const exmat::Capacity capacity(other, 0);
  EXPECT_THROW(body.set_capacity(&capacity), exmat::Error);
}

}  // namespace
}  // namespace exmat::runtime
