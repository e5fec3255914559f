#include "common/core/command_files.h"

#include <algorithm>
#include <fstream>
#include <mutex>
#include <optional>
#include <string>
#include <sys/stat.h>
#include <utility>
#include <vector>

#include "common/core/error.h"
#include "common/core/input_file.h"

namespace exmat {
namespace {

constexpr const char* kNoRegularFile = "a pipe or a device, no regular file";

/// One file, whatever it is called.
struct Identity {
  bool exists = false;
  dev_t device = 0;
  ino_t number = 0;
  std::filesystem::path path;  // of a file that does not exist

  bool operator==(const Identity&) const = default;
};

Identity identity_of(std::filesystem::path file) {
  if (!file.has_filename()) file = file.parent_path();  // a folder with a slash at its end
  struct stat status {};
  if (::stat(file.c_str(), &status) == 0) return {true, status.st_dev, status.st_ino, {}};
  std::error_code ignored;
  const auto target = link_target(file);
  const auto folder = std::filesystem::weakly_canonical(parent_folder(target), ignored);
  return {false, 0, 0, folder / target.filename()};
}

struct Known {
  Identity identity;
  std::filesystem::path file;
  std::string role;
};

struct Registry {
  std::mutex mutex;
  int commands = 0, own_reads = 0;
  std::vector<Known> outputs, inputs;
};

Registry& registry() {
  static Registry files;
  return files;
}

const Known* find(const std::vector<Known>& files, const Identity& identity) {
  const auto found = std::ranges::find(files, identity, &Known::identity);
  return found == files.end() ? nullptr : &*found;
}

[[noreturn]] void refuse_output(const std::filesystem::path& file, const std::string& role,
                                const std::filesystem::path& input) {
  throw InputError({file.string(), role, "a file that this command does not read",
                    input == file ? "one of its inputs" : "its input " + input.string(), "choose another name"});
}

}  // namespace

CommandFiles::CommandFiles() {
  const std::lock_guard lock(registry().mutex);
  ++registry().commands;
}

CommandFiles::~CommandFiles() {
  const std::lock_guard lock(registry().mutex);
  if (--registry().commands > 0) return;
  registry().outputs.clear();
  registry().inputs.clear();
}

OwnOutputRead::OwnOutputRead() {
  const std::lock_guard lock(registry().mutex);
  ++registry().own_reads;
}

OwnOutputRead::~OwnOutputRead() {
  const std::lock_guard lock(registry().mutex);
  --registry().own_reads;
}

namespace {

/// Nothing where there is no command.
std::optional<Known> allowed_output(const std::filesystem::path& file, const std::string& role) {
  if (registry().commands == 0) return std::nullopt;
  const Identity identity = identity_of(file);
  if (const Known* input = find(registry().inputs, identity)) refuse_output(file, role, input->file);
  if (const Known* output = find(registry().outputs, identity))
    throw InputError({file.string(), role, "a file of its own",
                      "that of " + output->role + (output->file == file ? "" : ", " + output->file.string()),
                      "choose another name"});
  return Known{identity, file, role};
}

void claim(const std::filesystem::path& file, const std::string& role) {
  const std::lock_guard lock(registry().mutex);
  if (const auto known = allowed_output(file, role)) registry().outputs.push_back(*known);
}

/// Throws InputError unless the folder of the file is there, or is one that the command fills.
void require_folder(const std::filesystem::path& file, const std::string& role) {
  if (registry().commands == 0) return;
  if (file.is_relative()) current_folder();
  std::error_code ignored;
  const auto folder = parent_folder(link_target(file));
  const std::lock_guard lock(registry().mutex);
  if (std::filesystem::is_directory(folder, ignored) || find(registry().outputs, identity_of(folder)) != nullptr)
    return;
  throw InputError({file.string(), role, "a name in a folder that exists", "no folder " + folder.string(),
                    "make the folder, or choose another name"});
}

/// Throws InputError where the folder is none and cannot be made: the first that is missing is made and removed.
void require_making(std::filesystem::path folder, const std::string& role) {
  if (registry().commands == 0) return;
  if (folder.is_relative()) current_folder();
  const std::string name = folder.string();
  if (!folder.has_filename()) folder = folder.parent_path();
  std::error_code error;
  if (std::filesystem::exists(folder, error)) return;
  while (!std::filesystem::exists(parent_folder(folder), error)) folder = parent_folder(folder);
  if (std::filesystem::create_directory(folder, error)) std::filesystem::remove(folder, error);
  if (error)
    throw InputError({name, role, "a folder, or one that can be made", error.message(), "choose another name"});
}

void require_regular(const std::filesystem::path& file, const std::string& role) {
  std::error_code ignored;
  if (!file.has_filename())
    throw InputError(
        {file.string(), role, "a file, or the name of a new one", "the name of a folder", "choose another name"});
  const auto status = std::filesystem::status(file, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    throw InputError({file.string(), role, "a file, or the name of a new one",
                      std::filesystem::is_directory(status) ? "a folder" : kNoRegularFile, "choose another name"});
}

}  // namespace

void check_output(const std::filesystem::path& file, const std::string& role) {
  require_regular(file, role);
  const std::lock_guard lock(registry().mutex);
  allowed_output(file, role);
}

void claim_output(const std::filesystem::path& file, const std::string& role) {
  require_regular(file, role);
  require_folder(file, role);
  claim(file, role);
}

void refuse_to_replace(const std::filesystem::path& file, const std::string& role, const std::string& kind,
                       const std::string& found) {
  throw InputError({file.string(), role, kind + " to replace, or the name of a new file", found,
                    "choose another name, or remove it first"});
}

void require_kind(const std::filesystem::path& file, const std::string& role, const std::string& kind,
                  std::string_view beginning) {
  std::string bytes(std::max<std::size_t>(beginning.size(), 32), '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  if (bytes.empty() || bytes.starts_with(beginning)) return;
  const std::string_view found = kind_of_file(file, bytes);
  refuse_to_replace(file, role, kind, found.empty() ? "another kind of file" : std::string(found));
}

void claim_folder(const std::filesystem::path& folder, const std::string& role) {
  std::error_code ignored;
  if (std::filesystem::exists(folder, ignored) && !std::filesystem::is_directory(folder, ignored))
    throw InputError({folder.string(), role, "a folder, or the name of a new one", "a file", "choose another name"});
  claim(folder, role);
  require_making(folder, role);
}

void check_input(const std::filesystem::path& file, const std::string& expected) {
  std::error_code ignored;
  const auto status = std::filesystem::status(file, ignored);
  if (!std::filesystem::exists(status)) throw InputError({file.string(), "", expected, "no such file", ""});
  if (std::filesystem::is_directory(status)) throw InputError({file.string(), "", expected, "a folder", ""});
  if (!std::filesystem::is_regular_file(status))
    throw InputError({file.string(), "", expected, kNoRegularFile, "write it to a file first"});
  const std::lock_guard lock(registry().mutex);
  if (registry().commands == 0 || registry().own_reads > 0) return;
  const Identity identity = identity_of(file);
  if (const Known* output = find(registry().outputs, identity)) refuse_output(output->file, output->role, file);
  if (find(registry().inputs, identity) == nullptr) registry().inputs.push_back({identity, file, ""});
}

std::filesystem::path link_target(std::filesystem::path target) {
  constexpr int kMostLinks = 40;  // as Linux follows
  const std::string name = target.string();
  std::error_code error;
  for (int links = 0; links <= kMostLinks; ++links) {
    const auto next = std::filesystem::read_symlink(target, error);
    if (error) return target;
    target = target.parent_path() / next;
  }
  throw InputError({name, "", "a name, or links that lead to one", "links that lead to each other",
                    "remove them, or choose another name"});
}

std::filesystem::path parent_folder(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
}

std::filesystem::path current_folder() {
  std::error_code error;
  std::filesystem::path folder = std::filesystem::current_path(error);
  if (error)
    throw InputError({"current folder", "", "a folder that exists", error.message(),
                      "it was removed or moved: change to another folder, and name files from there"});
  return folder;
}

}  // namespace exmat
