#define EXMAT_SIMD_WIDTH 4
#define EXMAT_SIMD_NAME "avx2"
#define EXMAT_SIMD_KERNELS kAvx2Kernels
#include "runtime/kernels/kernels_isa.inl"
