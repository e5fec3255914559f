#include "precompute/meshing/mesher_module.h"

#include <cstdlib>
#include <dlfcn.h>
#include <filesystem>
#include <vector>

namespace exmat::precompute {
namespace {

constexpr const char* kModule = "exmat-mesher.so";

std::vector<std::filesystem::path> folders() {
  std::vector<std::filesystem::path> result;
  if (const char* named = std::getenv("EXMAT_MESHER_FOLDER")) result.emplace_back(named);
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return result;
  result.push_back(program.parent_path().parent_path() / "lib" / "exmat");
  result.push_back(program.parent_path());
  return result;
}

MesherModule load() {
  MesherModule module;
  for (const auto& folder : folders()) {
    module.searched += (module.searched.empty() ? "" : ", ") + folder.string();
    // For the rest of the run: what a module has registered to be done at its end is done there.
    void* library = dlopen((folder / kModule).c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (library == nullptr) continue;
    const auto version = reinterpret_cast<MesherVersionFunction>(dlsym(library, kMesherVersionSymbol));
    module.make_tets = reinterpret_cast<MesherFunction>(dlsym(library, kMesherSymbol));
    if (version == nullptr || module.make_tets == nullptr) continue;
    module.version = version();
    return module;
  }
  module.make_tets = nullptr;
  return module;
}

}  // namespace

const MesherModule& mesher_module() {
  static const MesherModule module = load();
  return module;
}

}  // namespace exmat::precompute
