#include "precompute/cache/stage_cache.h"

#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <system_error>

#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "common/core/version.h"
#include "precompute/cache/sha256.h"
#include "precompute/solvers/semidefinite_solver.h"
#include "runtime/kernels/kernels.h"

namespace exmat::precompute {
namespace {

constexpr std::string_view kMagic = "exmat-stage 1\n";
constexpr std::size_t kDigestLength = 64;

std::string digest_of(std::string_view bytes) {
  Sha256 hash;
  hash.add(bytes);
  return hash.digest();
}

// Another build may compute otherwise, whatever its version says, and so may another instruction set.
std::string this_program() {
  const std::filesystem::path file = "/proc/self/exe";
  std::error_code ignored;
  const std::string build = std::filesystem::exists(file, ignored) ? sha256_of_file(file) : "";
  return fmt::format("{}\n{}\n{}\n{}\n", version(), build, solver_versions(), runtime::kernels().name);
}

}  // namespace

StageCache::StageCache(std::filesystem::path folder) : folder_(std::move(folder)), program_(this_program()) {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) throw WorkError(fmt::format("{}: cannot make the folder: {}", folder_.string(), error.message()));
}

std::filesystem::path StageCache::file_of(const std::string& stage, std::string_view inputs) const {
  Sha256 hash;
  hash.add(kMagic);
  hash.add(program_);
  hash.add(stage + "\n");
  hash.add(inputs);
  return folder_ / (hash.digest() + ".stage");
}

std::optional<std::string> StageCache::read(const std::string& stage, const std::filesystem::path& file) {
  uses_.push_back({stage});
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return std::nullopt;
  std::ifstream stream(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  const std::size_t start = kMagic.size() + kDigestLength;
  const std::string_view whole = bytes;
  if (whole.size() < start || !whole.starts_with(kMagic) ||
      whole.substr(kMagic.size(), kDigestLength) != digest_of(whole.substr(start))) {
    refuse(stage, file, "it is damaged");
    return std::nullopt;
  }
  bytes.erase(0, start);
  return bytes;
}

void StageCache::save(const std::string& stage, const std::filesystem::path& file, std::string_view bytes) {
  try {
    write_file_atomically(file, fmt::format("{}{}{}", kMagic, digest_of(bytes), bytes));
  } catch (const WorkError& error) {
    log::warning(fmt::format("the cache keeps no {}: {}", stage, error.what()));
  }
}

void StageCache::found(const std::string& stage) {
  uses_.back().found = true;
  log::info(stage + ": from the cache");
}

void StageCache::refuse(const std::string& stage, const std::filesystem::path& file, std::string_view why) {
  log::warning(fmt::format("{}: {}; computing this again: {}", file.string(), why, stage));
}

}  // namespace exmat::precompute
