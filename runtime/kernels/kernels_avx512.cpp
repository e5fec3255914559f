#define EXMAT_SIMD_WIDTH 8
#define EXMAT_SIMD_NAME "avx512"
#define EXMAT_SIMD_KERNELS kAvx512Kernels
#include "runtime/kernels/kernels_isa.inl"
