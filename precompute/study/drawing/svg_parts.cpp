#include "precompute/study/drawing/svg_parts.h"

#include <array>
#include <fmt/format.h>

#include "common/core/markup.h"

namespace exmat::precompute {
namespace {

// Readable on light and dark pages.
constexpr std::array<const char*, 8> kPalette{"#4477aa", "#ee6677", "#228833", "#c0a020",
                                              "#33aacc", "#aa3377", "#888888", "#ee8833"};

}  // namespace

const char* colour_of(int colour) {
  return colour < 0 ? "currentColor" : kPalette[static_cast<std::size_t>(colour) % kPalette.size()];
}

std::string text_at(double x, double y, const char* anchor, const std::string& text, const char* more) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more,
                     escaped(text));
}

}  // namespace exmat::precompute
