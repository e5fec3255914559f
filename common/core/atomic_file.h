#pragma once

#include <filesystem>
#include <string_view>

namespace exmat {

/// An output that appears whole or not at all: written under another name beside its target, then renamed over it.
///
///     AtomicFile output(target);       // creates the temporary file, empty
///     write_somehow(output.temporary());
///     output.commit();                 // fsync, rename
///
/// Without commit() the destructor removes the temporary file and leaves the target as it was. A target that is a
/// symbolic link stays one: the file that it leads to is replaced. What a killed process left behind beside the same
/// target is removed by the next one on this machine.
class AtomicFile {
 public:
  /// Creates TARGET.MACHINE-PID-RANDOM.tmp. Throws WorkError: no such folder, not writable, target is a folder, disk
  /// full.
  explicit AtomicFile(std::filesystem::path target);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// To be written, by any means, before commit(). Already exists.
  const std::filesystem::path& temporary() const { return temporary_; }
  const std::filesystem::path& target() const { return target_; }

  /// Flushes the temporary file to disk and renames it over the target. Throws WorkError; the target is then as it was.
  void commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path file_;  // what target_ leads to
  std::filesystem::path temporary_;
  int slot_ = -1;  // among those that end_by_signal() removes
  bool pending_ = false;
};

/// Handles a signal that ends the program: removes the temporary files of this process, says on standard error which
/// targets are not written, and ends by the signal's default action. Async-signal-safe.
void end_by_signal(int signal);

/// Writes a whole text file through an AtomicFile.
void write_file_atomically(const std::filesystem::path& target, std::string_view content);

}  // namespace exmat
