#pragma once

#include <string>

#include "precompute/meshing/mesher_interface.h"

namespace exmat::precompute {

/// The module with the mesher (exmat-mesher.so), loaded when it is first asked for: beside the program, in ../lib/exmat
/// or in the folder that EXMAT_MESHER_FOLDER names.
struct MesherModule {
  MesherFunction make_tets = nullptr;  ///< none where the module is not there
  std::string version = "none";
  std::string searched;  ///< "/usr/bin, /usr/lib/exmat", for messages
};
const MesherModule& mesher_module();

}  // namespace exmat::precompute
