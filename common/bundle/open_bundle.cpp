#include <fstream>

#include "common/bundle/bundle_store.h"
#include "common/bundle/hdf5_store.h"
#include "common/bundle/pack_store.h"
#include "common/core/input_file.h"

namespace exmat {
namespace {

bool is_pack(const std::filesystem::path& file) {
  std::string beginning(kPackMagic.size(), '\0');
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return false;
  std::ifstream stream(file, std::ios::binary);
  stream.read(beginning.data(), static_cast<std::streamsize>(beginning.size()));
  return stream && beginning == kPackMagic;
}

}  // namespace

std::unique_ptr<BundleStore> open_bundle(const BundleInput& input) {
  if (input.pack()) return std::make_unique<PackStore>(input.file().string(), input.pack());
  if (!is_pack(input.file())) return std::make_unique<Hdf5Store>(input.file());
  return std::make_unique<PackStore>(input.file().string(), std::make_shared<const std::string>(read_whole_file(
                                                                input.file(), "a bundle or a pack of one")));
}

}  // namespace exmat
