#include "runtime/viewer/view/camera.h"

#include <cmath>
#include <gtest/gtest.h>

namespace exmat::viewer {
namespace {

constexpr PictureSize kPicture{1280, 720};

Camera some_camera() {
  Camera camera;
  camera.set_up({0, 1, 0});
  camera.look({3, 2, 5}, {0.4, -0.2, 0.1});
  return camera;
}

// By similar triangles, without matrices.
TEST(Camera, PutsPointsWhereAPinholeDoes) {
  const Camera camera = some_camera();
  const Eigen::Vector3d eye(3, 2, 5), forward = (Eigen::Vector3d(0.4, -0.2, 0.1) - eye).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitY()).normalized(), up = right.cross(forward);
  const double focal = 0.5 * kPicture.height / std::tan(0.5 * camera.field_of_view());
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.7, 0.3, -0.9)}) {
    const Eigen::Vector3d way = point - eye;
    const Eigen::Vector2d expected(0.5 * kPicture.width - 0.5 + focal * way.dot(right) / way.dot(forward),
                                   0.5 * kPicture.height - 0.5 - focal * way.dot(up) / way.dot(forward));
    EXPECT_LE((camera.pixel(point, kPicture).value() - expected).norm(), 1e-9);
  }
  EXPECT_FALSE(camera.pixel(eye - forward, kPicture));
}

TEST(Camera, RaysGoThroughTheirPixels) {
  const Camera camera = some_camera();
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(0, 0), Eigen::Vector2d(900, 600)}) {
    const Ray ray = camera.ray(pixel, kPicture);
    EXPECT_LE((camera.pixel(ray.at(3.5), kPicture).value() - pixel).norm(), 1e-9);
    const Eigen::Vector3d on_plane = camera.on_plane_of({0.4, -0.2, 0.1}, pixel, kPicture);
    EXPECT_LE((camera.pixel(on_plane, kPicture).value() - pixel).norm(), 1e-9);
    EXPECT_NEAR((on_plane - Eigen::Vector3d(0.4, -0.2, 0.1)).dot(camera.backward()), 0, 1e-12);
  }
}

TEST(Camera, FramesAllOfABox) {
  for (const PictureSize& picture : {PictureSize{1280, 720}, PictureSize{400, 900}}) {
    Camera camera = some_camera();
    Bounds bounds;
    bounds.add(Eigen::Vector3d(-1, 4, 2));
    bounds.add(Eigen::Vector3d(1, 4.5, 2.2));
    camera.frame(bounds, picture);
    for (int corner = 0; corner < 8; ++corner) {
      Eigen::Vector3d at = bounds.least;
      for (int axis = 0; axis < 3; ++axis)
        if ((corner >> axis & 1) != 0) at[axis] = bounds.most[axis];
      const Eigen::Vector2d pixel = camera.pixel(at, picture).value();
      EXPECT_TRUE(pixel.x() > 0 && pixel.x() < picture.width && pixel.y() > 0 && pixel.y() < picture.height);
    }
  }
}

TEST(Camera, GoesAroundAndStaysAway) {
  Camera camera = some_camera();
  const double distance = camera.distance();
  const Eigen::Vector3d target = camera.target();
  camera.orbit(0.3, 0.1);
  camera.orbit(0, 100);
  EXPECT_NEAR((camera.position() - target).norm(), distance, 1e-12);
  EXPECT_LT(camera.backward().dot(camera.up()), 1);
  camera.zoom(2);
  EXPECT_NEAR((camera.position() - target).norm(), 0.5 * distance, 1e-12);
}

}  // namespace
}  // namespace exmat::viewer
