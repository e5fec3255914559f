#pragma once

#include "runtime/viewer/drawing/scene_drawing.h"
#include "runtime/viewer/panels/style.h"
#include "runtime/viewer/studio/studio.h"

namespace exmat::viewer {

// Drawings over the scene itself.

/// Hands and what they hold, names of examples, the scale of colours.
void draw_overlay(const Style& style, const Snapshot& snapshot, const SceneDrawing& drawing, Studio& studio,
                  const PictureSize& picture);

/// The page of keys.
void draw_help(const Style& style);

/// A line that says something for a while.
void draw_message(const Style& style, const Studio& studio);

}  // namespace exmat::viewer
