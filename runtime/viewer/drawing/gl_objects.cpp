#include "runtime/viewer/drawing/gl_objects.h"

#include <fmt/format.h>

#include "common/core/error.h"

namespace exmat::viewer {
namespace {

template <typename Name, typename Generate>
Name made(Generate&& generate) {
  GLuint name = 0;
  generate(&name);
  return Name(name);
}

std::string log_of(GLuint object, bool program) {
  char text[2000] = {};
  GLsizei length = 0;
  if (program)
    glGetProgramInfoLog(object, sizeof text, &length, text);
  else
    glGetShaderInfoLog(object, sizeof text, &length, text);
  return {text, static_cast<std::size_t>(length)};
}

GLuint compile(std::string_view name, GLenum kind, std::string_view source) {
  const GLuint shader = glCreateShader(kind);
  const char* const text = source.data();
  const auto length = static_cast<GLint>(source.size());
  glShaderSource(shader, 1, &text, &length);
  glCompileShader(shader);
  GLint compiled = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (compiled == GL_TRUE) return shader;
  const std::string log = log_of(shader, false);
  glDeleteShader(shader);
  throw WorkError(fmt::format("the graphics driver does not take the {} shader of {}: {}",
                              kind == GL_VERTEX_SHADER ? "vertex" : "fragment", name, log));
}

}  // namespace

Texture make_texture() {
  return made<Texture>([](GLuint* name) { glGenTextures(1, name); });
}
Buffer make_buffer() {
  return made<Buffer>([](GLuint* name) { glGenBuffers(1, name); });
}
VertexArrayName make_vertex_array() {
  return made<VertexArrayName>([](GLuint* name) { glGenVertexArrays(1, name); });
}
Framebuffer make_framebuffer() {
  return made<Framebuffer>([](GLuint* name) { glGenFramebuffers(1, name); });
}
Renderbuffer make_renderbuffer() {
  return made<Renderbuffer>([](GLuint* name) { glGenRenderbuffers(1, name); });
}

Program::Program(std::string_view name, std::string_view vertex, std::string_view fragment) {
  const GLuint first = compile(name, GL_VERTEX_SHADER, vertex);
  const GLuint second = compile(name, GL_FRAGMENT_SHADER, fragment);
  name_ = GlName<delete_program>(glCreateProgram());
  for (const GLuint shader : {first, second}) {
    glAttachShader(name_.get(), shader);
    glDeleteShader(shader);
  }
  glLinkProgram(name_.get());
  GLint linked = 0;
  glGetProgramiv(name_.get(), GL_LINK_STATUS, &linked);
  if (linked != GL_TRUE)
    throw WorkError(
        fmt::format("the graphics driver does not link the shaders of {}: {}", name, log_of(name_.get(), true)));
}

void Program::set_texture(const char* uniform, int unit, GLenum target, GLuint texture) const {
  glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  glBindTexture(target, texture);
  set(uniform, unit);
}

std::string take_gl_error() {
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return {};
  while (glGetError() != GL_NO_ERROR) {
  }
  const char* const name = error == GL_INVALID_ENUM                    ? "invalid enum"
                           : error == GL_INVALID_VALUE                 ? "invalid value"
                           : error == GL_INVALID_OPERATION             ? "invalid operation"
                           : error == GL_INVALID_FRAMEBUFFER_OPERATION ? "invalid framebuffer operation"
                           : error == GL_OUT_OF_MEMORY                 ? "out of memory"
                                                                       : "unknown error";
  return fmt::format("OpenGL: {} (0x{:04x})", name, error);
}

}  // namespace exmat::viewer
