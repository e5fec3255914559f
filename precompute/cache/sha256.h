#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace exmat::precompute {

/// SHA-256 of what is added, in order.
class Sha256 {
 public:
  Sha256();

  void add(std::span<const std::byte> bytes);
  void add(std::string_view text) { add(std::as_bytes(std::span(text.data(), text.size()))); }
  /// The contents of a file; returns their number of bytes. Throws InputError where it cannot be read.
  std::uint64_t add_file(const std::filesystem::path& file);

  /// 64 hexadecimal digits; nothing may be added after it.
  std::string digest();

 private:
  struct Closer {
    void operator()(void* context) const;
  };
  std::unique_ptr<void, Closer> context_;
};

/// Hash of the contents of one file, as sha256sum prints it.
std::string sha256_of_file(const std::filesystem::path& file);

}  // namespace exmat::precompute
