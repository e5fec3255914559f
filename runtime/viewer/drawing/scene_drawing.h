#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "runtime/viewer/drawing/body_drawing.h"
#include "runtime/viewer/drawing/canvas.h"
#include "runtime/viewer/drawing/look.h"
#include "runtime/viewer/drawing/solid_mesh.h"
#include "runtime/viewer/simulation/snapshot.h"
#include "runtime/viewer/view/camera.h"

namespace exmat::viewer {

/// A body as it stands in the picture.
struct ShownBody {
  std::size_t kind = 0;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
};

/// An example beside the bodies.
struct ShownGhost {
  std::string name;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  ///< above it, for its name
};

/// Draws a scene: bodies, ghosts, obstacles, floor, light and shadow.
class SceneDrawing {
 public:
  SceneDrawing(std::vector<std::shared_ptr<const BodyShape>> kinds, std::vector<ShownBody> bodies, bool software);

  void draw(const Snapshot& snapshot, const Camera& camera, const Look& look, Canvas& canvas);

  /// Bounds of bodies, ghosts and obstacles as last drawn.
  const Bounds& bounds() const { return bounds_; }
  /// Ghosts of the last picture.
  const std::vector<ShownGhost>& ghosts() const { return shown_ghosts_; }
  /// The value at the end of the scale of the last picture.
  float most() const { return most_; }
  std::size_t triangles() const;

 private:
  struct Ghost {
    std::size_t example;
    PosedBody posed;
  };
  struct Solid {
    SolidMesh mesh;
    VertexArrayName array;
    Buffer points, indices;
    GLsizei count = 0;
  };
  struct Frame {
    const Snapshot& snapshot;
    const Camera& camera;
    const Look& look;
    Eigen::Matrix4f to_clip, to_light;
    PictureSize size;
  };

  void pose_bodies(const Snapshot& snapshot, const Look& look);
  void place_ghosts(const Camera& camera, const Look& look);
  void find_bounds(const Snapshot& snapshot);
  void find_floor(const Snapshot& snapshot, const Eigen::Vector3d& up);
  void find_scale(const Snapshot& snapshot, const Look& look);
  Eigen::Matrix4f light_matrix() const;
  Solid make_solid(const SolidMesh& mesh) const;
  Solid& solid_of(const ObstacleSnapshot& obstacle);

  void draw_shadow(const Frame& frame);
  void draw_background(const Frame& frame);
  void draw_bodies(const Frame& frame);
  void draw_edges(const Frame& frame);
  void draw_solids(const Frame& frame, bool see_through);
  void draw_floor(const Frame& frame);
  void draw_ghosts(const Frame& frame);
  void draw_targets(const Frame& frame);
  void draw_elements(const Frame& frame);
  void set_light(const Program& program, const Frame& frame) const;
  void set_body(const Program& program, const Eigen::Matrix4f& to_clip, const BodyDrawing& drawing,
                const PosedBody& posed, const Eigen::Vector3d& offset, bool by_displacement) const;

  std::vector<std::shared_ptr<const BodyShape>> kinds_;
  std::vector<ShownBody> bodies_;
  std::vector<BodyDrawing> drawings_;
  std::vector<PosedBody> posed_, targets_;
  std::vector<Ghost> ghosts_;
  std::vector<ShownGhost> shown_ghosts_;
  std::vector<Eigen::Vector3d> ghost_offsets_;
  std::map<std::int64_t, std::pair<exmat_obstacle, Solid>> solids_;

  Program body_program_, ghost_edges_, body_depth_, solid_program_, solid_depth_, floor_program_, background_, dots_;
  Texture shadow_map_;
  Framebuffer shadow_target_;
  VertexArrayName empty_, dot_array_;
  Buffer dot_buffer_;
  Solid floor_;
  Eigen::Vector3d floor_point_ = Eigen::Vector3d::Zero(), up_ = Eigen::Vector3d::UnitZ(),
                  light_ = Eigen::Vector3d::UnitZ();
  Bounds bounds_, lit_bounds_;
  double size_ = 1;  ///< size of the bodies at rest [m]
  float most_ = 1;
  int shadow_size_ = 2048, shadow_samples_ = 24;
};

}  // namespace exmat::viewer
