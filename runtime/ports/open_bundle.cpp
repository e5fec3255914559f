#include "common/bundle/bundle_store.h"
#include "common/bundle/pack_store.h"
#include "common/config/scene_needs.h"
#include "common/core/error.h"

#ifndef __wasi__
#include <fstream>
#include <iterator>
#endif

namespace exmat {
namespace {

constexpr const char* kWithoutHdf5 = "this build reads no HDF5; exmat-runtime pack makes a pack of a bundle";

#ifdef __wasi__

std::string read(const std::filesystem::path& file) {
  throw InputError({file.string(), "", "a pack in memory", "a file", "this build has no files"});
}

#else

std::string read(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw InputError({file.string(), "", "a pack of a bundle", "no file that can be read", ""});
  return {std::istreambuf_iterator<char>(stream), {}};
}

#endif

}  // namespace

// open_bundle() says as much of a pack that is not there.
void require_files(const SceneConfig&) {}

std::unique_ptr<BundleStore> open_bundle(const BundleInput& input) {
  auto pack = input.pack() ? input.pack() : std::make_shared<const std::string>(read(input.file()));
  if (pack->starts_with("\x89HDF"))
    throw InputError({input.file().string(), "", "a pack of a bundle", "an HDF5 file", kWithoutHdf5});
  return std::make_unique<PackStore>(input.file().string(), std::move(pack));
}

}  // namespace exmat
