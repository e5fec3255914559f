// The kernels for one instruction set. The including file defines EXMAT_SIMD_WIDTH, doubles in a register (2, 4 or 8),
// EXMAT_SIMD_NAME and EXMAT_SIMD_KERNELS, the name of the table to define.

#if EXMAT_SIMD_WIDTH > 2
#include <immintrin.h>
#endif

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "runtime/kernels/kernels.h"

namespace exmat::runtime {
namespace {

using Index = std::ptrdiff_t;
constexpr Index kWidth = EXMAT_SIMD_WIDTH;
constexpr Index kParts = kLanes / kWidth;              // registers per panel
constexpr Index kTileRows = kWidth == 2 ? 4 : kWidth;  // of the register tile of a product
constexpr Index kTileVectors = kWidth == 2 ? 2 : 3;
using Vec = double __attribute__((vector_size(kWidth * sizeof(double))));
using FloatVec = float __attribute__((vector_size(kWidth * sizeof(double))));
using StoredVec = Vec __attribute__((may_alias, aligned(alignof(double))));
using StoredFloatVec = FloatVec __attribute__((may_alias, aligned(alignof(float))));

inline Vec load(const double* p) { return *reinterpret_cast<const StoredVec*>(p); }
inline void store(double* p, Vec v) { *reinterpret_cast<StoredVec*>(p) = v; }
inline FloatVec load(const float* p) { return *reinterpret_cast<const StoredFloatVec*>(p); }
inline void store(float* p, FloatVec v) { *reinterpret_cast<StoredFloatVec*>(p) = v; }
inline Vec zero() { return Vec{}; }

inline double sum(Vec v) {
  double total = 0;
  for (Index i = 0; i < kWidth; ++i) total += v[i];
  return total;
}

// --- one panel of elements -------------------------------------------------------------------------------------------

/// H = B q of one register's elements.
inline void gradient(const double* by_mode, Index modes, const double* q, Vec* H) {
  for (Index i = 0; i < 9; ++i) H[i] = zero();
  for (Index c = 0; c < modes; ++c, by_mode += 9 * kLanes)
    for (Index i = 0; i < 9; ++i) H[i] += load(by_mode + i * kLanes) * q[c];
}

/// force[c] += sum_i B_ic P_i, lanes kept apart.
inline void add_force(const double* by_mode, Index modes, const Vec* P, double* force) {
  for (Index c = 0; c < modes; ++c, by_mode += 9 * kLanes, force += kLanes) {
    Vec even = load(force), odd = zero();
    for (Index i = 0; i < 8; i += 2) {
      even += load(by_mode + i * kLanes) * P[i];
      odd += load(by_mode + (i + 1) * kLanes) * P[i + 1];
    }
    store(force, even + odd + load(by_mode + 8 * kLanes) * P[8]);
  }
}

#include "runtime/kernels/laws_isa.inl"

// --- stiffness -------------------------------------------------------------------------------------------------------

#include "runtime/kernels/stiffness_isa.inl"

// --- products --------------------------------------------------------------------------------------------------------

/// C [rows x vectors] += A^T B over `depth` rows of A (a_stride apart) and of B (b_stride apart).
template <Index rows, Index vectors>
inline void tile(const double* A, Index a_stride, const double* B, Index b_stride, Index depth, double* C,
                 Index c_stride) {
  Vec sums[rows][vectors];
#pragma GCC unroll 8
  for (Index m = 0; m < rows; ++m)
#pragma GCC unroll 3
    for (Index n = 0; n < vectors; ++n) sums[m][n] = load(C + m * c_stride + n * kWidth);
  for (Index k = 0; k < depth; ++k, A += a_stride, B += b_stride) {
    Vec b[vectors];
#pragma GCC unroll 3
    for (Index n = 0; n < vectors; ++n) b[n] = load(B + n * kWidth);
#pragma GCC unroll 8
    for (Index m = 0; m < rows; ++m) {
      const double a = A[m];
#pragma GCC unroll 3
      for (Index n = 0; n < vectors; ++n) sums[m][n] += b[n] * a;
    }
  }
#pragma GCC unroll 8
  for (Index m = 0; m < rows; ++m)
#pragma GCC unroll 3
    for (Index n = 0; n < vectors; ++n) store(C + m * c_stride + n * kWidth, sums[m][n]);
}

template <Index rows>
inline void tile_row(const double* A, const double* B, Index stride, Index depth, Index first, double* C) {
  Index v = first;
  for (; v + kTileVectors * kWidth <= stride; v += kTileVectors * kWidth)
    tile<rows, kTileVectors>(A, stride, B + v, stride, depth, C + v, stride);
  const Index left = (stride - v) / kWidth;
  if (left == 1) tile<rows, 1>(A, stride, B + v, stride, depth, C + v, stride);
  if constexpr (kTileVectors > 2)
    if (left == 2) tile<rows, 2>(A, stride, B + v, stride, depth, C + v, stride);
}

/// Upper triangle of C [modes x stride] += A^T B over `depth` rows of A and B, both stride wide.
inline void half_product(const double* A, const double* B, Index stride, Index modes, Index depth, double* C) {
  Index i = 0;
  for (; i < modes; i += kTileRows) {
    const Index first = i / kWidth * kWidth;
    if (kTileRows == 8 && modes - i <= 4)
      tile_row<4>(A + i, B, stride, depth, first, C + i * stride);
    else
      tile_row<kTileRows>(A + i, B, stride, depth, first, C + i * stride);
  }
}

inline void clear(double* values, Index count) {
  for (Index i = 0; i < count; i += kWidth) store(values + i, zero());
}

// --- vertices -------------------------------------------------------------------------------------------------------

#include "runtime/kernels/vertices_isa.inl"

// --- the table -------------------------------------------------------------------------------------------------------

template <class Law>
inline double energy_of_elements(const ElementArrays& elements, const ElementLaw& law, const double* q) {
  Vec total = zero();
  for (Index panel = 0; panel < elements.panels; ++panel)
    for (Index part = 0; part < kParts; ++part) {
      Vec H[9], P[9];
      gradient(elements.by_mode + panel * elements.modes * 9 * kLanes + part * kWidth, elements.modes, q, H);
      total += evaluate_law<Want::kEnergy, Law>(law, panel * kLanes + part * kWidth, H, P, nullptr);
    }
  return sum(total);
}

double energy(const ElementArrays& elements, const ElementLaw& law, const double* q) {
  return with_law(law, [&]<class Law>() { return energy_of_elements<Law>(elements, law, q); });
}

/// sums [count]: of kWidth numbers each, kLanes apart; there are padded(count) of them.
inline void sum_lanes(const double* numbers, Index count, double* sums) {
  for (Index first = 0; first < count; first += kWidth, numbers += kWidth * kLanes) {
    Vec registers[kWidth];
#pragma GCC unroll 8
    for (Index i = 0; i < kWidth; ++i) registers[i] = load(numbers + i * kLanes);
    const Vec found = sums_of_lanes(registers);
    if (first + kWidth <= count)
      store(sums + first, found);
    else
      for (Index i = 0; first + i < count; ++i) sums[first + i] = found[i];
  }
}

template <Want want, class Law>
inline double evaluate_elements(const ElementArrays& elements, const ElementLaw& law, const double* q,
                                const ElementScratch& scratch, double* force) {
  alignas(kAlignment) double tangents[kTangentNumbers * kLanes];
  Vec total = zero();
  clear(scratch.force, elements.stride * kLanes);
  for (Index panel = 0; panel < elements.panels; ++panel) {
    const double* by_mode = elements.by_mode + panel * elements.modes * 9 * kLanes;
    for (Index part = 0; part < kParts; ++part) {
      Vec H[9], P[9];
      gradient(by_mode + part * kWidth, elements.modes, q, H);
      total += evaluate_law<want, Law>(law, panel * kLanes + part * kWidth, H, P, tangents + part * kWidth);
      add_force(by_mode + part * kWidth, elements.modes, P, scratch.force);
    }
    if constexpr (want == Want::kStiffness) add_panel_stiffness(elements, panel, tangents, scratch.stiffness);
  }
  sum_lanes(scratch.force, elements.modes, force);
  return sum(total);
}

double force(const ElementArrays& elements, const ElementLaw& law, const double* q, const ElementScratch& scratch,
             double* force) {
  return with_law(law,
                  [&]<class Law>() { return evaluate_elements<Want::kForce, Law>(elements, law, q, scratch, force); });
}

double force_and_stiffness(const ElementArrays& elements, const ElementLaw& law, const double* q,
                           const ElementScratch& scratch, double* force, double* stiffness, Index outer) {
  clear(scratch.stiffness, lane_triangle(elements.modes) / kLanes);
  const double energy = with_law(
      law, [&]<class Law>() { return evaluate_elements<Want::kStiffness, Law>(elements, law, q, scratch, force); });
  copy_blocks(scratch.stiffness, elements.modes, stiffness, outer);
  return energy;
}

void stiffness_of_tangents(const ElementArrays& elements, const double* tangents, const ElementScratch& scratch,
                           double* stiffness, Index outer) {
  clear(scratch.stiffness, lane_triangle(elements.modes) / kLanes);
  for (Index panel = 0; panel < elements.panels; ++panel)
    add_panel_stiffness(elements, panel, tangents + panel * kTangentNumbers * kLanes, scratch.stiffness);
  copy_blocks(scratch.stiffness, elements.modes, stiffness, outer);
}

template <class Law>
inline void tangents_of_elements(const ElementArrays& elements, const ElementLaw& law, const double* q,
                                 double* tangents) {
  for (Index panel = 0; panel < elements.panels; ++panel)
    for (Index part = 0; part < kParts; ++part) {
      Vec H[9], P[9];
      gradient(elements.by_mode + panel * elements.modes * 9 * kLanes + part * kWidth, elements.modes, q, H);
      evaluate_law<Want::kStiffness, Law>(law, panel * kLanes + part * kWidth, H, P,
                                          tangents + panel * kTangentNumbers * kLanes + part * kWidth);
    }
}

void tangents(const ElementArrays& elements, const ElementLaw& law, const double* q, double* tangents) {
  with_law(law, [&]<class Law>() { tangents_of_elements<Law>(elements, law, q, tangents); });
}

/// Off the diagonal each block serves its rows and, transposed, its columns, whose sums stay in registers.
void symmetric_product(const double* D, Index blocks, const double* y, double* product) {
  clear(product, blocks * kLanes);
  for (Index column = 0; column < blocks; ++column) {
    Vec transposed[kLanes] = {};
    const double* y_column = y + column * kLanes;
    Vec diagonal[kParts] = {};
    for (Index j = 0; j < kLanes; ++j)
      for (Index p = 0; p < kParts; ++p) diagonal[p] += load(D + j * kLanes + p * kWidth) * y_column[j];
    for (Index p = 0; p < kParts; ++p) {
      double* rows = product + column * kLanes + p * kWidth;
      store(rows, load(rows) + diagonal[p]);
    }
    D += kLanes * kLanes;
    for (Index row = column + 1; row < blocks; ++row, D += kLanes * kLanes)
      for (Index p = 0; p < kParts; ++p) {
        double* rows = product + row * kLanes + p * kWidth;
        const Vec y_row = load(y + row * kLanes + p * kWidth);
        Vec even = load(rows), odd = zero();
#pragma GCC unroll 8
        for (Index j = 0; j < kLanes; ++j) {
          const Vec d = load(D + j * kLanes + p * kWidth);
          (j % 2 == 0 ? even : odd) += d * y_column[j];
          transposed[j] += d * y_row;
        }
        store(rows, even + odd);
      }
    for (Index j = 0; j < kLanes; ++j) product[column * kLanes + j] += sum(transposed[j]);
  }
}

/// y [vectors registers] = A x.
template <Index vectors>
inline void strip_vector(const double* A, Index columns, Index outer, const double* x, double* y) {
  Vec even[vectors] = {}, odd[vectors] = {};
  Index c = 0;
  for (; c + 1 < columns; c += 2)
#pragma GCC unroll 4
    for (Index v = 0; v < vectors; ++v) {
      even[v] += load(A + c * outer + v * kWidth) * x[c];
      odd[v] += load(A + (c + 1) * outer + v * kWidth) * x[c + 1];
    }
  for (Index v = 0; v < vectors; ++v) {
    if (c < columns) even[v] += load(A + c * outer + v * kWidth) * x[c];
    store(y + v * kWidth, even[v] + odd[v]);
  }
}

void matrix_vector(const double* A, Index rows, Index columns, Index outer, const double* x, double* y) {
  Index i = 0;
  for (; i + 4 * kWidth <= rows; i += 4 * kWidth) strip_vector<4>(A + i, columns, outer, x, y + i);
  for (; i + 2 * kWidth <= rows; i += 2 * kWidth) strip_vector<2>(A + i, columns, outer, x, y + i);
  if (i < rows) strip_vector<1>(A + i, columns, outer, x, y + i);
}

inline IntVec lane_numbers() {
  IntVec lanes;
#pragma GCC unroll 8
  for (Index i = 0; i < kWidth; ++i) lanes[i] = i;
  return lanes;
}

/// Factor of the diagonal block in kWidth columns, the diagonal its inverse. Above it the rows of the block's inverse,
/// each in the column of its number: a solution then is a product with it, whose terms do not wait for each other.
inline bool factor_block(Vec* columns, Index count) {
#pragma GCC unroll 8
  for (Index c = 0; c < kWidth; ++c) {
    if (c >= count) break;
    const double pivot = columns[c][c];
    if (!(pivot > 0) || !(pivot < __builtin_inf())) return false;
    // The next pivot waits for a division alone, not for the root.
    const double inverse = 1 / pivot, root = 1 / __builtin_sqrt(pivot);
#pragma GCC unroll 8
    for (Index d = c + 1; d < kWidth; ++d) columns[d] -= columns[c] * columns[c][d] * inverse;
    columns[c] *= root;
    columns[c][c] = root;
  }
  const IntVec lanes = lane_numbers();
  Vec rows[kWidth];
#pragma GCC unroll 8
  for (Index i = 0; i < kWidth; ++i) {
    if (i >= count) break;
    Vec row = select(lanes == i, zero() + 1.0, zero());
#pragma GCC unroll 8
    for (Index k = 0; k < i; ++k) row -= rows[k] * columns[k][i];
    rows[i] = row * columns[i][i];
    columns[i] = select(lanes < i, rows[i], columns[i]);
  }
  return true;
}

/// columns <- columns L^-T of the factored diagonal block at `block`.
inline void solve_block(const double* block, Index stride, Index count, Vec* columns) {
#pragma GCC unroll 8
  for (Index c = 0; c < kWidth; ++c) {
    if (c >= count) break;
    columns[c] *= block[c * stride + c];
#pragma GCC unroll 8
    for (Index d = c + 1; d < kWidth; ++d) columns[d] -= columns[c] * block[c * stride + d];
  }
}

/// kWidth columns at a time, left-looking.
bool cholesky(const double* A, Index n, Index outer, double* L) {
  const Index stride = padded(n);
  for (Index j = 0; j < n; ++j) {
    double* column = L + j * stride;
    for (Index i = j; i < n; ++i) column[i] = A[j * outer + i];
    for (Index i = 0; i < j; ++i) column[i] = 0;
    for (Index i = n; i < stride; ++i) column[i] = 0;
  }
  for (Index j = 0; j < n; j += kWidth) {
    const Index count = n - j < kWidth ? n - j : kWidth;
    for (Index i = j; i < stride; i += kWidth) {
      Vec columns[kWidth];
#pragma GCC unroll 8
      for (Index c = 0; c < kWidth; ++c) columns[c] = c < count ? load(L + (j + c) * stride + i) : zero();
      for (Index k = 0; k < j; ++k) {
        const Vec left = load(L + k * stride + i);
#pragma GCC unroll 8
        for (Index c = 0; c < kWidth; ++c) columns[c] -= left * L[k * stride + j + c];
      }
      if (i > j)
        solve_block(L + j * stride + j, stride, count, columns);
      else if (!factor_block(columns, count))
        return false;
#pragma GCC unroll 8
      for (Index c = 0; c < kWidth; ++c)
        if (c < count) store(L + (j + c) * stride + i, columns[c]);
    }
  }
  return true;
}

/// Row `i` of the inverse of a factored diagonal block.
inline Vec inverse_row(const double* block, Index stride, Index i) {
  return select(lane_numbers() <= i, load(block + i * stride), zero());
}

void cholesky_solve(const double* L, Index n, double* x) {
  const Index stride = padded(n);
  for (Index i = n; i < stride; ++i) x[i] = 0;
  for (Index j = 0; j < n; j += kWidth) {
    const Index count = n - j < kWidth ? n - j : kWidth;
    const double* block = L + j * stride;
    const Vec right = load(x + j);
    Vec products[kWidth];
#pragma GCC unroll 8
    for (Index i = 0; i < kWidth; ++i) products[i] = i < count ? inverse_row(block + j, stride, i) * right : zero();
    store(x + j, sums_of_lanes(products));
    for (Index i = j + kWidth; i < stride; i += kWidth) {
      Vec below = load(x + i), other = zero();
      for (Index c = 0; c + 1 < count; c += 2) {
        below -= load(block + c * stride + i) * x[j + c];
        other -= load(block + (c + 1) * stride + i) * x[j + c + 1];
      }
      if (count % 2 == 1) below -= load(block + (count - 1) * stride + i) * x[j + count - 1];
      store(x + i, below + other);
    }
  }
  for (Index j = (n - 1) / kWidth * kWidth; j >= 0; j -= kWidth) {
    const Index count = n - j < kWidth ? n - j : kWidth;
    const double* block = L + j * stride;
    Vec dots[kWidth] = {};
    for (Index i = j + kWidth; i < stride; i += kWidth) {
      const Vec below = load(x + i);
#pragma GCC unroll 8
      for (Index c = 0; c < kWidth; ++c)
        if (c < count) dots[c] += load(block + c * stride + i) * below;
    }
    const Vec right = load(x + j) - sums_of_lanes(dots);
    Vec even = zero(), odd = zero();
#pragma GCC unroll 8
    for (Index i = 0; i < kWidth; i += 2) {
      if (i < count) even += inverse_row(block + j, stride, i) * right[i];
      if (i + 1 < count) odd += inverse_row(block + j, stride, i + 1) * right[i + 1];
    }
    store(x + j, even + odd);
  }
}

void gemm(Index n, const double* A, const double* B, double* C) {
  constexpr Index kPanel = 8;
  for (Index j = 0; j < n; j += kGemmMultiple)
    for (Index i = 0; i < n; i += kPanel)
      for (Index row = 0; row < kPanel; row += kTileRows)
        for (Index v = 0; v < kGemmMultiple; v += kTileVectors * kWidth)
          tile<kTileRows, kTileVectors>(A + i * n + row, kPanel, B + j * n + v, kGemmMultiple, n,
                                        C + (i + row) * n + j + v, n);
}

void positions(const float* rest, const float* basis, Index blocks, Index modes, const float* q, float* positions) {
  constexpr Index kFloats = 2 * kWidth;
  constexpr Index kVertices = 16;
  for (Index block = 0; block < blocks; ++block, rest += kVertices, positions += kVertices) {
    FloatVec sums[kVertices / kFloats];
    for (Index v = 0; v < kVertices / kFloats; ++v) sums[v] = load(rest + v * kFloats);
    for (Index c = 0; c < modes; ++c, basis += kVertices)
      for (Index v = 0; v < kVertices / kFloats; ++v) sums[v] += load(basis + v * kFloats) * q[c];
    for (Index v = 0; v < kVertices / kFloats; ++v) store(positions + v * kFloats, sums[v]);
  }
}

#include "runtime/kernels/lanes_examples_isa.inl"
#include "runtime/kernels/lanes_isa.inl"
#include "runtime/kernels/lanes_polynomial_isa.inl"
#include "runtime/kernels/lanes_rotation_isa.inl"
#include "runtime/kernels/lanes_vectors_isa.inl"
#include "runtime/kernels/mesh_isa.inl"
#include "runtime/kernels/planes_isa.inl"
#include "runtime/kernels/rotation_isa.inl"
#include "runtime/kernels/triangles_isa.inl"

}  // namespace

extern const Kernels EXMAT_SIMD_KERNELS;
const Kernels EXMAT_SIMD_KERNELS{EXMAT_SIMD_NAME,
                                 energy,
                                 force,
                                 force_and_stiffness,
                                 stiffness_of_tangents,
                                 tangents,
                                 symmetric_product,
                                 matrix_vector,
                                 panel_product,
                                 rotation_moments,
                                 rotation_dots,
                                 rotation_force,
                                 rotation_stiffness,
                                 rotation_product,
                                 cholesky,
                                 cholesky_solve,
                                 gemm,
                                 positions,
                                 vertex_products,
                                 add_vertex_loads,
                                 vertex_loads,
                                 add_squares,
                                 plane_contacts,
                                 plane_potential,
                                 plane_factors,
                                 triangle_distances,
                                 approached_triangles,
                                 approachable_triangles,
                                 gather_triangles,
                                 near_leaves,
                                 lanes_energy,
                                 lanes_force,
                                 lanes_force_and_stiffness,
                                 lanes_force_and_mixed_stiffness,
                                 lanes_polynomial_stiffness,
                                 lanes_mixed_polynomial_stiffness,
                                 lanes_cholesky,
                                 lanes_cholesky_solve,
                                 lanes_symmetric_product,
                                 lanes_matrix_product,
                                 lanes_dot,
                                 lanes_sum,
                                 lanes_add_constants,
                                 lanes_take,
                                 lanes_prepare,
                                 lanes_assemble,
                                 lanes_begin_rotation,
                                 lanes_rotate,
                                 lanes_rotation_stiffness,
                                 lanes_gyroscopic_product,
                                 lanes_weights,
                                 choose_weights,
                                 lanes_bernstein,
                                 mesh_inertia,
                                 mesh_force,
                                 mesh_force_and_tangents,
                                 mesh_product,
                                 mesh_solve_lower,
                                 mesh_solve_upper,
                                 mesh_coefficients,
                                 mesh_rounded_coefficients,
                                 mesh_add_functions,
                                 mesh_add_rounded_functions};

}  // namespace exmat::runtime
