// Any bytes in a file of the extension EXMAT_FUZZ_EXTENSION are a mesh or refused. A TetGen pair is one input, split by
// the first zero byte, and so are a .veg file and input.inc, which it may include.
#include "common/core/error.h"
#include "common/core/log.h"
#include "precompute/mesh_io/mesh_file.h"
#include "precompute/mesh_io/surface_file.h"
#include "tests/fuzz/fuzz_target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace exmat;
  const std::string_view extension = EXMAT_FUZZ_EXTENSION;
  std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (extension == ".node" || extension == ".veg")
    bytes = fuzz::split_off(bytes, extension == ".node" ? ".ele" : ".inc");
  const auto file = fuzz::input_file(EXMAT_FUZZ_EXTENSION, bytes);
  try {
    if (extension == ".obj" || extension == ".ply")
      precompute::read_surface(file);
    else
      precompute::read_mesh(file);
  } catch (const InputError&) {
  }
  return 0;
}
