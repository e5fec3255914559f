#include "common/core/atomic_file.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <climits>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <fcntl.h>
#include <random>
#include <string>
#include <string_view>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "common/core/command_files.h"
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

// True if a name is that of a temporary file, beginning with `prefix`, of a process that is no more.
bool is_left_behind(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix) || !name.ends_with(kExtension)) return false;
  name.remove_prefix(prefix.size());
  pid_t process = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), process);
  if (error != std::errc() || end == name.data() + name.size() || *end != '-' || process <= 0) return false;
  return ::kill(process, 0) != 0 && errno == ESRCH;
}

// A temporary file begins with its target's name, with as much of it as leaves room for the rest.
std::string beginning_of(const std::filesystem::path& target) {
  constexpr std::size_t kMost = 128;
  return target.filename().string().substr(0, kMost);
}

// A file that cannot be listed or removed stays: it is in nobody's way.
void remove_left_behind(const std::filesystem::path& target) {
  const std::string prefix = beginning_of(target) + own_prefix();
  std::error_code error;
  for (std::filesystem::directory_iterator entry(parent_folder(target), error), end; !error && entry != end;
       entry.increment(error))
    if (is_left_behind(entry->path().filename().string(), prefix)) ::unlink(entry->path().c_str());
}

void check_target(const std::filesystem::path& target) {
  std::error_code ignored;
  const auto folder = parent_folder(target);
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

/// A temporary file that a signal handler removes: plain memory that is never freed.
struct PendingFile {
  std::atomic<pid_t> process{0};  // 0: free, -1: being filled in
  std::array<char, PATH_MAX> temporary{}, target{};
};

std::array<PendingFile, 16> pending_files;
static_assert(std::atomic<pid_t>::is_always_lock_free);

void copy_path(std::array<char, PATH_MAX>& to, const std::filesystem::path& path) {
  std::strncpy(to.data(), path.c_str(), to.size() - 1);
}

/// The slot of the files; -1 where all are taken or a name is too long.
int add_pending(const std::filesystem::path& temporary, const std::filesystem::path& target) {
  if (std::max(temporary.native().size(), target.native().size()) >= PATH_MAX) return -1;
  for (std::size_t slot = 0; slot < pending_files.size(); ++slot) {
    PendingFile& file = pending_files[slot];
    pid_t expected = 0;
    if (!file.process.compare_exchange_strong(expected, -1)) continue;
    copy_path(file.temporary, temporary);
    copy_path(file.target, target);
    file.process = ::getpid();
    return static_cast<int>(slot);
  }
  return -1;
}

void remove_pending(int slot) {
  if (slot >= 0) pending_files[static_cast<std::size_t>(slot)].process = 0;
}

void say(const char* text) { static_cast<void>(!::write(STDERR_FILENO, text, std::strlen(text))); }

// Some file systems cannot flush a folder; the rename is then as durable as they make it.
void flush_folder(const std::filesystem::path& folder) {
  const Descriptor descriptor(folder, O_RDONLY | O_DIRECTORY);
  if (descriptor.get() >= 0) ::fsync(descriptor.get());
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : target_(std::move(target)), file_(link_target(target_)) {
  check_target(file_);
  remove_left_behind(file_);
  for (int attempt = 0; attempt < kNameAttempts; ++attempt) {
    temporary_ = parent_folder(file_) / (beginning_of(file_) + own_suffix());
    slot_ = add_pending(temporary_, target_);
    const Descriptor descriptor(temporary_, O_WRONLY | O_CREAT | O_EXCL);
    const int error_number = errno;
    pending_ = descriptor.get() >= 0;
    if (pending_) return;
    remove_pending(std::exchange(slot_, -1));
    if (error_number != EEXIST) fail(target_, error_number);
  }
  fail(target_, EEXIST);
}

AtomicFile::~AtomicFile() {
  if (pending_) ::unlink(temporary_.c_str());
  remove_pending(slot_);
}

void AtomicFile::commit() {
  {
    const Descriptor descriptor(temporary_, O_RDWR);
    if (descriptor.get() < 0 || ::fsync(descriptor.get()) != 0) fail(target_, errno);
  }
  if (::rename(temporary_.c_str(), file_.c_str()) != 0) fail(target_, errno);
  pending_ = false;
  remove_pending(std::exchange(slot_, -1));
  flush_folder(parent_folder(file_));
}

void end_by_signal(int signal) {
  const char* const name = ::sigabbrev_np(signal);
  bool said = false;
  const auto say_name = [&] {
    if (std::exchange(said, true)) return;
    say("ended by SIG");
    say(name != nullptr ? name : "?");
  };
  if (signal != SIGPIPE) say_name();  // whoever reads no more of a summary needs no word of it
  for (const PendingFile& file : pending_files) {
    if (file.process != ::getpid()) continue;
    ::unlink(file.temporary.data());
    say_name();
    say("; not written: ");
    say(file.target.data());
  }
  if (said) say("\n");
  std::signal(signal, SIG_DFL);
  std::raise(signal);
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
