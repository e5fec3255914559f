// Drawing of the parts of a picture.
#include <Eigen/Geometry>
#include <cmath>

#include "runtime/viewer/drawing/scene_drawing.h"

namespace exmat::viewer {
namespace {

constexpr Colour kObstacleColour{0.62F, 0.66F, 0.72F};

using Vector = std::array<float, 3>;

Vector vector_of(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

/// As the light is computed: linear.
std::array<float, 4> linear(const Colour& colour, float opacity) {
  return {std::pow(colour[0], 2.2F), std::pow(colour[1], 2.2F), std::pow(colour[2], 2.2F), opacity};
}

Eigen::Matrix4f placement_of(const exmat_motion& motion) {
  Eigen::Matrix4f placement = Eigen::Matrix4f::Identity();
  const Eigen::Quaterniond turn(motion.orientation[0], motion.orientation[1], motion.orientation[2],
                                motion.orientation[3]);
  placement.topLeftCorner<3, 3>() = turn.toRotationMatrix().cast<float>();
  placement.topRightCorner<3, 1>() = Eigen::Vector3d(motion.position).cast<float>();
  return placement;
}

}  // namespace

void SceneDrawing::set_light(const Program& program, const Frame& frame) const {
  program.set("eye", std::span<const float, 3>(vector_of(frame.camera.position())));
  program.set("light", std::span<const float, 3>(vector_of(light_)));
  program.set("up", std::span<const float, 3>(vector_of(up_)));
  program.set_matrix("to_light", frame.to_light.data());
  program.set("softness", 0.016F);
  program.set("samples", shadow_samples_);
  program.set_texture("shadow", 7, GL_TEXTURE_2D, shadow_map_.get());
}

void SceneDrawing::set_body(const Program& program, const Eigen::Matrix4f& to_clip, const BodyDrawing& drawing,
                            const PosedBody& posed, const Eigen::Vector3d& offset, bool by_displacement) const {
  program.set_matrix("view_projection", to_clip.data());
  program.set("offset", std::span<const float, 3>(vector_of(offset)));
  program.set("by_displacement", by_displacement ? 1 : 0);
  program.set_texture("positions", 0, GL_TEXTURE_2D, posed.positions());
  program.set_texture("normals", 1, GL_TEXTURE_2D, posed.normals());
  program.set_texture("field", 2, GL_TEXTURE_2D, drawing.field());
}

void SceneDrawing::draw_shadow(const Frame& frame) {
  glBindFramebuffer(GL_FRAMEBUFFER, shadow_target_.get());
  glViewport(0, 0, shadow_size_, shadow_size_);
  glDepthMask(GL_TRUE);
  glEnable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glClear(GL_DEPTH_BUFFER_BIT);
  if (!frame.look.shadow) return;
  if (frame.look.surface) {
    body_depth_.use();
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const BodyDrawing& drawing = drawings_[bodies_[i].kind];
      set_body(body_depth_, frame.to_light, drawing, posed_[i], bodies_[i].offset, false);
      drawing.draw_triangles();
    }
  }
  solid_depth_.use();
  solid_depth_.set_matrix("view_projection", frame.to_light.data());
  for (const ObstacleSnapshot& obstacle : frame.snapshot.obstacles) {
    if (obstacle.obstacle.shape == EXMAT_PLANE) continue;
    const Solid& solid = solid_of(obstacle);
    solid_depth_.set_matrix("placement", placement_of(obstacle.motion).data());
    solid_depth_.set("offset", std::span<const float, 3>(Vector{}));
    glBindVertexArray(solid.array.get());
    glDrawElements(GL_TRIANGLES, solid.count, GL_UNSIGNED_INT, nullptr);
  }
}

void SceneDrawing::draw_background(const Frame& frame) {
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  background_.use();
  glUniform2f(background_.at("size"), static_cast<float>(frame.size.width), static_cast<float>(frame.size.height));
  glBindVertexArray(empty_.get());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void SceneDrawing::draw_bodies(const Frame& frame) {
  const Colouring colouring = frame.look.colouring;
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1, 1);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    BodyDrawing& drawing = drawings_[bodies_[i].kind];
    if (colouring != Colouring::kPlain && colouring != Colouring::kDisplacement)
      drawing.set_field(frame.snapshot.bodies[i].field);
    body_program_.use();
    set_light(body_program_, frame);
    set_body(body_program_, frame.to_clip, drawing, posed_[i], bodies_[i].offset,
             colouring == Colouring::kDisplacement);
    body_program_.set("colour", std::span<const float, 4>(linear(body_colour(i), 1)));
    body_program_.set("coloured", colouring != Colouring::kPlain ? 1 : 0);
    body_program_.set("most", most_);
    body_program_.set("ghost", 0);
    drawing.draw_triangles();
  }
  glDisable(GL_POLYGON_OFFSET_FILL);
}

void SceneDrawing::draw_edges(const Frame& frame) {
  ghost_edges_.use();
  const std::array<float, 4> colour{0.08F, 0.10F, 0.14F, frame.look.surface ? 0.45F : 0.8F};
  ghost_edges_.set("colour", std::span<const float, 4>(colour));
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const BodyDrawing& drawing = drawings_[bodies_[i].kind];
    set_body(ghost_edges_, frame.to_clip, drawing, posed_[i], bodies_[i].offset, false);
    drawing.draw_edges();
  }
}

void SceneDrawing::draw_solids(const Frame& frame, bool see_through) {
  solid_program_.use();
  set_light(solid_program_, frame);
  solid_program_.set_matrix("view_projection", frame.to_clip.data());
  solid_program_.set("coloured", 0);
  solid_program_.set("most", 1.0F);
  solid_program_.set("ghost", 0);
  for (const ObstacleSnapshot& obstacle : frame.snapshot.obstacles) {
    const bool plane = obstacle.obstacle.shape == EXMAT_PLANE;
    if (plane != see_through) continue;
    const Eigen::Vector3d normal(obstacle.obstacle.direction);
    if (plane && normal.dot(up_) > 0.95) continue;  // the floor
    Vector offset{};
    if (plane) {
      // The sheet stands where the bodies are.
      const Eigen::Vector3d way = bounds_.centre() - Eigen::Vector3d(obstacle.obstacle.point);
      offset = vector_of(way - way.dot(normal) * normal);
    }
    const Solid& solid = solid_of(obstacle);
    solid_program_.set("colour", std::span<const float, 4>(linear(kObstacleColour, plane ? 0.35F : 1)));
    solid_program_.set_matrix("placement", placement_of(obstacle.motion).data());
    solid_program_.set("offset", std::span<const float, 3>(offset));
    glBindVertexArray(solid.array.get());
    glDrawElements(GL_TRIANGLES, solid.count, GL_UNSIGNED_INT, nullptr);
  }
}

void SceneDrawing::draw_floor(const Frame& frame) {
  const Eigen::Vector3d middle = bounds_.centre();
  const Eigen::Vector3d below = middle - (middle - floor_point_).dot(up_) * up_;
  const double reach = 2.2 * std::max(bounds_.diagonal(), size_);
  const Eigen::Vector3d first = up_.unitOrthogonal(), second = up_.cross(first);
  Eigen::Matrix4f placement = Eigen::Matrix4f::Identity();
  placement.col(0).head<3>() = (reach * first).cast<float>();
  placement.col(1).head<3>() = (reach * second).cast<float>();
  placement.col(2).head<3>() = up_.cast<float>();
  placement.col(3).head<3>() = below.cast<float>();
  const double cell = std::pow(10, std::floor(std::log10(size_))) * 0.5;
  floor_program_.use();
  set_light(floor_program_, frame);
  floor_program_.set_matrix("view_projection", frame.to_clip.data());
  floor_program_.set_matrix("placement", placement.data());
  floor_program_.set("offset", std::span<const float, 3>(Vector{}));
  floor_program_.set("middle", std::span<const float, 3>(vector_of(below)));
  floor_program_.set("reach", static_cast<float>(reach));
  floor_program_.set("cell", static_cast<float>(cell));
  floor_program_.set("first", std::span<const float, 3>(vector_of(first)));
  floor_program_.set("second", std::span<const float, 3>(vector_of(second)));
  glDepthMask(GL_FALSE);
  glBindVertexArray(floor_.array.get());
  glDrawElements(GL_TRIANGLES, floor_.count, GL_UNSIGNED_INT, nullptr);
  glDepthMask(GL_TRUE);
}

void SceneDrawing::draw_ghosts(const Frame& frame) {
  if (ghost_offsets_.empty()) return;
  body_program_.use();
  set_light(body_program_, frame);
  body_program_.set("coloured", 0);
  body_program_.set("most", 1.0F);
  body_program_.set("ghost", 1);
  for (std::size_t i = 0; i < ghost_offsets_.size(); ++i) {
    const Colour& colour = kPalette[1];
    body_program_.set("colour", std::span<const float, 4>(linear(colour, 0.75F)));
    set_body(body_program_, frame.to_clip, drawings_.front(), ghosts_[i].posed, ghost_offsets_[i], false);
    drawings_.front().draw_triangles();
  }
}

void SceneDrawing::draw_targets(const Frame& frame) {
  body_program_.use();
  set_light(body_program_, frame);
  body_program_.set("coloured", 0);
  body_program_.set("most", 1.0F);
  body_program_.set("ghost", 1);
  body_program_.set("colour", std::span<const float, 4>(linear(kPalette[4], 0.8F)));
  std::size_t count = 0;
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    for (std::size_t j = 0; j < frame.snapshot.bodies[i].targets.size(); ++j) {
      const BodyDrawing& drawing = drawings_[bodies_[i].kind];
      set_body(body_program_, frame.to_clip, drawing, targets_[count++], bodies_[i].offset, false);
      drawing.draw_triangles();
    }
}

void SceneDrawing::draw_elements(const Frame& frame) {
  glDisable(GL_DEPTH_TEST);
  glEnable(GL_PROGRAM_POINT_SIZE);
  dots_.use();
  dots_.set_matrix("view_projection", frame.to_clip.data());
  dots_.set("pixels", 0.026F * static_cast<float>(frame.size.height));
  const Colour& colour = kPalette[3];
  const std::array<float, 4> shown{colour[0], colour[1], colour[2], 0.9F};
  dots_.set("colour", std::span<const float, 4>(shown));
  glBindVertexArray(dot_array_.get());
  glBindBuffer(GL_ARRAY_BUFFER, dot_buffer_.get());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const std::vector<float>& places = frame.snapshot.bodies[i].elements;
    const std::vector<float>& sizes = kinds_[bodies_[i].kind]->element_sizes;
    std::vector<float> dots;
    for (std::size_t j = 0; 3 * j < places.size(); ++j)
      dots.insert(dots.end(), {places[3 * j], places[3 * j + 1], places[3 * j + 2], sizes[j]});
    glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(dots.size() * sizeof(float)), dots.data(), GL_STREAM_DRAW);
    glEnableVertexAttribArray(0);
    glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 4 * sizeof(float), nullptr);
    glEnableVertexAttribArray(1);
    glVertexAttribPointer(1, 1, GL_FLOAT, GL_FALSE, 4 * sizeof(float),
                          reinterpret_cast<const void*>(3 * sizeof(float)));
    dots_.set("offset", std::span<const float, 3>(vector_of(bodies_[i].offset)));
    glDrawArrays(GL_POINTS, 0, static_cast<GLsizei>(dots.size() / 4));
  }
  glEnable(GL_DEPTH_TEST);
}

}  // namespace exmat::viewer
