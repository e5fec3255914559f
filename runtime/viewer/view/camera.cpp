#include "runtime/viewer/view/camera.h"

#include <algorithm>
#include <cmath>

namespace exmat::viewer {
namespace {

constexpr double kSteepest = 1.54;  // short of straight down
constexpr double kTurnPerHeight = 3.6;

}  // namespace

void Camera::set_up(const Eigen::Vector3d& up) { up_ = up.normalized(); }

Eigen::Matrix3d Camera::base() const {
  // The horizontal axis that z or y becomes where up is y or z.
  const Eigen::Vector3d hint = std::abs(up_.z()) > 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
  Eigen::Matrix3d base;
  base.col(0) = (hint - hint.dot(up_) * up_).normalized();
  base.col(1) = up_.cross(base.col(0));
  base.col(2) = up_;
  return base;
}

Eigen::Vector3d Camera::backward() const {
  return base() *
         Eigen::Vector3d(std::cos(rise_) * std::cos(turn_), std::cos(rise_) * std::sin(turn_), std::sin(rise_));
}

Eigen::Vector3d Camera::right() const { return up_.cross(backward()).normalized(); }

void Camera::look(const Eigen::Vector3d& position, const Eigen::Vector3d& target) {
  const Eigen::Vector3d way = base().transpose() * (position - target);
  target_ = target;
  distance_ = std::max(way.norm(), 1e-9);
  rise_ = std::clamp(std::asin(way.z() / distance_), -kSteepest, kSteepest);
  turn_ = std::atan2(way.y(), way.x());
}

void Camera::orbit(double right, double up) {
  turn_ -= kTurnPerHeight * right;
  rise_ = std::clamp(rise_ + kTurnPerHeight * up, -kSteepest, kSteepest);
}

void Camera::pan(double right, double up) {
  const double height = 2 * distance_ * std::tan(0.5 * field_of_view_);
  target_ += height * (right * this->right() + up * backward().cross(this->right()));
}

void Camera::zoom(double factor) { distance_ = std::clamp(distance_ / factor, 1e-6, 1e9); }

void Camera::frame(const Bounds& bounds, const PictureSize& picture) {
  if (bounds.empty()) return;
  target_ = bounds.centre();
  const double narrow = std::atan(std::tan(0.5 * field_of_view_) * std::min(1.0, picture.aspect()));
  distance_ = std::max(0.5 * bounds.diagonal() / std::sin(narrow), 1e-6);
}

Eigen::Matrix4d Camera::view() const {
  const Eigen::Vector3d back = backward(), side = right();
  Eigen::Matrix4d view = Eigen::Matrix4d::Identity();
  view.topLeftCorner<3, 3>() << side.transpose(), back.cross(side).transpose(), back.transpose();
  view.topRightCorner<3, 1>() = -view.topLeftCorner<3, 3>() * position();
  return view;
}

Eigen::Matrix4d Camera::projection(const PictureSize& picture) const {
  const double near = 0.02 * distance_, far = 50 * distance_;
  const double scale = 1 / std::tan(0.5 * field_of_view_);
  Eigen::Matrix4d projection = Eigen::Matrix4d::Zero();
  projection(0, 0) = scale / picture.aspect();
  projection(1, 1) = scale;
  projection(2, 2) = (far + near) / (near - far);
  projection(2, 3) = 2 * far * near / (near - far);
  projection(3, 2) = -1;
  return projection;
}

Ray Camera::ray(const Eigen::Vector2d& pixel, const PictureSize& picture) const {
  const double height = std::tan(0.5 * field_of_view_);
  const double x = (2 * (pixel.x() + 0.5) / picture.width - 1) * height * picture.aspect();
  const double y = (1 - 2 * (pixel.y() + 0.5) / picture.height) * height;
  const Eigen::Vector3d back = backward(), side = right();
  return {position(), (x * side + y * back.cross(side) - back).normalized()};
}

std::optional<Eigen::Vector2d> Camera::pixel(const Eigen::Vector3d& point, const PictureSize& picture) const {
  const Eigen::Vector4d clip = projection(picture) * view() * point.homogeneous();
  if (clip.w() <= 0) return std::nullopt;
  return Eigen::Vector2d(0.5 * (clip.x() / clip.w() + 1) * picture.width - 0.5,
                         0.5 * (1 - clip.y() / clip.w()) * picture.height - 0.5);
}

Eigen::Vector3d Camera::on_plane_of(const Eigen::Vector3d& point, const Eigen::Vector2d& pixel,
                                    const PictureSize& picture) const {
  const Ray through = ray(pixel, picture);
  const Eigen::Vector3d back = backward();
  return through.at((point - through.origin).dot(back) / through.direction.dot(back));
}

}  // namespace exmat::viewer
