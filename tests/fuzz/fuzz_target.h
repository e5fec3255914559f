#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string_view>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace exmat::fuzz {

/// A file of this process alone, in memory where there is /dev/shm, that holds the bytes.
std::filesystem::path input_file(const char* extension, std::string_view bytes);

/// Makes the input file of that extension of what follows the first zero byte; returns what stands before it.
std::string_view split_off(std::string_view bytes, const char* extension);

}  // namespace exmat::fuzz
