#include "runtime/viewer/recording/recording.h"

#include <csignal>
#include <cstdlib>
#include <fmt/format.h>
#include <string_view>
#include <system_error>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/error.h"

namespace exmat::viewer {
namespace {

constexpr const char* kOption = "--record";

bool is_movie(const std::filesystem::path& target) {
  return target.extension() == ".mp4" || target.extension() == ".gif";
}

/// For a shell.
std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

bool has_ffmpeg() { return std::system("command -v ffmpeg >/dev/null 2>&1") == 0; }

std::string command(const std::filesystem::path& target, double frame_rate, const PictureSize& size) {
  const std::string_view filter =
      target.extension() == ".gif"
          ? "-vf "
            "'split[a][b];[a]palettegen=max_colors=128:stats_mode=diff[p];[b][p]paletteuse=dither=bayer:bayer_scale=4:"
            "diff_mode=rectangle' -loop 0"
          : "-vf 'pad=ceil(iw/2)*2:ceil(ih/2)*2' -c:v libx264 -preset medium -crf 18 -pix_fmt yuv420p -movflags "
            "+faststart";
  return fmt::format(
      "ffmpeg -hide_banner -loglevel error -y -f rawvideo -pix_fmt rgb24 -s {}x{} -r {} -i - {} -fflags +bitexact "
      "-flags +bitexact -map_metadata -1 {}",
      size.width, size.height, frame_rate, filter, quoted(std::filesystem::absolute(target).string()));
}

}  // namespace

void write_png(const Picture& picture, const std::filesystem::path& file) {
  AtomicFile output(file);
  const int written = stbi_write_png(output.temporary().c_str(), picture.size.width, picture.size.height, 3,
                                     picture.rgb.data(), 3 * picture.size.width);
  if (written == 0) throw WorkError(fmt::format("{}: the picture cannot be written", file.string()));
  output.commit();
}

void check_recording(const std::filesystem::path& target) {
  const std::string extension = target.extension().string();
  if (!extension.empty() && !is_movie(target) && !std::filesystem::is_directory(target))
    throw InputError(
        {kOption, "", "a folder, or a movie by its extension: .mp4 or .gif", '"' + target.string() + '"', ""});
  if (is_movie(target) && !has_ffmpeg())
    throw InputError({kOption, "", "ffmpeg, which makes movies, among the programs", "none",
                      "install it (apt-get install ffmpeg), or name a folder for pictures"});
}

void claim_recording(const std::filesystem::path& target) {
  check_recording(target);
  is_movie(target) ? claim_output(target, kOption) : claim_folder(target, kOption);
}

Recording::Recording(const std::filesystem::path& target, double frame_rate, const PictureSize& size)
    : target_(target) {
  check_recording(target);
  if (!is_movie(target)) {
    std::error_code error;
    std::filesystem::create_directories(target, error);
    if (error) throw WorkError(fmt::format("{}: the folder cannot be made: {}", target.string(), error.message()));
    return;
  }
  std::signal(SIGPIPE, SIG_IGN);  // an ffmpeg that ends is told by its status
  movie_ = popen(command(target, frame_rate, size).c_str(), "w");
  if (movie_ == nullptr) throw WorkError("ffmpeg cannot be started");
}

Recording::~Recording() {
  if (movie_ != nullptr) pclose(movie_);
}

void Recording::add(const Picture& picture) {
  if (movie_ == nullptr) {
    const std::filesystem::path file = target_ / fmt::format("{:05}.png", frames_++);
    check_output(file, kOption);
    write_png(picture, file);
    return;
  }
  ++frames_;
  if (std::fwrite(picture.rgb.data(), 1, picture.rgb.size(), movie_) != picture.rgb.size()) finish();
}

void Recording::finish() {
  if (movie_ == nullptr) return;
  const int status = pclose(std::exchange(movie_, nullptr));
  if (status != 0)
    throw WorkError(fmt::format("{}: ffmpeg has failed (its message is above); a folder for pictures needs none",
                                target_.string()));
}

}  // namespace exmat::viewer
