#include "common/core/atomic_file.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <fcntl.h>
#include <random>
#include <string>
#include <string_view>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "common/core/error.h"
#include "common/core/fnv_hash.h"

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

constexpr std::string_view kExtension = ".tmp";

std::string hexadecimal(std::uint64_t value) {
  std::array<char, 16> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value, 16).ptr;
  return {digits.data(), end};
}

// Names the processes that a process id speaks of here: of this machine, and of this container on it.
std::string process_world() {
  std::array<char, 256> host{};
  ::gethostname(host.data(), host.size() - 1);
  std::error_code ignored;
  const auto container = std::filesystem::read_symlink("/proc/self/ns/pid", ignored);
  return hexadecimal(fnv_hash(std::string(host.data()) + '\n' + container.string()));
}

// ".MACHINE-"
const std::string& own_prefix() {
  static const std::string prefix = '.' + process_world() + '-';
  return prefix;
}

std::string own_suffix() {
  std::random_device device;
  const auto random = (std::uint64_t{device()} << 32) | device();
  return own_prefix() + std::to_string(::getpid()) + '-' + hexadecimal(random) + std::string(kExtension);
}

// Whether a name is that of a temporary file, beginning with `prefix`, of a process that is no more.
bool is_left_behind(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix) || !name.ends_with(kExtension)) return false;
  name.remove_prefix(prefix.size());
  pid_t process = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), process);
  if (error != std::errc() || end == name.data() + name.size() || *end != '-' || process <= 0) return false;
  return ::kill(process, 0) != 0 && errno == ESRCH;
}

std::filesystem::path folder_of(const std::filesystem::path& target) {
  return target.has_parent_path() ? target.parent_path() : std::filesystem::path(".");
}

// What cannot be listed or removed stays: it is in nobody's way.
void remove_left_behind(const std::filesystem::path& target) {
  const std::string prefix = target.filename().string() + own_prefix();
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder_of(target), error), end; !error && entry != end;
       entry.increment(error))
    if (is_left_behind(entry->path().filename().string(), prefix)) ::unlink(entry->path().c_str());
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
  remove_left_behind(target_);
  for (int attempt = 0; attempt < kNameAttempts; ++attempt) {
    temporary_ = target_;
    temporary_ += own_suffix();
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
