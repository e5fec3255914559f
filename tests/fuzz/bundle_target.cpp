// Any bytes are a bundle or refused, by the reader and by validate alike.
#include "common/bundle/bundle.h"
#include "common/core/error.h"
#include "tests/fuzz/fuzz_target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat;
  const auto file = fuzz::input_file(".h5", {reinterpret_cast<const char*>(data), size});
  bool refused = false;
  try {
    read_bundle(file);
  } catch (const InputError&) {
    refused = true;
  }
  try {
    if (validate_bundle(file).empty() && refused) __builtin_trap();
  } catch (const InputError&) {
  }
  return 0;
}
