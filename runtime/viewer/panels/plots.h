#pragma once

#include "runtime/viewer/panels/history.h"
#include "runtime/viewer/panels/style.h"
#include "runtime/viewer/studio/studio.h"

namespace exmat::viewer {

/// The panel of what goes on: weights, energies, times, status.
void draw_plots(const Style& style, const Snapshot& snapshot, const History& history, const Studio& studio,
                const std::vector<std::shared_ptr<const BodyShape>>& shapes, double frame_seconds);

}  // namespace exmat::viewer
