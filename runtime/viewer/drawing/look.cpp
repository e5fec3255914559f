#include "runtime/viewer/drawing/look.h"

#include <algorithm>

namespace exmat::viewer {
namespace {

constexpr Colour kClay{0.890F, 0.690F, 0.500F};

}  // namespace

Colour body_colour(std::size_t body) {
  constexpr float kWhite = 0.97F, kShare = 0.58F;
  if (body == 0) return kClay;
  Colour colour = kPalette[body % kPalette.size()];
  for (float& part : colour) part = kShare * part + (1 - kShare) * kWhite;
  return colour;
}

Colour scale_colour(float share) {
  constexpr std::array<Colour, 5> kStops{{{0.10F, 0.13F, 0.40F},
                                          {0.09F, 0.36F, 0.56F},
                                          {0.13F, 0.58F, 0.53F},
                                          {0.56F, 0.77F, 0.33F},
                                          {0.98F, 0.90F, 0.30F}}};
  const float at = std::clamp(share, 0.0F, 1.0F) * 4;
  const auto first = std::min<std::size_t>(static_cast<std::size_t>(at), 3);
  const float rest = at - static_cast<float>(first);
  Colour colour{};
  for (std::size_t i = 0; i < 3; ++i) colour[i] = (1 - rest) * kStops[first][i] + rest * kStops[first + 1][i];
  return colour;
}

}  // namespace exmat::viewer
