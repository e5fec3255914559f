#pragma once

#include <epoxy/gl.h>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace exmat::viewer {

/// The name of a GL object, deleted with its owner.
template <auto Delete>
class GlName {
 public:
  GlName() = default;
  explicit GlName(GLuint name) : name_(name) {}
  GlName(GlName&& other) noexcept : name_(std::exchange(other.name_, 0)) {}
  GlName& operator=(GlName&& other) noexcept {
    std::swap(name_, other.name_);
    return *this;
  }
  ~GlName() {
    if (name_ != 0) Delete(name_);
  }
  GLuint get() const { return name_; }
  explicit operator bool() const { return name_ != 0; }

 private:
  GLuint name_ = 0;
};

// Functions of epoxy are pointers that change: they are called here, not taken.
inline void delete_texture(GLuint name) { glDeleteTextures(1, &name); }
inline void delete_buffer(GLuint name) { glDeleteBuffers(1, &name); }
inline void delete_vertex_array(GLuint name) { glDeleteVertexArrays(1, &name); }
inline void delete_framebuffer(GLuint name) { glDeleteFramebuffers(1, &name); }
inline void delete_renderbuffer(GLuint name) { glDeleteRenderbuffers(1, &name); }
inline void delete_program(GLuint name) { glDeleteProgram(name); }

using Texture = GlName<delete_texture>;
using Buffer = GlName<delete_buffer>;
using VertexArrayName = GlName<delete_vertex_array>;
using Framebuffer = GlName<delete_framebuffer>;
using Renderbuffer = GlName<delete_renderbuffer>;

Texture make_texture();
Buffer make_buffer();
VertexArrayName make_vertex_array();
Framebuffer make_framebuffer();
Renderbuffer make_renderbuffer();

/// A vertex and a fragment shader, linked. Throws WorkError with the log of the driver.
class Program {
 public:
  Program() = default;
  Program(std::string_view name, std::string_view vertex, std::string_view fragment);

  void use() const { glUseProgram(name_.get()); }
  /// -1 of what the shader does not use, which the functions that set it then ignore.
  GLint at(const char* uniform) const { return glGetUniformLocation(name_.get(), uniform); }

  void set(const char* uniform, int value) const { glUniform1i(at(uniform), value); }
  void set(const char* uniform, float value) const { glUniform1f(at(uniform), value); }
  void set(const char* uniform, std::span<const float, 3> v) const { glUniform3fv(at(uniform), 1, v.data()); }
  void set(const char* uniform, std::span<const float, 4> v) const { glUniform4fv(at(uniform), 1, v.data()); }
  /// By columns.
  void set_matrix(const char* uniform, const float* numbers) const {
    glUniformMatrix4fv(at(uniform), 1, GL_FALSE, numbers);
  }
  void set_texture(const char* uniform, int unit, GLenum target, GLuint texture) const;

 private:
  GlName<delete_program> name_;
};

/// The first error that GL has noted since the last call, in words; empty where there is none.
std::string take_gl_error();

}  // namespace exmat::viewer
