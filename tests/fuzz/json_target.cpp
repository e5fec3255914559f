// Any text is an asset, a scene or refused. After the first zero byte stand the ids of input.txt, which it may name.
#include "common/config/config.h"
#include "common/core/error.h"
#include "tests/fuzz/fuzz_target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat;
  const auto text = fuzz::split_off({reinterpret_cast<const char*>(data), size}, ".txt");
  const auto file = fuzz::input_file(".json", text);
  try {
    load_asset(file);
  } catch (const InputError&) {
  }
  try {
    for (const BodiesConfig& bodies : load_world(file).bodies) needs_of(bodies.scene);
  } catch (const InputError&) {
  }
  return 0;
}
