#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "runtime/viewer/drawing/canvas.h"

namespace exmat::viewer {

/// Appears whole or not at all. Throws WorkError.
void write_png(const Picture& picture, const std::filesystem::path& file);

/// Recorder of pictures one after another: into a folder of PNG, or a movie by ffmpeg (.mp4, .gif).
class Recording {
 public:
  /// Throws InputError: an extension that is none of these; WorkError: there is no ffmpeg, no such folder.
  Recording(const std::filesystem::path& target, double frame_rate, const PictureSize& size);
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  void add(const Picture& picture);
  /// Throws WorkError where ffmpeg has failed.
  void finish();

  int frames() const { return frames_; }

 private:
  std::filesystem::path target_;
  std::FILE* movie_ = nullptr;  ///< the pipe to ffmpeg; null: a folder
  int frames_ = 0;
};

/// Throws InputError where nothing can be recorded there, before anything is computed.
void check_recording(const std::filesystem::path& target);

/// Claims the folder or the movie as an output of the command.
void claim_recording(const std::filesystem::path& target);

}  // namespace exmat::viewer
