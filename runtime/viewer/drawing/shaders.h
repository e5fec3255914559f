#pragma once

#include <string>
#include <string_view>

// Shaders in GLSL 3.30. What several of them use is a piece that stands in front.
namespace exmat::viewer::shaders {

inline constexpr std::string_view kVersion = "#version 330 core\n";

/// A triangle that covers the picture.
inline constexpr std::string_view kWholePicture = R"(#version 330 core
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
)";

/// Arrays as textures: entry i of a texture that is kWidth wide.
inline constexpr std::string_view kArrays = R"(
ivec2 place(uint i) { return ivec2(int(i & 1023u), int(i >> 10)); }
)";

/// Pose of a body: each pixel is a point, x = R (X + U q) + t, and how far it was moved.
inline constexpr std::string_view kPose = R"(#version 330 core
uniform sampler2DArray modes;
uniform sampler2D rest;
uniform int count;
uniform float q[512];
uniform mat4 placement;
out vec4 position;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec3 u = vec3(0.0);
  for (int j = 0; j < count; ++j) u += q[j] * texelFetch(modes, ivec3(at, j), 0).xyz;
  position = vec4((placement * vec4(texelFetch(rest, at, 0).xyz + u, 1.0)).xyz, length(u));
}
)";

/// Normals of a posed body: each pixel is a corner, the mean of its triangles by area.
inline constexpr std::string_view kNormals = R"(
uniform sampler2D positions;
uniform usampler2D starts;
uniform usampler2D around;
uniform usampler2D triangles;
out vec4 normal;
void main() {
  uvec2 range = texelFetch(starts, ivec2(gl_FragCoord.xy), 0).xy;
  vec3 sum = vec3(0.0);
  for (uint i = 0u; i < range.y; ++i) {
    uvec3 t = texelFetch(triangles, place(texelFetch(around, place(range.x + i), 0).x), 0).xyz;
    vec3 a = texelFetch(positions, place(t.x), 0).xyz;
    sum += cross(texelFetch(positions, place(t.y), 0).xyz - a, texelFetch(positions, place(t.z), 0).xyz - a);
  }
  float size = length(sum);
  normal = vec4(size > 0.0 ? sum / size : vec3(0.0, 0.0, 1.0), 1.0);
}
)";

/// A corner of a posed body, with the value of a field.
inline constexpr std::string_view kBodyVertex = R"(
layout(location = 0) in uint point;
uniform sampler2D positions;
uniform sampler2D normals;
uniform sampler2D field;
uniform bool by_displacement;
uniform mat4 view_projection;
uniform vec3 offset;
out vec3 world;
out vec3 normal;
out float value;
void main() {
  vec4 posed = texelFetch(positions, place(point), 0);
  world = posed.xyz + offset;
  normal = texelFetch(normals, place(uint(gl_VertexID)), 0).xyz;
  value = by_displacement ? posed.w : texelFetch(field, place(point), 0).x;
  gl_Position = view_projection * vec4(world, 1.0);
}
)";

/// A point of a rigid mesh.
inline constexpr std::string_view kSolidVertex = R"(
layout(location = 0) in vec3 point;
layout(location = 1) in vec3 outward;
uniform mat4 placement;
uniform mat4 view_projection;
uniform vec3 offset;
out vec3 world;
out vec3 normal;
out float value;
void main() {
  world = (placement * vec4(point, 1.0)).xyz + offset;
  normal = mat3(placement) * outward;
  value = 0.0;
  gl_Position = view_projection * vec4(world, 1.0);
}
)";

/// Light from above with a soft shadow.
inline constexpr std::string_view kLight = R"(
uniform vec3 eye;
uniform vec3 light;   // towards it
uniform vec3 up;
uniform mat4 to_light;
uniform sampler2DShadow shadow;
uniform float softness;
uniform int samples;
float lit(vec3 at, vec3 n) {
  vec4 p = to_light * vec4(at, 1.0);
  vec3 s = p.xyz * 0.5 + 0.5;
  if (any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)))) return 1.0;
  float slope = clamp(1.0 - dot(n, light), 0.0, 1.0);
  float depth = s.z - 0.0008 - 0.003 * slope;
  float sum = 0.0;
  for (int i = 0; i < samples; ++i) {
    float r = softness * sqrt((float(i) + 0.5) / float(samples));
    float a = 2.399963 * float(i);
    sum += texture(shadow, vec3(s.xy + r * vec2(cos(a), sin(a)), depth));
  }
  return sum / float(samples);
}
vec3 shaded(vec3 base, vec3 at, vec3 n) {
  vec3 v = normalize(eye - at);
  if (dot(n, v) < 0.0) n = -n;
  float towards = dot(n, light);
  float direct = max(towards, 0.0) * lit(at, n);
  float sky = 0.5 + 0.5 * dot(n, up);
  vec3 ambient = mix(vec3(0.36, 0.34, 0.33), vec3(0.55, 0.57, 0.61), sky);
  float rim = pow(1.0 - max(dot(n, v), 0.0), 3.0);
  vec3 h = normalize(light + v);
  float gloss = 0.06 * pow(max(dot(n, h), 0.0), 24.0) * step(0.0, towards);
  return base * (ambient + 0.62 * direct * vec3(1.0, 0.97, 0.92)) + vec3(gloss + 0.05 * rim * sky);
}
vec3 shown(vec3 linear) { return pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2)); }
)";

/// From dark blue by green to yellow, ever lighter: told apart by all eyes, and in grey.
inline constexpr std::string_view kScale = R"(
vec3 scale(float t) {
  const vec3 stops[5] = vec3[5](vec3(0.10, 0.13, 0.40), vec3(0.09, 0.36, 0.56), vec3(0.13, 0.58, 0.53),
                                vec3(0.56, 0.77, 0.33), vec3(0.98, 0.90, 0.30));
  float x = clamp(t, 0.0, 1.0) * 4.0;
  int i = min(int(x), 3);
  return pow(mix(stops[i], stops[i + 1], x - float(i)), vec3(2.2));
}
)";

inline constexpr std::string_view kBodyFragment = R"(
in vec3 world;
in vec3 normal;
in float value;
uniform vec4 colour;
uniform bool coloured;
uniform float most;
uniform bool ghost;
out vec4 pixel;
void main() {
  vec3 n = normalize(normal);
  vec3 base = coloured ? scale(value / most) : colour.rgb;
  float opacity = colour.a;
  if (ghost) opacity *= 0.35 + 0.65 * pow(1.0 - abs(dot(n, normalize(eye - world))), 1.5);
  pixel = vec4(shown(shaded(base, world, n)), opacity);
}
)";

inline constexpr std::string_view kPlainFragment = R"(#version 330 core
uniform vec4 colour;
out vec4 pixel;
void main() { pixel = colour; }
)";

inline constexpr std::string_view kDepthFragment = R"(#version 330 core
void main() {}
)";

/// The floor: nothing but its shadow and a faint grid, fading out.
inline constexpr std::string_view kFloorFragment = R"(
in vec3 world;
in vec3 normal;
in float value;
uniform vec3 middle;
uniform float reach;
uniform float cell;
uniform vec3 first;
uniform vec3 second;
out vec4 pixel;
void main() {
  float away = length(world - middle) / reach;
  float fade = 1.0 - smoothstep(0.25, 1.0, away);
  vec2 at = vec2(dot(world, first), dot(world, second)) / cell;
  vec2 width = max(fwidth(at), vec2(1e-6));
  vec2 line = abs(fract(at - 0.5) - 0.5) / width;
  float grid = (1.0 - min(min(line.x, line.y), 1.0)) * clamp(0.4 / max(width.x, width.y), 0.0, 1.0);
  float dark = 0.30 * (1.0 - lit(world, up));
  float opacity = fade * max(dark, 0.10 * grid);
  if (opacity < 0.002) discard;
  pixel = vec4(0.13, 0.15, 0.20, opacity);
}
)";

inline constexpr std::string_view kBackgroundFragment = R"(#version 330 core
uniform vec2 size;
out vec4 pixel;
void main() {
  vec2 at = gl_FragCoord.xy / size;
  vec3 c = mix(vec3(0.855, 0.862, 0.872), vec3(0.962, 0.964, 0.966), smoothstep(0.0, 0.95, at.y));
  float corner = length((at - 0.5) * vec2(1.1, 0.9));
  // Half a step of noise: no bands.
  float noise = fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) / 255.0;
  pixel = vec4(c - 0.05 * corner * corner + noise, 1.0);
}
)";

/// Small balls at places, by size.
inline constexpr std::string_view kDotVertex = R"(#version 330 core
layout(location = 0) in vec3 point;
layout(location = 1) in float size;
uniform mat4 view_projection;
uniform vec3 offset;
uniform float pixels;
void main() {
  gl_Position = view_projection * vec4(point + offset, 1.0);
  gl_PointSize = max(3.0, pixels * size);
}
)";

inline constexpr std::string_view kDotFragment = R"(#version 330 core
uniform vec4 colour;
out vec4 pixel;
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  float r = length(at);
  if (r > 1.0) discard;
  float light = 0.65 + 0.35 * sqrt(1.0 - r * r) - 0.15 * at.y;
  pixel = vec4(colour.rgb * light, colour.a * smoothstep(1.0, 0.85, r));
}
)";

inline std::string joined(std::initializer_list<std::string_view> pieces) {
  std::string text;
  for (const std::string_view piece : pieces) text += piece;
  return text;
}

}  // namespace exmat::viewer::shaders
