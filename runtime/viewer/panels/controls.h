#pragma once

#include <string>

#include "runtime/viewer/panels/style.h"
#include "runtime/viewer/studio/studio.h"

namespace exmat::viewer {

/// The panel of what can be turned.
class Controls {
 public:
  Controls(std::string title, std::string save_name) : title_(std::move(title)), save_name_(std::move(save_name)) {}

  void draw(const Style& style, const Snapshot& snapshot, Studio& studio);

 private:
  void draw_run(const Style& style, const Snapshot& snapshot, Studio& studio);
  void draw_kind(Studio& studio);
  void draw_examples(Settings& settings, const Snapshot& snapshot, Studio& studio);
  void draw_body(Settings& settings);
  void draw_world(const Style& style, const Snapshot& snapshot, Settings& settings, Studio& studio);
  void draw_view(Studio& studio);
  void draw_saving(Studio& studio);

  std::string title_, save_name_;
  std::size_t kind_ = 0;
};

}  // namespace exmat::viewer
