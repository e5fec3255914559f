#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace exmat {

/// The files of one command. While an object lives, no file is both read and written, and no two outputs are one file;
/// links, hard links and relative spellings count as the file that they lead to. Programs keep one around a command.
/// Without one, as in a host program, both functions look at the file alone.
class CommandFiles {
 public:
  CommandFiles();
  ~CommandFiles();
  CommandFiles(const CommandFiles&) = delete;
  CommandFiles& operator=(const CommandFiles&) = delete;
};

/// Announces that the command writes `file`; `role` names it in messages, as "-o". Throws InputError where the command
/// has read the file, or claims it for another output, where it is a folder, a pipe or a device, and where its folder
/// is neither there nor claimed. Call it before any work.
void claim_output(const std::filesystem::path& file, const std::string& role);

/// The same of a file that is about to be written, now and perhaps again: it is not claimed.
void check_output(const std::filesystem::path& file, const std::string& role);

/// Throws InputError where `file` is there, is not empty, and begins otherwise than what the command would write over
/// it: nothing but an earlier output of its kind is replaced. `kind` names that in messages, as "a trajectory". Call it
/// once the inputs are known, whose own message says more, and before any work.
void require_kind(const std::filesystem::path& file, const std::string& role, const std::string& kind,
                  std::string_view beginning);

/// The message of require_kind() about a file that is of the kind `found`.
[[noreturn]] void refuse_to_replace(const std::filesystem::path& file, const std::string& role, const std::string& kind,
                                    const std::string& found);

/// Announces a folder that the command fills, as claim_output() does, before the files in it. Throws InputError also
/// where it is a file, or is not there and cannot be made.
void claim_folder(const std::filesystem::path& folder, const std::string& role);

/// Announces that `file` is about to be read; `expected` is for messages ("a JSON file"). Throws InputError where there
/// is no such file, where it is a folder, a pipe or a device, and where the command claims it as an output.
void check_input(const std::filesystem::path& file, const std::string& expected);

/// Lets the command read its own output while an object lives, as to see whether it is up to date.
class OwnOutputRead {
 public:
  OwnOutputRead();
  ~OwnOutputRead();
  OwnOutputRead(const OwnOutputRead&) = delete;
  OwnOutputRead& operator=(const OwnOutputRead&) = delete;
};

/// The file that a write to `target` changes: symbolic links are followed, also to a file that does not exist. Throws
/// InputError where they lead to each other.
std::filesystem::path link_target(std::filesystem::path target);

/// The folder that a name is in, "." for one without.
std::filesystem::path parent_folder(const std::filesystem::path& file);

/// The current folder. Throws InputError where it was removed.
std::filesystem::path current_folder();

}  // namespace exmat
