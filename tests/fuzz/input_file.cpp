#include <algorithm>
#include <fstream>
#include <unistd.h>

#include "tests/fuzz/fuzz_target.h"

namespace exmat::fuzz {

std::filesystem::path input_file(const char* extension, std::string_view bytes) {
  static const std::filesystem::path folder = [] {
    const bool memory = std::filesystem::is_directory("/dev/shm");
    const std::filesystem::path base = memory ? "/dev/shm" : std::filesystem::temp_directory_path();
    const std::filesystem::path own = base / ("exmat_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directory(own);
    return own;
  }();
  [[maybe_unused]] static const bool cleaned = std::atexit([] {
                                                 std::error_code ignored;
                                                 std::filesystem::remove_all(folder, ignored);
                                               }) == 0;
  const std::filesystem::path file = folder / (std::string("input") + extension);
  std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return file;
}

std::string_view split_off(std::string_view bytes, const char* extension) {
  const std::size_t zero = std::min(bytes.find('\0'), bytes.size());
  input_file(extension, bytes.substr(std::min(zero + 1, bytes.size())));
  return bytes.substr(0, zero);
}

}  // namespace exmat::fuzz
