#include "runtime/kernels/kernels.h"

#include <cstdlib>
#include <cstring>

namespace exmat::runtime {

extern const Kernels kPortableKernels;
#ifdef EXMAT_X86_KERNELS
extern const Kernels kAvx2Kernels;
extern const Kernels kAvx512Kernels;
#endif

namespace {

const Kernels& choose() noexcept {
  constexpr InstructionSet kFastestFirst[] = {InstructionSet::kAvx512, InstructionSet::kAvx2,
                                              InstructionSet::kPortable};
  const char* const wanted = std::getenv("EXMAT_SIMD");
  for (const InstructionSet set : kFastestFirst) {
    const Kernels* found = kernels_for(set);
    if (found != nullptr && (wanted == nullptr || std::strcmp(wanted, found->name) == 0)) return *found;
  }
  return kPortableKernels;
}

}  // namespace

const Kernels* kernels_for(InstructionSet set) noexcept {
#ifdef EXMAT_X86_KERNELS
  // The compiler's test includes that of the operating system's support for the wide registers.
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (set == InstructionSet::kAvx2) return avx2 ? &kAvx2Kernels : nullptr;
  if (set == InstructionSet::kAvx512)
    return avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                   __builtin_cpu_supports("avx512vl")
               ? &kAvx512Kernels
               : nullptr;
#endif
  return set == InstructionSet::kPortable ? &kPortableKernels : nullptr;
}

const Kernels& kernels() noexcept {
  static const Kernels& chosen = choose();
  return chosen;
}

}  // namespace exmat::runtime
