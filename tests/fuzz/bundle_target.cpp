// Any bytes are a bundle or refused.
#include "tests/fuzz/bundle_checks.h"
#include "tests/fuzz/fuzz_target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat;
  fuzz::check_bundle(fuzz::input_file(".h5", {reinterpret_cast<const char*>(data), size}));
  return 0;
}
