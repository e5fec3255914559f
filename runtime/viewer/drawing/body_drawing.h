#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "runtime/viewer/drawing/drawn_mesh.h"
#include "runtime/viewer/drawing/gl_objects.h"
#include "runtime/viewer/simulation/body_shape.h"

namespace exmat::viewer {

/// Arrays are textures that are this wide.
inline constexpr GLsizei kArrayWidth = 1024;

/// The surface of one pose, as textures on the GPU. r floats are what a new pose takes.
class PosedBody {
 public:
  PosedBody(std::size_t points, std::size_t corners);

  GLuint positions() const { return positions_.get(); }
  GLuint normals() const { return normals_.get(); }

 private:
  friend class BodyDrawing;
  Texture positions_, normals_;
  Framebuffer position_target_, normal_target_;
};

/// Bodies of one kind as the GPU holds them: rest positions, modes, triangles.
class BodyDrawing {
 public:
  /// Throws WorkError where the GPU does not take so many modes or points.
  explicit BodyDrawing(const BodyShape& shape);

  PosedBody make_posed() const { return {points_, corners_}; }

  /// Poses at q [r]; placement [12] as exmat_body_read_placement.
  void pose(std::span<const float> q, std::span<const float, 12> placement, PosedBody& posed) const;

  /// Poses at positions [3k].
  void place(std::span<const float> positions, PosedBody& posed) const;

  /// A field [k] to colour by; empty: zeros.
  void set_field(std::span<const float> field);
  GLuint field() const { return field_.get(); }

  void draw_triangles() const;
  void draw_edges() const;
  std::size_t triangles() const { return triangle_count_; }

 private:
  void find_normals(PosedBody& posed) const;
  void upload_modes(const BodyShape& shape);
  void upload_mesh(const BodyShape& shape);

  std::size_t points_ = 0, corners_ = 0, modes_ = 0, triangle_count_ = 0;
  GLsizei edge_count_ = 0;
  Program pose_program_, normal_program_;
  Texture modes_texture_, rest_, triangles_, starts_, around_, field_;
  VertexArrayName mesh_, edges_, empty_;
  Buffer point_ids_, indices_, edge_indices_;
};

}  // namespace exmat::viewer
