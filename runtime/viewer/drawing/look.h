#pragma once

#include <array>

#include "runtime/viewer/simulation/snapshot.h"

namespace exmat::viewer {

/// Choice of what is shown of a scene.
struct Look {
  Colouring colouring = Colouring::kPlain;
  bool surface = true, wireframe = false, elements = false, examples = false, targets = false;
  bool bones = false;  ///< bones are shown, and joints can be dragged
  bool floor = true, shadow = true;

  SnapshotRequest request() const { return {colouring, elements, targets}; }
};

using Colour = std::array<float, 3>;  ///< sRGB, 0 to 1

/// Colours that all eyes tell apart (Okabe and Ito 2008).
inline constexpr std::array<Colour, 7> kPalette{{{0.902F, 0.624F, 0.000F},
                                                 {0.337F, 0.706F, 0.914F},
                                                 {0.000F, 0.620F, 0.451F},
                                                 {0.835F, 0.369F, 0.000F},
                                                 {0.000F, 0.447F, 0.698F},
                                                 {0.800F, 0.475F, 0.655F},
                                                 {0.941F, 0.894F, 0.259F}}};

/// Colour of a body by its number: clay, then the palette, lighter.
Colour body_colour(std::size_t body);

/// The scale of fields at 0 to 1, as the shader has it.
Colour scale_colour(float share);

}  // namespace exmat::viewer
