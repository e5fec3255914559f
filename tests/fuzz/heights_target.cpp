// Any bytes in a file of heights are a grid of finite numbers or refused.
#include "common/core/error.h"
#include "common/surface_io/height_reader.h"
#include "tests/fuzz/fuzz_target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat;
  const auto file = fuzz::input_file(".csv", {reinterpret_cast<const char*>(data), size});
  try {
    const RowMatrix heights = read_heights(file);
    if (heights.rows() < 2 || heights.cols() < 2 || !heights.allFinite()) __builtin_trap();
  } catch (const InputError&) {
  }
  return 0;
}
