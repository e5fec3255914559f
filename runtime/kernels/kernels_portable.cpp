#define EXMAT_SIMD_WIDTH 2
#define EXMAT_SIMD_NAME "portable"
#define EXMAT_SIMD_KERNELS kPortableKernels
#include "runtime/kernels/kernels_isa.inl"
