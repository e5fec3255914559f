#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/cache/value_bytes.h"

namespace exmat::precompute {

/// A result that was asked of the cache of stages.
struct CacheUse {
  std::string stage;
  bool found = false;
};

/// Results of stages, kept in a folder from run to run: each in a file named by the SHA-256 of the stage, the program
/// and all the values that it depends on. Files may be removed at any time, and runs may share the folder. What is
/// damaged is warned of and computed again; what cannot be written is warned of.
class StageCache {
 public:
  /// Keeps nothing.
  StageCache() = default;
  /// Makes the folder where it is missing; WorkError where it cannot.
  explicit StageCache(std::filesystem::path folder);

  /// The result of `compute`, from the folder where it was computed of the same inputs. What it logs and warns of is
  /// then not said again.
  template <typename Compute, typename... Inputs>
  auto get(const std::string& stage, Compute compute, const Inputs&... inputs) {
    using Result = decltype(compute());
    if (folder_.empty()) return compute();
    ByteWriter key;
    (write_bytes(key, inputs), ...);
    const std::filesystem::path file = file_of(stage, key.bytes);
    if (std::optional<Result> kept = load<Result>(stage, file)) return std::move(*kept);
    Result result = compute();
    ByteWriter value;
    write_bytes(value, result);
    save(stage, file, value.bytes);
    return result;
  }

  /// All results that were asked for so far.
  const std::vector<CacheUse>& uses() const { return uses_; }

 private:
  template <typename Result>
  std::optional<Result> load(const std::string& stage, const std::filesystem::path& file) {
    const std::optional<std::string> bytes = read(stage, file);
    if (!bytes) return std::nullopt;
    try {
      Result result;
      ByteReader reader(*bytes);
      pass(reader, result);
      if (reader.left() > 0) throw DamagedBytes();
      found(stage);
      return result;
    } catch (const DamagedBytes& fault) {
      refuse(stage, file, fault.what());
      return std::nullopt;
    }
  }

  std::filesystem::path file_of(const std::string& stage, std::string_view inputs) const;
  /// The value's bytes; nothing where there are none, or where they are not those that were written.
  std::optional<std::string> read(const std::string& stage, const std::filesystem::path& file);
  void save(const std::string& stage, const std::filesystem::path& file, std::string_view bytes);
  void found(const std::string& stage);
  static void refuse(const std::string& stage, const std::filesystem::path& file, std::string_view why);

  std::filesystem::path folder_;
  std::string program_;  // what the results depend on beside their inputs
  std::vector<CacheUse> uses_;
};

}  // namespace exmat::precompute
