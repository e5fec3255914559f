#pragma once

#include <vector>

#include "runtime/kernels/kernels.h"

namespace exmat::runtime {

/// The kernels of every instruction set that this machine has.
inline std::vector<const Kernels*> available() {
  std::vector<const Kernels*> found;
  for (const InstructionSet set : {InstructionSet::kPortable, InstructionSet::kAvx2, InstructionSet::kAvx512})
    if (const Kernels* kernels = kernels_for(set)) found.push_back(kernels);
  return found;
}

}  // namespace exmat::runtime
