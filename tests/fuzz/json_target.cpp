// Any text is an asset, a scene or refused.
#include "common/config/config.h"
#include "common/core/error.h"
#include "tests/fuzz/fuzz_target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat;
  const auto file = fuzz::input_file(".json", {reinterpret_cast<const char*>(data), size});
  try {
    load_asset(file);
  } catch (const InputError&) {
  }
  try {
    needs_of(load_scene(file));
  } catch (const InputError&) {
  }
  return 0;
}
