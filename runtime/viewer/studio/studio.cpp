#include "runtime/viewer/studio/studio.h"

#include <algorithm>
#include <exception>
#include <fmt/format.h>
#include <utility>

#include "common/core/command_files.h"

namespace exmat::viewer {
namespace {

constexpr double kMessageSeconds = 6;
constexpr double kBetweenMeasurements = 0.12;  // [s] of lost work
constexpr double kPanels = 570;                // pixels that they take of the width
constexpr double kJointReach = 9;              // pixels from a joint

Eigen::Vector3d up_of(const Settings& settings) {
  const Eigen::Vector3d gravity(settings.gravity.data());
  return gravity.isZero(0) ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d(-gravity.normalized());
}

Eigen::Vector3d position_of(const exmat_motion& motion) { return Eigen::Vector3d(motion.position); }

}  // namespace

Studio::Studio(Simulation& simulation) : runner_(simulation), has_contact_(simulation.has_contact()) {
  for (std::size_t kind = 0; kind < simulation.kinds(); ++kind) {
    shapes_.push_back(simulation.shape(kind));
    settings_.push_back(simulation.settings(kind));
    kind_names_.push_back(simulation.kind_name(kind));
  }
  for (std::size_t body = 0; body < simulation.bodies(); ++body) {
    kinds_.push_back(simulation.kind_of(body));
    offsets_.push_back(simulation.offset(body));
  }
  camera_.set_up(up_of(settings_.front()));
}

void Studio::apply(std::size_t kind, const Settings& settings) {
  try {
    runner_.with([&](Simulation& simulation) {
      simulation.apply(kind, settings);
      for (std::size_t i = 0; i < settings_.size(); ++i) settings_[i] = simulation.settings(i);
    });
    drag_.reset();
  } catch (const std::exception& error) {
    say(error.what());
  }
}

void Studio::reset() {
  try {
    runner_.with([](Simulation& simulation) { simulation.reset(); });
    drag_.reset();
  } catch (const std::exception& error) {
    say(error.what());
  }
}

std::optional<Pick> Studio::pick_joint(const Snapshot& snapshot, const Eigen::Vector2d& pixel,
                                       const PictureSize& picture) const {
  std::optional<Pick> nearest;
  double distance = kJointReach;
  for (std::size_t body = 0; body < snapshot.bodies.size(); ++body)
    for (std::size_t joint = 0; joint < shapes_[kinds_[body]]->bones.size(); ++joint) {
      const Eigen::Vector3d point = snapshot.bodies[body].joint(joint) + offsets_[body];
      const std::optional<Eigen::Vector2d> shown = camera_.pixel(point, picture);
      if (!shown || (*shown - pixel).norm() >= distance) continue;
      distance = (*shown - pixel).norm();
      nearest = Pick{Pick::What::kJoint, body, joint, {}, point};
    }
  return nearest;
}

std::optional<Pick> Studio::pick(const Eigen::Vector2d& pixel, const PictureSize& picture) {
  const Ray ray = camera_.ray(pixel, picture);
  return runner_.with([&](Simulation& simulation) {
    const Snapshot snapshot = simulation.snapshot({});
    std::optional<Pick> nearest = look_.bones ? pick_joint(snapshot, pixel, picture) : std::nullopt;
    if (nearest) return nearest;
    double distance = 1e300;
    for (std::size_t body = 0; body < simulation.bodies(); ++body) {
      const Ray own{ray.origin - offsets_[body], ray.direction};
      const std::optional<SurfaceHit> hit = simulation.cast(body, own, distance);
      if (!hit || hit->distance >= distance) continue;
      distance = hit->distance;
      nearest = Pick{Pick::What::kBody, body, 0, *hit, ray.at(distance)};
    }
    if (const auto hit = simulation.cast(ray); hit && hit->distance < distance)
      nearest = Pick{Pick::What::kObstacle, hit->number, 0, {}, ray.at(hit->distance)};
    return nearest;
  });
}

bool Studio::begin_drag(const Eigen::Vector2d& pixel, const PictureSize& picture) {
  const std::optional<Pick> found = pick(pixel, picture);
  if (!found) return false;
  Drag drag{*found, 0, found->point, Eigen::Vector3d::Zero()};
  runner_.with([&](Simulation& simulation) {
    if (found->what == Pick::What::kBody)
      drag.grip = simulation.grab(found->number, found->place);
    else if (found->what == Pick::What::kJoint)
      drag.grip = simulation.grab_joint(found->number, found->joint);
    else
      drag.from = position_of(simulation.snapshot({}).obstacles[found->number].motion);
  });
  drag_ = drag;
  return true;
}

void Studio::drag(const Eigen::Vector2d& pixel, const PictureSize& picture) {
  if (!drag_) return;
  const Eigen::Vector3d to = camera_.on_plane_of(drag_->anchor, pixel, picture);
  runner_.with([&](Simulation& simulation) {
    if (drag_->pick.what != Pick::What::kObstacle)
      simulation.move_grip(drag_->grip, to - offsets_[drag_->pick.number]);
    else
      simulation.move_obstacle(drag_->pick.number, drag_->from + to - drag_->anchor);
  });
}

void Studio::end_drag() {
  if (!drag_) return;
  if (drag_->pick.what != Pick::What::kObstacle)
    runner_.with([&](Simulation& simulation) { simulation.release(drag_->grip); });
  drag_.reset();
}

void Studio::toggle_pin(const Eigen::Vector2d& pixel, const PictureSize& picture) {
  const std::optional<Pick> found = pick(pixel, picture);
  if (!found || found->what != Pick::What::kBody) return say("P pins the body under the mouse: there is none");
  try {
    runner_.with([&](Simulation& simulation) { simulation.toggle_pin(found->number, found->place); });
  } catch (const Error& error) {
    say(error.what());
  }
}

void Studio::toggle_pin_near(std::size_t body, const Eigen::Vector3d& point) {
  const BodyShape& shape = *shapes_[kinds_[body]];
  const SurfaceHit place = nearest_place(point, shape.rest, shape.triangles);
  runner_.with([&](Simulation& simulation) { simulation.toggle_pin(body, place); });
}

int Studio::grab_near(std::size_t body, const Eigen::Vector3d& point) {
  const BodyShape& shape = *shapes_[kinds_[body]];
  const SurfaceHit place = nearest_place(point, shape.rest, shape.triangles);
  return runner_.with([&](Simulation& simulation) { return simulation.grab(body, place); });
}

void Studio::add_obstacle(std::int32_t shape) {
  exmat_obstacle obstacle = default_obstacle();
  const Bounds& bounds = shapes_.front()->bounds;
  const double size = bounds.diagonal();
  const Eigen::Vector3d up = camera_.up(), extent = bounds.most - bounds.least;
  const double height = extent.cwiseAbs().dot(up.cwiseAbs());
  const Eigen::Vector3d place = shape == EXMAT_PLANE
                                    ? Eigen::Vector3d(bounds.centre() - (0.5 * height + 0.1 * size) * up)
                                    : Eigen::Vector3d(bounds.centre() + 0.6 * size * camera_.right());
  for (int i = 0; i < 3; ++i) {
    obstacle.point[i] = place[i];
    obstacle.direction[i] = shape == EXMAT_CAPSULE ? 0.4 * size * up[i] : up[i];
    obstacle.half_extents[i] = 0.12 * size;
  }
  obstacle.radius = 0.12 * size;
  obstacle.shape = shape;
  obstacle.friction = 0.4;
  try {
    runner_.with([&](Simulation& simulation) { simulation.add_obstacle(obstacle); });
  } catch (const std::exception& error) {
    say(error.what());
  }
}

void Studio::remove_obstacle(std::size_t obstacle) {
  end_drag();
  runner_.with([&](Simulation& simulation) { simulation.remove_obstacle(obstacle); });
}

void Studio::save_scene(const std::filesystem::path& file) {
  try {
    check_output(file, "Save");
    runner_.with([&](Simulation& simulation) { simulation.save_scene(file); });
    say(fmt::format("saved: {}", file.string()));
  } catch (const std::exception& error) {
    say(error.what());
  }
}

void Studio::frame(const Bounds& bounds, const PictureSize& picture, double scale) {
  PictureSize left = picture;
  if (interface) left.width = std::max(picture.width - static_cast<int>(kPanels * scale), picture.width / 4);
  camera_.frame(bounds, left);
  frame_next = false;
}

void Studio::measure_lost_work(double seconds) {
  lost_seconds_ += seconds;
  if (lost_seconds_ > kBetweenMeasurements) measure_lost_work_now();
}

void Studio::measure_lost_work_now() {
  lost_seconds_ = 0;
  lost_ = runner_.with([](Simulation& simulation) { return simulation.lost_work(); });
}

void Studio::say(std::string message) {
  message_ = std::move(message);
  message_seconds_ = kMessageSeconds;
}

void Studio::pass(double seconds) {
  message_seconds_ -= seconds;
  if (message_seconds_ <= 0) message_.clear();
}

}  // namespace exmat::viewer
