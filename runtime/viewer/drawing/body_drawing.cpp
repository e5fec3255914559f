#include "runtime/viewer/drawing/body_drawing.h"

#include <algorithm>
#include <fmt/format.h>

#include "common/core/error.h"
#include "runtime/viewer/drawing/shaders.h"

namespace exmat::viewer {
namespace {

constexpr std::size_t kMostModes = 512;  // of the shader

GLsizei rows_for(std::size_t entries) {
  return static_cast<GLsizei>((std::max<std::size_t>(entries, 1) + kArrayWidth - 1) / kArrayWidth);
}

struct Format {
  GLint stored;
  GLenum given, type;
};
constexpr Format kFloats1{GL_R32F, GL_RED, GL_FLOAT}, kFloats3{GL_RGB32F, GL_RGB, GL_FLOAT},
    kFloats4{GL_RGBA32F, GL_RGBA, GL_FLOAT};
constexpr Format kNumbers1{GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT},
    kNumbers2{GL_RG32UI, GL_RG_INTEGER, GL_UNSIGNED_INT}, kNumbers3{GL_RGB32UI, GL_RGB_INTEGER, GL_UNSIGNED_INT};

void sample_as_it_is(GLenum target) {
  for (const GLenum parameter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTexParameteri(target, parameter, GL_NEAREST);
}

/// A texture of `entries` of `width` numbers each, rows filled up with zeros.
template <typename Number>
Texture make_array(std::span<const Number> numbers, std::size_t width, const Format& format) {
  const std::size_t entries = numbers.size() / width;
  const GLsizei rows = rows_for(entries);
  std::vector<Number> padded(static_cast<std::size_t>(kArrayWidth) * static_cast<std::size_t>(rows) * width);
  std::ranges::copy(numbers, padded.begin());
  Texture texture = make_texture();
  glBindTexture(GL_TEXTURE_2D, texture.get());
  glTexImage2D(GL_TEXTURE_2D, 0, format.stored, kArrayWidth, rows, 0, format.given, format.type, padded.data());
  sample_as_it_is(GL_TEXTURE_2D);
  return texture;
}

Texture make_target(std::size_t entries, const Framebuffer& framebuffer) {
  Texture texture = make_texture();
  glBindTexture(GL_TEXTURE_2D, texture.get());
  glTexImage2D(GL_TEXTURE_2D, 0, kFloats4.stored, kArrayWidth, rows_for(entries), 0, kFloats4.given, kFloats4.type,
               nullptr);
  sample_as_it_is(GL_TEXTURE_2D);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer.get());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture.get(), 0);
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw WorkError("the graphics driver does not draw into textures of floating-point numbers");
  return texture;
}

template <typename Number>
Buffer make_filled(GLenum target, const std::vector<Number>& numbers) {
  Buffer buffer = make_buffer();
  glBindBuffer(target, buffer.get());
  glBufferData(target, static_cast<GLsizeiptr>(numbers.size() * sizeof(Number)), numbers.data(), GL_STATIC_DRAW);
  return buffer;
}

void require(GLenum limit, std::size_t needed, const char* what) {
  GLint most = 0;
  glGetIntegerv(limit, &most);
  if (needed <= static_cast<std::size_t>(most)) return;
  throw WorkError(fmt::format("the graphics driver takes at most {} {}, and this body has {}", most, what, needed));
}

}  // namespace

PosedBody::PosedBody(std::size_t points, std::size_t corners)
    : position_target_(make_framebuffer()), normal_target_(make_framebuffer()) {
  positions_ = make_target(points, position_target_);
  normals_ = make_target(corners, normal_target_);
}

BodyDrawing::BodyDrawing(const BodyShape& shape)
    : points_(shape.rest.size() / 3),
      modes_(shape.modes),
      triangle_count_(shape.triangles.size() / 3),
      pose_program_("the pose", shaders::kWholePicture, shaders::kPose),
      normal_program_("the normals", shaders::kWholePicture,
                      shaders::joined({shaders::kVersion, shaders::kArrays, shaders::kNormals})) {
  require(GL_MAX_ARRAY_TEXTURE_LAYERS, modes_, "modes");
  if (modes_ > kMostModes)
    throw WorkError(fmt::format("at most {} modes are drawn, and this body has {}", kMostModes, modes_));
  upload_modes(shape);
  upload_mesh(shape);
}

void BodyDrawing::upload_modes(const BodyShape& shape) {
  const auto rows = static_cast<std::size_t>(rows_for(points_));
  require(GL_MAX_TEXTURE_SIZE, rows, "rows of points");
  const std::vector<float> rest(shape.rest.begin(), shape.rest.end());
  rest_ = make_array<float>(rest, 3, kFloats3);
  modes_texture_ = make_texture();
  glBindTexture(GL_TEXTURE_2D_ARRAY, modes_texture_.get());
  glTexImage3D(GL_TEXTURE_2D_ARRAY, 0, kFloats3.stored, kArrayWidth, static_cast<GLsizei>(rows),
               static_cast<GLsizei>(modes_), 0, kFloats3.given, kFloats3.type, nullptr);
  std::vector<float> layer(3 * kArrayWidth * rows);
  for (std::size_t mode = 0; mode < modes_; ++mode) {
    for (std::size_t i = 0; i < 3 * points_; ++i) layer[i] = shape.basis[i * modes_ + mode];
    glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, static_cast<GLint>(mode), kArrayWidth, static_cast<GLsizei>(rows), 1,
                    kFloats3.given, kFloats3.type, layer.data());
  }
  sample_as_it_is(GL_TEXTURE_2D_ARRAY);
}

void BodyDrawing::upload_mesh(const BodyShape& shape) {
  const DrawnMesh mesh = make_drawn_mesh(shape.rest, shape.triangles);
  corners_ = mesh.points.size();
  const std::vector<std::uint32_t> triangles(shape.triangles.begin(), shape.triangles.end());
  triangles_ = make_array<std::uint32_t>(triangles, 3, kNumbers3);
  std::vector<std::uint32_t> ranges;
  for (std::size_t i = 0; i < corners_; ++i) {
    ranges.push_back(mesh.starts[i]);
    ranges.push_back(mesh.starts[i + 1] - mesh.starts[i]);
  }
  starts_ = make_array<std::uint32_t>(ranges, 2, kNumbers2);
  around_ = make_array<std::uint32_t>(mesh.around, 1, kNumbers1);
  set_field({});

  empty_ = make_vertex_array();
  mesh_ = make_vertex_array();
  edges_ = make_vertex_array();
  edge_count_ = static_cast<GLsizei>(mesh.edges.size());
  glBindVertexArray(mesh_.get());
  point_ids_ = make_filled(GL_ARRAY_BUFFER, mesh.points);
  indices_ = make_filled(GL_ELEMENT_ARRAY_BUFFER, mesh.indices);
  glEnableVertexAttribArray(0);
  glVertexAttribIPointer(0, 1, GL_UNSIGNED_INT, 0, nullptr);
  glBindVertexArray(edges_.get());
  glBindBuffer(GL_ARRAY_BUFFER, point_ids_.get());
  edge_indices_ = make_filled(GL_ELEMENT_ARRAY_BUFFER, mesh.edges);
  glEnableVertexAttribArray(0);
  glVertexAttribIPointer(0, 1, GL_UNSIGNED_INT, 0, nullptr);
  glBindVertexArray(0);
}

void BodyDrawing::set_field(std::span<const float> field) {
  std::vector<float> zeros;
  if (field.empty()) {
    zeros.resize(points_);
    field = zeros;
  }
  field_ = make_array<float>(field, 1, kFloats1);
}

void BodyDrawing::pose(std::span<const float> q, std::span<const float, 12> placement, PosedBody& posed) const {
  float columns[16] = {};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 4; ++column) columns[4 * column + row] = placement[4 * row + column];
  columns[15] = 1;
  glDisable(GL_BLEND);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_SCISSOR_TEST);
  glBindVertexArray(empty_.get());
  glBindFramebuffer(GL_FRAMEBUFFER, posed.position_target_.get());
  glViewport(0, 0, kArrayWidth, rows_for(points_));
  pose_program_.use();
  pose_program_.set_texture("modes", 0, GL_TEXTURE_2D_ARRAY, modes_texture_.get());
  pose_program_.set_texture("rest", 1, GL_TEXTURE_2D, rest_.get());
  pose_program_.set("count", static_cast<int>(q.size()));
  glUniform1fv(pose_program_.at("q"), static_cast<GLsizei>(q.size()), q.data());
  pose_program_.set_matrix("placement", columns);
  glDrawArrays(GL_TRIANGLES, 0, 3);
  find_normals(posed);
}

void BodyDrawing::place(std::span<const float> positions, PosedBody& posed) const {
  std::vector<float> texels(4 * static_cast<std::size_t>(kArrayWidth) * static_cast<std::size_t>(rows_for(points_)));
  for (std::size_t i = 0; i < points_; ++i) {
    std::ranges::copy(positions.subspan(3 * i, 3), texels.begin() + static_cast<std::ptrdiff_t>(4 * i));
    texels[4 * i + 3] = 1;
  }
  glBindTexture(GL_TEXTURE_2D, posed.positions_.get());
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, kArrayWidth, rows_for(points_), kFloats4.given, kFloats4.type, texels.data());
  find_normals(posed);
}

void BodyDrawing::find_normals(PosedBody& posed) const {
  glDisable(GL_BLEND);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_SCISSOR_TEST);
  glBindVertexArray(empty_.get());
  glBindFramebuffer(GL_FRAMEBUFFER, posed.normal_target_.get());
  glViewport(0, 0, kArrayWidth, rows_for(corners_));
  normal_program_.use();
  normal_program_.set_texture("positions", 0, GL_TEXTURE_2D, posed.positions_.get());
  normal_program_.set_texture("starts", 1, GL_TEXTURE_2D, starts_.get());
  normal_program_.set_texture("around", 2, GL_TEXTURE_2D, around_.get());
  normal_program_.set_texture("triangles", 3, GL_TEXTURE_2D, triangles_.get());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

void BodyDrawing::draw_triangles() const {
  glBindVertexArray(mesh_.get());
  glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * triangle_count_), GL_UNSIGNED_INT, nullptr);
}

void BodyDrawing::draw_edges() const {
  glBindVertexArray(edges_.get());
  glDrawElements(GL_LINES, edge_count_, GL_UNSIGNED_INT, nullptr);
}

}  // namespace exmat::viewer
