// The kernels for one instruction set. The including file defines EXMAT_SIMD_WIDTH, doubles in a register (2, 4 or 8),
// EXMAT_SIMD_NAME and EXMAT_SIMD_KERNELS, the name of the table to define.

#include <type_traits>

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

/// E = (H + H^T + H^T H) / 2: xx, yy, zz, yz, xz, xy.
inline void green_strain(const Vec* H, Vec* E) {
  E[0] = H[0] + 0.5 * (H[0] * H[0] + H[3] * H[3] + H[6] * H[6]);
  E[1] = H[4] + 0.5 * (H[1] * H[1] + H[4] * H[4] + H[7] * H[7]);
  E[2] = H[8] + 0.5 * (H[2] * H[2] + H[5] * H[5] + H[8] * H[8]);
  E[3] = 0.5 * (H[5] + H[7] + H[1] * H[2] + H[4] * H[5] + H[7] * H[8]);
  E[4] = 0.5 * (H[2] + H[6] + H[0] * H[2] + H[3] * H[5] + H[6] * H[8]);
  E[5] = 0.5 * (H[1] + H[3] + H[0] * H[1] + H[3] * H[4] + H[6] * H[7]);
}

/// Place of (i, j) in the upper triangle by rows of a symmetric size x size.
template <Index size>
constexpr Index triangle_entry(Index i, Index j) {
  const Index row = i < j ? i : j, column = i < j ? j : i;
  return row * size - row * (row - 1) / 2 + column - row;
}

constexpr Index kVoigt[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};

/// P += (I + H) S.
inline void add_stress(const Vec* H, const Vec* S, Vec* P) {
  for (Index a = 0; a < 3; ++a)
    for (Index b = 0; b < 3; ++b)
      P[3 * a + b] += S[kVoigt[a][b]] + H[3 * a] * S[kVoigt[0][b]] + H[3 * a + 1] * S[kVoigt[1][b]] +
                      H[3 * a + 2] * S[kVoigt[2][b]];
}

enum class Want { kEnergy, kForce, kStiffness };

struct StVenantKirchhoff {
  Vec mu, lambda;

  /// Energy; adds the stress to P and the tangent to `tangent`, as wanted.
  template <Want want>
  Vec evaluate(const Vec* H, Vec* P, double* tangent) const {
    Vec E[6], S[6];
    green_strain(H, E);
    if constexpr (want != Want::kEnergy) {
      second_piola_kirchhoff(E, S);
      add_stress(H, S, P);
    }
    if constexpr (want == Want::kStiffness) add_tangent(H, S, tangent);
    return energy(E);
  }

 private:
  Vec energy(const Vec* E) const {
    const Vec trace = E[0] + E[1] + E[2];
    const Vec square = E[0] * E[0] + E[1] * E[1] + E[2] * E[2] + 2.0 * (E[3] * E[3] + E[4] * E[4] + E[5] * E[5]);
    return 0.5 * lambda * trace * trace + mu * square;
  }

  void second_piola_kirchhoff(const Vec* E, Vec* S) const {
    const Vec pressure = lambda * (E[0] + E[1] + E[2]);
    for (Index i = 0; i < 3; ++i) S[i] = pressure + 2.0 * mu * E[i];
    for (Index i = 3; i < 6; ++i) S[i] = 2.0 * mu * E[i];
  }

  /// tangent += delta_ac S_bd + lambda F_ab F_cd + mu F_ad F_cb + mu delta_bd (F F^T)_ac.
  void add_tangent(const Vec* H, const Vec* S, double* tangent) const {
    Vec F[9], left[6];
    for (Index i = 0; i < 9; ++i) F[i] = H[i] + (i % 4 == 0 ? 1.0 : 0.0);
    for (Index a = 0; a < 3; ++a)
      for (Index c = a; c < 3; ++c)
        left[kVoigt[a][c]] = mu * (F[3 * a] * F[3 * c] + F[3 * a + 1] * F[3 * c + 1] + F[3 * a + 2] * F[3 * c + 2]);
    Index entry = 0;
    for (Index i = 0; i < 9; ++i) {
      const Index a = i / 3, b = i % 3;
      const Vec lF = lambda * F[i];
      for (Index j = i; j < 9; ++j, ++entry) {
        const Index c = j / 3, d = j % 3;
        Vec value = lF * F[j] + mu * F[3 * a + d] * F[3 * c + b];
        if (a == c) value += S[kVoigt[b][d]];
        if (b == d) value += left[kVoigt[a][c]];
        store(tangent + entry * kLanes, load(tangent + entry * kLanes) + value);
      }
    }
  }
};

/// 1/2 E : C : E - S0 : E + constant, from its 28 numbers.
struct Quadratic {
  const double* numbers;

  template <Want want>
  Vec evaluate(const Vec* H, Vec* P, double* tangent) const {
    Vec E[6], S[6];
    green_strain(H, E);
    if constexpr (want != Want::kEnergy) {
      second_piola_kirchhoff(E, S);
      add_stress(H, S, P);
    }
    if constexpr (want == Want::kStiffness) set_tangent(H, S, tangent);
    return energy(E);
  }

 private:
  Vec number(Index i) const { return load(numbers + i * kLanes); }

  void linear_stress(const Vec* E, Vec* S) const {
    for (Index i = 0; i < 6; ++i) {
      S[i] = zero();
      for (Index j = 0; j < 6; ++j) S[i] += number(triangle_entry<6>(i, j)) * (j < 3 ? E[j] : 2.0 * E[j]);
    }
  }

  static Vec contract(const Vec* S, const Vec* E) {
    return S[0] * E[0] + S[1] * E[1] + S[2] * E[2] + 2.0 * (S[3] * E[3] + S[4] * E[4] + S[5] * E[5]);
  }

  Vec energy(const Vec* E) const {
    Vec S[6], S0[6];
    linear_stress(E, S);
    for (Index i = 0; i < 6; ++i) S0[i] = number(21 + i);
    return 0.5 * contract(S, E) - contract(S0, E) + number(27);
  }

  void second_piola_kirchhoff(const Vec* E, Vec* S) const {
    linear_stress(E, S);
    for (Index i = 0; i < 6; ++i) S[i] -= number(21 + i);
  }

  /// tangent = delta_ac S_bd + F_ai C_ibjd F_cj.
  void set_tangent(const Vec* H, const Vec* S, double* tangent) const {
    Vec F[9];
    for (Index i = 0; i < 9; ++i) F[i] = H[i] + (i % 4 == 0 ? 1.0 : 0.0);
    for (Index b = 0; b < 3; ++b)
      for (Index d = b; d < 3; ++d) {
        Vec FC[9];  // F_ai C_ibjd, at 3a + j
        for (Index j = 0; j < 3; ++j) {
          const Vec C0 = number(triangle_entry<6>(kVoigt[0][b], kVoigt[j][d])),
                    C1 = number(triangle_entry<6>(kVoigt[1][b], kVoigt[j][d])),
                    C2 = number(triangle_entry<6>(kVoigt[2][b], kVoigt[j][d]));
          for (Index a = 0; a < 3; ++a) FC[3 * a + j] = F[3 * a] * C0 + F[3 * a + 1] * C1 + F[3 * a + 2] * C2;
        }
        for (Index a = 0; a < 3; ++a)
          for (Index c = 0; c < 3; ++c) {
            const Index row = 3 * a + b, column = 3 * c + d;
            if (b == d && row > column) continue;
            Vec value = FC[3 * a] * F[3 * c] + FC[3 * a + 1] * F[3 * c + 1] + FC[3 * a + 2] * F[3 * c + 2];
            if (a == c) value += S[kVoigt[b][d]];
            store(tangent + triangle_entry<9>(row, column) * kLanes, value);
          }
      }
  }
};

#include "runtime/kernels/materials_isa.inl"

/// One of the examples of a law: H - H_k, times A_k where there is one, and its weight.
struct Reference {
  const double* shift;
  const double* inverse;  ///< null: the identity, of volume 1
  Vec weight;

  Reference(const ElementLaw& law, Index at, Index k)
      : shift(law.shifts + place(law, at, k, 9)),
        inverse(law.inverses == nullptr ? nullptr : law.inverses + place(law, at, k, kInverseNumbers)),
        weight(zero() + law.shift_weights[k]) {
    if (inverse != nullptr) weight *= load(inverse + 9 * kLanes);
  }

  void displacement_gradient(const Vec* H, Vec* own) const {
    Vec shifted[9];
    for (Index i = 0; i < 9; ++i) shifted[i] = H[i] - load(shift + i * kLanes);
    for (Index a = 0; a < 3; ++a)
      for (Index b = 0; b < 3; ++b)
        own[3 * a + b] = inverse == nullptr
                             ? shifted[3 * a + b]
                             : shifted[3 * a] * A(0, b) + shifted[3 * a + 1] * A(1, b) + shifted[3 * a + 2] * A(2, b);
  }

  /// P += P' A^T, tangent += (I (x) A) tangent' (I (x) A^T).
  template <Want want>
  void add(const Vec* own_P, const double* own_tangent, Vec* P, double* tangent) const {
    for (Index a = 0; a < 3; ++a)
      for (Index b = 0; b < 3; ++b)
        P[3 * a + b] += own_P[3 * a] * A(b, 0) + own_P[3 * a + 1] * A(b, 1) + own_P[3 * a + 2] * A(b, 2);
    if constexpr (want == Want::kStiffness)
      for (Index a = 0; a < 3; ++a)
        for (Index c = a; c < 3; ++c) add_block(own_tangent, a, c, tangent);
  }

 private:
  static Index place(const ElementLaw& law, Index at, Index k, Index numbers) {
    return (at / kLanes * law.shift_count + k) * numbers * kLanes + at % kLanes;
  }

  Vec A(Index i, Index j) const { return load(inverse + (3 * i + j) * kLanes); }

  /// The 3 x 3 block of rows 3a and columns 3c: A times the block times A^T.
  void add_block(const double* own_tangent, Index a, Index c, double* tangent) const {
    Vec left[9];  // A times the block
    for (Index l = 0; l < 3; ++l) {
      Vec column[3];
      for (Index k = 0; k < 3; ++k) column[k] = load(own_tangent + triangle_entry<9>(3 * a + k, 3 * c + l) * kLanes);
      for (Index b = 0; b < 3; ++b) left[3 * b + l] = A(b, 0) * column[0] + A(b, 1) * column[1] + A(b, 2) * column[2];
    }
    for (Index b = 0; b < 3; ++b)
      for (Index d = a == c ? b : 0; d < 3; ++d)
        add_to(tangent + triangle_entry<9>(3 * a + b, 3 * c + d) * kLanes,
               left[3 * b] * A(d, 0) + left[3 * b + 1] * A(d, 1) + left[3 * b + 2] * A(d, 2));
  }
};

template <Want want>
inline void clear_result(Vec* P, double* tangent) {
  for (Index i = 0; i < 9; ++i) P[i] = zero();
  if constexpr (want == Want::kStiffness)
    for (Index i = 0; i < kTangentNumbers; ++i) store(tangent + i * kLanes, zero());
}

/// The sum over the law's examples.
template <Want want, class Material>
inline Vec evaluate_examples(const ElementLaw& law, Index at, const Vec* H, Vec* P, double* tangent) {
  alignas(kAlignment) double own_tangent[want == Want::kStiffness ? kTangentNumbers * kLanes : kLanes];
  Vec energy = zero();
  for (Index k = 0; k < law.shift_count; ++k) {
    if (law.shift_weights[k] == 0) continue;
    const Reference reference(law, at, k);
    const Material material{reference.weight * load(law.mu + at), reference.weight * load(law.lambda + at)};
    Vec own[9], own_P[9];
    reference.displacement_gradient(H, own);
    if (reference.inverse == nullptr) {
      energy += material.template evaluate<want>(own, P, tangent);
      continue;
    }
    clear_result<want>(own_P, own_tangent);
    energy += material.template evaluate<want>(own, own_P, own_tangent);
    if constexpr (want != Want::kEnergy) reference.add<want>(own_P, own_tangent, P, tangent);
  }
  return energy;
}

/// Energy of one register's elements by the law; sets P and the tangent, as wanted.
template <Want want, class Law>
inline Vec evaluate_law(const ElementLaw& law, Index at, const Vec* H, Vec* P, double* tangent) {
  clear_result<want>(P, tangent);
  if constexpr (std::is_same_v<Law, Quadratic>) {
    const Quadratic quadratic{law.quadratic + (at / kLanes * kQuadraticNumbers) * kLanes + at % kLanes};
    return quadratic.evaluate<want>(H, P, tangent);
  } else {
    if (law.shift_count > 0) return evaluate_examples<want, Law>(law, at, H, P, tangent);
    const Law material{load(law.mu + at), load(law.lambda + at)};
    return material.template evaluate<want>(H, P, tangent);
  }
}

/// work with the type of the law: chosen once for all elements.
template <class Work>
inline auto with_law(const ElementLaw& law, Work work) {
  switch (law.kind) {
    case ElementLaw::Kind::kQuadraticInGreenStrain:
      return work.template operator()<Quadratic>();
    case ElementLaw::Kind::kStableNeoHookean:
      return work.template operator()<StableNeoHookean>();
    case ElementLaw::Kind::kCorotational:
      return work.template operator()<Corotational>();
    case ElementLaw::Kind::kStVenantKirchhoff:
      break;
  }
  return work.template operator()<StVenantKirchhoff>();
}

// --- stiffness -------------------------------------------------------------------------------------------------------

/// `vectors` registers of the columns of D B of one element.
template <Index vectors>
inline void tangent_product_columns(const double* tangent, const double* B, Index stride, double* product) {
  Vec b[9][vectors];
  for (Index k = 0; k < 9; ++k)
    for (Index v = 0; v < vectors; ++v) b[k][v] = load(B + k * stride + v * kWidth);
#pragma GCC unroll 9
  for (Index i = 0; i < 9; ++i) {
    Vec even[vectors], odd[vectors];
    for (Index v = 0; v < vectors; ++v) {
      even[v] = b[0][v] * tangent[triangle_entry<9>(i, 0) * kLanes];
      odd[v] = b[1][v] * tangent[triangle_entry<9>(i, 1) * kLanes];
    }
#pragma GCC unroll 7
    for (Index k = 2; k < 9; ++k) {
      const double d = tangent[triangle_entry<9>(i, k) * kLanes];
      for (Index v = 0; v < vectors; ++v) (k % 2 == 0 ? even : odd)[v] += b[k][v] * d;
    }
    for (Index v = 0; v < vectors; ++v) store(product + i * stride + v * kWidth, even[v] + odd[v]);
  }
}

/// product [9 x stride] = D B of one element; D at `tangent`, kLanes apart.
inline void tangent_product(const double* tangent, const double* B, Index stride, double* product) {
  constexpr Index kVectors = kWidth == 8 ? 2 : 1;  // what the registers hold
  Index column = 0;
  for (; column + kVectors * kWidth <= stride; column += kVectors * kWidth)
    tangent_product_columns<kVectors>(tangent, B + column, stride, product + column);
  for (; column < stride; column += kWidth) tangent_product_columns<1>(tangent, B + column, stride, product + column);
}

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

inline void add_panel_stiffness(const ElementArrays& elements, Index panel, const double* tangents,
                                const ElementScratch& scratch) {
  const double* B = elements.by_element + panel * kLanes * 9 * elements.stride;
  // As many elements at a time as keep B, D B and the sums in the first-level cache.
  const Index count = elements.stride > 24 ? kLanes / 2 : kLanes;
  for (Index first = 0; first < kLanes; first += count) {
    const double* block = B + first * 9 * elements.stride;
    for (Index e = 0; e < count; ++e)
      tangent_product(tangents + first + e, block + e * 9 * elements.stride, elements.stride,
                      scratch.product + e * 9 * elements.stride);
    half_product(block, scratch.product, elements.stride, elements.modes, 9 * count, scratch.stiffness);
  }
}

/// Upper triangle by rows into lower triangle by columns.
inline void copy_triangle(const double* from, Index stride, Index modes, double* to, Index outer) {
  for (Index i = 0; i < modes; ++i)
    for (Index j = i; j < modes; ++j) to[i * outer + j] = from[i * stride + j];
}

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

template <Want want, class Law>
inline double evaluate_elements(const ElementArrays& elements, const ElementLaw& law, const double* q,
                                const ElementScratch& scratch, double* force) {
  alignas(kAlignment) double tangents[kTangentNumbers * kLanes];
  Vec total = zero();
  clear(scratch.force, elements.modes * kLanes);
  for (Index panel = 0; panel < elements.panels; ++panel) {
    const double* by_mode = elements.by_mode + panel * elements.modes * 9 * kLanes;
    for (Index part = 0; part < kParts; ++part) {
      Vec H[9], P[9];
      gradient(by_mode + part * kWidth, elements.modes, q, H);
      total += evaluate_law<want, Law>(law, panel * kLanes + part * kWidth, H, P, tangents + part * kWidth);
      add_force(by_mode + part * kWidth, elements.modes, P, scratch.force);
    }
    if constexpr (want == Want::kStiffness) add_panel_stiffness(elements, panel, tangents, scratch);
  }
  for (Index c = 0; c < elements.modes; ++c) force[c] = sum(load(scratch.force + c * kLanes));
  return sum(total);
}

double force(const ElementArrays& elements, const ElementLaw& law, const double* q, const ElementScratch& scratch,
             double* force) {
  return with_law(law,
                  [&]<class Law>() { return evaluate_elements<Want::kForce, Law>(elements, law, q, scratch, force); });
}

double force_and_stiffness(const ElementArrays& elements, const ElementLaw& law, const double* q,
                           const ElementScratch& scratch, double* force, double* stiffness, Index outer) {
  clear(scratch.stiffness, elements.stride * elements.stride);
  const double energy = with_law(
      law, [&]<class Law>() { return evaluate_elements<Want::kStiffness, Law>(elements, law, q, scratch, force); });
  copy_triangle(scratch.stiffness, elements.stride, elements.modes, stiffness, outer);
  return energy;
}

void stiffness_of_tangents(const ElementArrays& elements, const double* tangents, const ElementScratch& scratch,
                           double* stiffness, Index outer) {
  clear(scratch.stiffness, elements.stride * elements.stride);
  for (Index panel = 0; panel < elements.panels; ++panel)
    add_panel_stiffness(elements, panel, tangents + panel * kTangentNumbers * kLanes, scratch);
  copy_triangle(scratch.stiffness, elements.stride, elements.modes, stiffness, outer);
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

/// Factor of the diagonal block in kWidth columns; entries above the diagonal become zero, the diagonal its inverse.
inline bool factor_block(Vec* columns, Index count) {
#pragma GCC unroll 8
  for (Index c = 0; c < kWidth; ++c) {
    if (c >= count) break;
    const double pivot = columns[c][c];
    if (!(pivot > 0) || !(pivot < __builtin_inf())) return false;
    const double inverse = 1 / __builtin_sqrt(pivot);
    columns[c] *= inverse;
#pragma GCC unroll 8
    for (Index d = c + 1; d < kWidth; ++d) columns[d] -= columns[c] * columns[c][d];
    for (Index i = 0; i < c; ++i) columns[c][i] = 0;
    columns[c][c] = inverse;
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

void cholesky_solve(const double* L, Index n, double* x) {
  const Index stride = padded(n);
  for (Index i = n; i < stride; ++i) x[i] = 0;
  for (Index j = 0; j < n; j += kWidth) {
    const Index count = n - j < kWidth ? n - j : kWidth;
    const double* block = L + j * stride;
    Vec here = load(x + j);
#pragma GCC unroll 8
    for (Index c = 0; c < kWidth; ++c) {
      if (c >= count) break;
      const double value = here[c] * block[c * stride + j + c];
      here -= load(block + c * stride + j) * value;
      here[c] = value;
    }
    store(x + j, here);
    for (Index i = j + kWidth; i < stride; i += kWidth) {
      Vec below = load(x + i);
      for (Index c = 0; c < count; ++c) below -= load(block + c * stride + i) * x[j + c];
      store(x + i, below);
    }
  }
  for (Index j = (n - 1) / kWidth * kWidth; j >= 0; j -= kWidth) {
    const Index count = n - j < kWidth ? n - j : kWidth;
    const double* block = L + j * stride;
    Vec dots[kWidth] = {};
    for (Index i = j + kWidth; i < stride; i += kWidth) {
      const Vec below = load(x + i);
      for (Index c = 0; c < count; ++c) dots[c] += load(block + c * stride + i) * below;
    }
    double values[kWidth];
    for (Index c = 0; c < count; ++c) values[c] = x[j + c] - sum(dots[c]);
    for (Index c = count - 1; c >= 0; --c) {
      values[c] *= block[c * stride + j + c];
      for (Index d = 0; d < c; ++d) values[d] -= values[c] * block[d * stride + j + c];
    }
    for (Index c = 0; c < count; ++c) x[j + c] = values[c];
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
  constexpr Index kBlock = 16;
  for (Index block = 0; block < blocks; ++block, rest += kBlock, positions += kBlock) {
    FloatVec sums[kBlock / kFloats];
    for (Index v = 0; v < kBlock / kFloats; ++v) sums[v] = load(rest + v * kFloats);
    for (Index c = 0; c < modes; ++c, basis += kBlock)
      for (Index v = 0; v < kBlock / kFloats; ++v) sums[v] += load(basis + v * kFloats) * q[c];
    for (Index v = 0; v < kBlock / kFloats; ++v) store(positions + v * kFloats, sums[v]);
  }
}

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
                                 cholesky,
                                 cholesky_solve,
                                 gemm,
                                 positions};

}  // namespace exmat::runtime
