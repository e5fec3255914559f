#include "common/core/atomic_file.h"

#include <cerrno>
#include <cstdint>
#include <fcntl.h>
#include <random>
#include <string>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "common/core/error.h"

namespace exmat {
namespace {

constexpr int kNameAttempts = 16;
constexpr mode_t kMode = 0666;  // less the umask, as for any new file

[[noreturn]] void fail(const std::filesystem::path& target, const std::string& reason) {
  throw WorkError("cannot write " + target.string() + ": " + reason);
}

[[noreturn]] void fail(const std::filesystem::path& target, int error_number) {
  fail(target, std::generic_category().message(error_number));
}

std::string random_suffix() {
  constexpr char kDigits[] = "0123456789abcdef";
  constexpr int kLength = 16;
  std::random_device device;
  std::string suffix = ".";
  for (int i = 0; i < kLength; ++i) suffix += kDigits[device() % 16];
  return suffix + ".tmp";
}

std::filesystem::path folder_of(const std::filesystem::path& target) {
  return target.has_parent_path() ? target.parent_path() : std::filesystem::path(".");
}

void check_target(const std::filesystem::path& target) {
  std::error_code ignored;
  const auto folder = folder_of(target);
  if (!std::filesystem::exists(folder, ignored)) fail(target, "there is no folder " + folder.string());
  const auto status = std::filesystem::status(target, ignored);
  if (std::filesystem::is_directory(status)) fail(target, "it is a folder");
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    fail(target, "it is not a regular file");
}

class Descriptor {
 public:
  Descriptor(const std::filesystem::path& file, int flags) : value_(::open(file.c_str(), flags | O_CLOEXEC, kMode)) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return value_; }

 private:
  int value_;
};

// Some file systems cannot flush a folder; the rename is then as durable as they make it.
void flush_folder(const std::filesystem::path& folder) {
  const Descriptor descriptor(folder, O_RDONLY | O_DIRECTORY);
  if (descriptor.get() >= 0) ::fsync(descriptor.get());
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : target_(std::move(target)) {
  check_target(target_);
  for (int attempt = 0; attempt < kNameAttempts; ++attempt) {
    temporary_ = target_;
    temporary_ += random_suffix();
    const Descriptor descriptor(temporary_, O_WRONLY | O_CREAT | O_EXCL);
    if (descriptor.get() >= 0) {
      pending_ = true;
      return;
    }
    if (errno != EEXIST) fail(target_, errno);
  }
  fail(target_, EEXIST);
}

AtomicFile::~AtomicFile() {
  if (pending_) ::unlink(temporary_.c_str());
}

void AtomicFile::commit() {
  {
    const Descriptor descriptor(temporary_, O_RDWR);
    if (descriptor.get() < 0 || ::fsync(descriptor.get()) != 0) fail(target_, errno);
  }
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail(target_, errno);
  pending_ = false;
  flush_folder(folder_of(target_));
}

void write_file_atomically(const std::filesystem::path& target, std::string_view content) {
  AtomicFile output(target);
  {
    const Descriptor descriptor(output.temporary(), O_WRONLY);
    if (descriptor.get() < 0) fail(target, errno);
    while (!content.empty()) {
      const ssize_t written = ::write(descriptor.get(), content.data(), content.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail(target, errno);
      content.remove_prefix(static_cast<std::size_t>(written));
    }
  }
  output.commit();
}

}  // namespace exmat
