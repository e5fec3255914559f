#include "runtime/viewer/drawing/scene_drawing.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "common/core/error.h"
#include "runtime/viewer/drawing/shaders.h"

namespace exmat::viewer {
namespace {

constexpr std::size_t kMeasuredPoints = 2000;  // that the scale of displacements is found by

Bounds placed_bounds(const BodyShape& shape, const std::array<float, 12>& placement, const Eigen::Vector3d& offset) {
  Bounds bounds;
  const Eigen::Map<const Eigen::Matrix<float, 3, 4, Eigen::RowMajor>> rows(placement.data());
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d at = shape.bounds.least;
    for (int axis = 0; axis < 3; ++axis)
      if ((corner >> axis & 1) != 0) at[axis] = shape.bounds.most[axis];
    bounds.add(rows.cast<double>() * at.homogeneous() + offset);
  }
  return bounds;
}

float largest_displacement(const BodyShape& shape, const std::vector<float>& q) {
  const std::size_t points = shape.rest.size() / 3, stride = 1 + points / kMeasuredPoints;
  const Eigen::Map<const Eigen::VectorXf> amounts(q.data(), static_cast<Eigen::Index>(q.size()));
  float largest = 0;
  for (std::size_t i = 0; i < points; i += stride) {
    const Eigen::Map<const Eigen::Matrix<float, 3, Eigen::Dynamic, Eigen::RowMajor>> rows(
        shape.basis.data() + 3 * i * shape.modes, 3, static_cast<Eigen::Index>(shape.modes));
    largest = std::max(largest, (rows * amounts).norm());
  }
  return largest;
}

/// Largest value of a field; energies leave out a hundredth: a corner or two would leave the rest dark.
float largest_of(std::vector<float> field, Colouring colouring) {
  if (colouring != Colouring::kStrainEnergy) return *std::ranges::max_element(field);
  const auto at = field.begin() + static_cast<std::ptrdiff_t>(field.size() * 99 / 100);
  std::ranges::nth_element(field, at);
  return *at;
}

Texture make_shadow_map(int size, const Framebuffer& target) {
  Texture map = make_texture();
  glBindTexture(GL_TEXTURE_2D, map.get());
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, size, size, 0, GL_DEPTH_COMPONENT, GL_FLOAT, nullptr);
  for (const GLenum parameter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTexParameteri(GL_TEXTURE_2D, parameter, GL_LINEAR);
  for (const GLenum parameter : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
    glTexParameteri(GL_TEXTURE_2D, parameter, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
  glBindFramebuffer(GL_FRAMEBUFFER, target.get());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, map.get(), 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw WorkError("the graphics driver does not draw into a shadow map");
  return map;
}

std::string with_arrays(std::string_view shader) {
  return shaders::joined({shaders::kVersion, shaders::kArrays, shader});
}

std::string lit(std::string_view shader) {
  return shaders::joined({shaders::kVersion, shaders::kLight, shaders::kScale, shader});
}

std::string plain(std::string_view shader) { return shaders::joined({shaders::kVersion, shader}); }

}  // namespace

SceneDrawing::SceneDrawing(std::vector<std::shared_ptr<const BodyShape>> kinds, std::vector<ShownBody> bodies,
                           bool software)
    : kinds_(std::move(kinds)),
      bodies_(std::move(bodies)),
      body_program_("the body", with_arrays(shaders::kBodyVertex), lit(shaders::kBodyFragment)),
      ghost_edges_("the edges", with_arrays(shaders::kBodyVertex), shaders::kPlainFragment),
      body_depth_("the body's shadow", with_arrays(shaders::kBodyVertex), shaders::kDepthFragment),
      solid_program_("obstacles", plain(shaders::kSolidVertex), lit(shaders::kBodyFragment)),
      solid_depth_("their shadow", plain(shaders::kSolidVertex), shaders::kDepthFragment),
      floor_program_("the floor", plain(shaders::kSolidVertex), lit(shaders::kFloorFragment)),
      background_("the background", shaders::kWholePicture, shaders::kBackgroundFragment),
      dots_("elements", shaders::kDotVertex, shaders::kDotFragment),
      shadow_target_(make_framebuffer()),
      empty_(make_vertex_array()),
      dot_array_(make_vertex_array()),
      dot_buffer_(make_buffer()) {
  if (software) {
    shadow_size_ = 1024;
    shadow_samples_ = 16;
  }
  shadow_map_ = make_shadow_map(shadow_size_, shadow_target_);
  for (const auto& kind : kinds_) {
    drawings_.emplace_back(*kind);
    size_ = std::max(kind == kinds_.front() ? 0 : size_, kind->bounds.diagonal());
  }
  for (const ShownBody& body : bodies_) {
    posed_.push_back(drawings_[body.kind].make_posed());
  }
  floor_ = make_solid(make_sheet(Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ(), 1));
}

std::size_t SceneDrawing::triangles() const {
  std::size_t sum = 0;
  for (const ShownBody& body : bodies_) sum += drawings_[body.kind].triangles();
  return sum;
}

// ---- what a picture is made of --------------------------------------------------------------------------------------

void SceneDrawing::pose_bodies(const Snapshot& snapshot, const Look& look) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const BodySnapshot& body = snapshot.bodies[i];
    const BodyDrawing& drawing = drawings_[bodies_[i].kind];
    if (body.positions.empty())
      drawing.pose(body.q, body.placement, posed_[i]);
    else
      drawing.place(body.positions, posed_[i]);
  }
  if (!look.targets) return;
  std::size_t count = 0;
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    for (const std::vector<float>& target : snapshot.bodies[i].targets) {
      const BodyDrawing& drawing = drawings_[bodies_[i].kind];
      if (count == targets_.size()) targets_.push_back(drawing.make_posed());
      drawing.pose(target, snapshot.bodies[i].placement, targets_[count++]);
    }
}

void SceneDrawing::place_ghosts(const Camera& camera, const Look& look) {
  shown_ghosts_.clear();
  ghost_offsets_.clear();
  if (!look.examples) return;
  const BodyShape& shape = *kinds_.front();
  constexpr std::array<float, 12> kAtRest{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  if (ghosts_.empty())
    for (std::size_t i = 0; i < shape.examples.size(); ++i) {
      const std::vector<float>& pose = shape.examples[i].pose;
      if (std::ranges::all_of(pose, [](float number) { return number == 0; })) continue;
      ghosts_.push_back({i, drawings_.front().make_posed()});
      drawings_.front().pose(pose, kAtRest, ghosts_.back().posed);
    }
  const Eigen::Vector3d extent = shape.bounds.most - shape.bounds.least;
  const Eigen::Vector3d side = camera.right();
  const double width = 1.15 * std::max(extent.cwiseAbs().dot(side.cwiseAbs()), 0.35 * size_);
  for (std::size_t i = 0; i < ghosts_.size(); ++i) {
    ghost_offsets_.push_back(static_cast<double>(i + 1) * width * side);
    const ShownExample& example = shape.examples[ghosts_[i].example];
    const Eigen::Vector3d top =
        shape.bounds.centre() + 0.5 * extent.cwiseAbs().dot(camera.up().cwiseAbs()) * camera.up();
    shown_ghosts_.push_back(
        {example.region.empty() ? example.name : example.region + ": " + example.name, top + ghost_offsets_.back()});
  }
}

void SceneDrawing::find_bounds(const Snapshot& snapshot) {
  bounds_ = lit_bounds_ = Bounds();
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    bounds_.add(placed_bounds(*kinds_[bodies_[i].kind], snapshot.bodies[i].placement, bodies_[i].offset));
  for (const Eigen::Vector3d& offset : ghost_offsets_) {
    bounds_.add(kinds_.front()->bounds.least + offset);
    bounds_.add(kinds_.front()->bounds.most + offset);
  }
  lit_bounds_ = bounds_;
  for (const ObstacleSnapshot& obstacle : snapshot.obstacles) {
    if (obstacle.obstacle.shape == EXMAT_PLANE) continue;
    const Solid& solid = solid_of(obstacle);
    const Eigen::Quaterniond turn(obstacle.motion.orientation[0], obstacle.motion.orientation[1],
                                  obstacle.motion.orientation[2], obstacle.motion.orientation[3]);
    for (std::size_t i = 0; i + 5 < solid.mesh.points.size(); i += 6)
      lit_bounds_.add(turn * Eigen::Map<const Eigen::Vector3f>(solid.mesh.points.data() + i).cast<double>() +
                      Eigen::Vector3d(obstacle.motion.position));
  }
}

void SceneDrawing::find_floor(const Snapshot& snapshot, const Eigen::Vector3d& up) {
  up_ = up;
  light_ = (up + 0.32 * up.unitOrthogonal() + 0.22 * up.cross(up.unitOrthogonal())).normalized();
  for (const ObstacleSnapshot& obstacle : snapshot.obstacles)
    if (obstacle.obstacle.shape == EXMAT_PLANE && Eigen::Vector3d(obstacle.obstacle.direction).dot(up) > 0.95) {
      floor_point_ = Eigen::Vector3d(obstacle.obstacle.point) + Eigen::Vector3d(obstacle.motion.position);
      return;
    }
  double least = 1e300;
  for (const auto& kind : kinds_)
    least = std::min(least, std::min(kind->bounds.least.dot(up), kind->bounds.most.dot(up)));
  // Below ground and meshes that are of the scene.
  if (std::ranges::any_of(snapshot.obstacles, [](const auto& obstacle) { return !obstacle.corners->empty(); })) {
    const Eigen::Vector3d half = 0.5 * (lit_bounds_.most - lit_bounds_.least);
    floor_point_ = std::min(least, lit_bounds_.centre().dot(up) - half.cwiseAbs().dot(up.cwiseAbs())) * up;
    return;
  }
  const bool falls = std::ranges::any_of(kinds_, [](const auto& kind) { return kind->mass > 0; });
  floor_point_ = (least - (falls ? 1.0 : 0.16) * size_) * up;
}

void SceneDrawing::find_scale(const Snapshot& snapshot, const Look& look) {
  float most = 0;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const BodySnapshot& body = snapshot.bodies[i];
    if (look.colouring == Colouring::kDisplacement)
      most = std::max(most, largest_displacement(*kinds_[bodies_[i].kind], body.q));
    else if (!body.field.empty())
      most = std::max(most, largest_of(body.field, look.colouring));
  }
  // Two leading digits of what there is: the numbers beside the scale stand still.
  if (!(most > 0)) {
    most_ = 1;
    return;
  }
  const float unit = std::pow(10.0F, std::floor(std::log10(most)) - 1);
  const float rounded = unit * std::ceil(most / unit / 5) * 5;
  if (rounded > most_ || rounded < 0.6F * most_) most_ = rounded;
}

Eigen::Matrix4f SceneDrawing::light_matrix() const {
  const Eigen::Vector3d middle = lit_bounds_.centre();
  const double reach = std::max(0.75 * lit_bounds_.diagonal(), 1e-6);
  const Eigen::Vector3d side = light_.unitOrthogonal();
  Eigen::Matrix4d to_light = Eigen::Matrix4d::Identity();
  to_light.row(0).head<3>() = side / reach;
  to_light.row(1).head<3>() = light_.cross(side) / reach;
  to_light.row(2).head<3>() = -light_ / (4 * reach);
  to_light.col(3).head<3>() = -to_light.topLeftCorner<3, 3>() * middle;
  return to_light.cast<float>();
}

SceneDrawing::Solid SceneDrawing::make_solid(const SolidMesh& mesh) const {
  Solid solid{mesh, make_vertex_array(), make_buffer(), make_buffer(), static_cast<GLsizei>(mesh.indices.size())};
  glBindVertexArray(solid.array.get());
  glBindBuffer(GL_ARRAY_BUFFER, solid.points.get());
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.points.size() * sizeof(float)), mesh.points.data(),
               GL_STATIC_DRAW);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, solid.indices.get());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.indices.size() * sizeof(std::uint32_t)),
               mesh.indices.data(), GL_STATIC_DRAW);
  for (GLuint i = 0; i < 2; ++i) {
    glEnableVertexAttribArray(i);
    glVertexAttribPointer(i, 3, GL_FLOAT, GL_FALSE, 6 * sizeof(float),
                          reinterpret_cast<const void*>(3 * sizeof(float) * i));
  }
  glBindVertexArray(0);
  return solid;
}

SceneDrawing::Solid& SceneDrawing::solid_of(const ObstacleSnapshot& obstacle) {
  const auto found = solids_.find(obstacle.id);
  if (found != solids_.end() && std::memcmp(&found->second.first, &obstacle.obstacle, sizeof(exmat_obstacle)) == 0)
    return found->second.second;
  const double sheet = std::max(0.7 * size_, 0.6 * bounds_.diagonal());
  const auto made = solids_.insert_or_assign(
      obstacle.id,
      std::pair(obstacle.obstacle, make_solid(make_obstacle(obstacle.obstacle, *obstacle.corners, sheet))));
  return made.first->second.second;
}

// ---- a picture ------------------------------------------------------------------------------------------------------

void SceneDrawing::draw(const Snapshot& snapshot, const Camera& camera, const Look& look, Canvas& canvas) {
  pose_bodies(snapshot, look);
  place_ghosts(camera, look);
  find_bounds(snapshot);
  find_floor(snapshot, camera.up());
  find_scale(snapshot, look);
  const Frame frame{snapshot,       camera,
                    look,           (camera.projection(canvas.size()) * camera.view()).cast<float>(),
                    light_matrix(), canvas.size()};
  draw_shadow(frame);
  canvas.begin();
  draw_background(frame);
  glEnable(GL_DEPTH_TEST);
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  draw_solids(frame, false);
  if (look.surface) draw_bodies(frame);
  if (look.floor) draw_floor(frame);
  if (look.wireframe) draw_edges(frame);
  glDepthMask(GL_FALSE);
  draw_ghosts(frame);
  if (look.targets) draw_targets(frame);
  if (look.elements) draw_elements(frame);
  draw_solids(frame, true);
  glDepthMask(GL_TRUE);
  glDisable(GL_DEPTH_TEST);
  canvas.resolve();
}

}  // namespace exmat::viewer
