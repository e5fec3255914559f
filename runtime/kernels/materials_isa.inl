// Materials of laws_isa.inl, which includes this file: one register's elements at a time. Each is the lanes of its
// struct in common/elastic, linear in mu and lambda, which may hold weights. A tangent is a function of few numbers,
// kTangentInputs, which come with the stress: it may be evaluated in another precision than they are, where it is good
// enough in floats.

// --- small matrices, row-major ---------------------------------------------------------------------------------------

using IntVec = decltype(Vec{} > Vec{});

inline Vec select(IntVec mask, Vec yes, Vec no) { return mask ? yes : no; }
inline Vec larger(Vec a, Vec b) { return select(a > b, a, b); }
inline Vec smaller(Vec a, Vec b) { return select(a < b, a, b); }

/// A bit for each lane that is true.
inline unsigned bits(IntVec mask) {
#if EXMAT_SIMD_WIDTH == 8
  return _mm512_movepi64_mask(reinterpret_cast<__m512i>(mask));
#elif EXMAT_SIMD_WIDTH == 4
  return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<__m256d>(mask)));
#else
  return static_cast<unsigned>((mask[0] & 1) | (mask[1] & 2));
#endif
}

inline bool all(IntVec mask) { return bits(mask) == (1U << kWidth) - 1; }

inline Vec square_root(Vec v) {
  alignas(sizeof(Vec)) double lanes[kWidth];
  store(lanes, v);
  for (Index i = 0; i < kWidth; ++i) lanes[i] = __builtin_sqrt(lanes[i]);
  return load(lanes);
}

inline void cofactors(const Vec* M, Vec* C) {
  for (Index a = 0; a < 3; ++a)
    for (Index b = 0; b < 3; ++b) {
      const Index i = 3 * ((a + 1) % 3), j = 3 * ((a + 2) % 3), k = (b + 1) % 3, l = (b + 2) % 3;
      C[3 * a + b] = M[i + k] * M[j + l] - M[i + l] * M[j + k];
    }
}

inline Vec dot(const Vec* A, const Vec* B, Index size) {
  Vec sum = A[0] * B[0];
  for (Index i = 1; i < size; ++i) sum += A[i] * B[i];
  return sum;
}

inline Vec dot3(const Vec* a, const Vec* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline void add_identity(const Vec* H, Vec* F) {
  for (Index i = 0; i < 9; ++i) F[i] = H[i] + (i % 4 == 0 ? 1.0 : 0.0);
}

inline void add_to(double* sum, Vec value) { store(sum, load(sum) + value); }

/// x - log(1 + x) without cancellation, for 1 + x above the subnormal numbers. With 1 + x = 2^k m, log m is twice the
/// series of atanh((m - 1) / (m + 1)).
inline Vec log_remainder(Vec x) {
  constexpr unsigned long long kRootOfHalf = 0x3fe6a09e667f3bcd, kOne = 0x3ff0000000000000,
                               kMantissa = 0x000fffffffffffff;
  constexpr unsigned long long kBiasExponent = 0x4330000000000000;  // of 2^52, to which an integer is added as bits
  constexpr double kBias = 0x1p52 + 1023, kLog2 = 0.693147180559945309417;
  using Bits = unsigned long long __attribute__((vector_size(kWidth * sizeof(long long))));
  const Bits bits = reinterpret_cast<Bits>(1.0 + x) + (kOne - kRootOfHalf);
  const Vec k = reinterpret_cast<Vec>((bits >> 52) | kBiasExponent) - kBias;
  const Vec m = reinterpret_cast<Vec>((bits & kMantissa) + kRootOfHalf);
  const Vec f = select(k == 0.0, x, m - 1.0);
  const Vec z = f / (2.0 + f), square = z * z;
  Vec series = zero() + 1.0 / 19;
#pragma GCC unroll 8
  for (Index n = 17; n >= 3; n -= 2) series = series * square + 1.0 / static_cast<double>(n);
  return (x - f) + z * (f - 2.0 * square * series) - k * kLog2;
}

// --- St.Venant-Kirchhoff, and any quadratic form of the Green strain -------------------------------------------------

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

  static constexpr Index kTangentInputs = 17;  ///< F, S, mu, lambda
  static constexpr bool kTangentInFloats = true;

  /// Energy; adds the stress to P and sets what the tangent is made of, as wanted.
  template <Want want>
  Vec evaluate(const Vec* H, Vec* P, Vec* inputs) const {
    Vec E[6], S[6];
    green_strain(H, E);
    if constexpr (want != Want::kEnergy) {
      second_piola_kirchhoff(E, S);
      add_stress(H, S, P);
    }
    if constexpr (want == Want::kStiffness) {
      add_identity(H, inputs);
      for (Index i = 0; i < 6; ++i) inputs[9 + i] = S[i];
      inputs[15] = mu;
      inputs[16] = lambda;
    }
    return energy(E);
  }

  /// put(entry, value) of delta_ac S_bd + lambda F_ab F_cd + mu F_ad F_cb + mu delta_bd (F F^T)_ac.
  template <class Lanes, class Put>
  static void tangent(const Lanes* inputs, Put put) {
    const Lanes *F = inputs, *S = inputs + 9, mu = inputs[15], lambda = inputs[16];
    Lanes left[6];
    for (Index a = 0; a < 3; ++a)
      for (Index c = a; c < 3; ++c)
        left[kVoigt[a][c]] = mu * (F[3 * a] * F[3 * c] + F[3 * a + 1] * F[3 * c + 1] + F[3 * a + 2] * F[3 * c + 2]);
    Index entry = 0;
#pragma GCC unroll 9
    for (Index i = 0; i < 9; ++i) {
      const Index a = i / 3, b = i % 3;
      const Lanes lF = lambda * F[i];
#pragma GCC unroll 9
      for (Index j = i; j < 9; ++j, ++entry) {
        const Index c = j / 3, d = j % 3;
        Lanes value = lF * F[j] + mu * F[3 * a + d] * F[3 * c + b];
        if (a == c) value += S[kVoigt[b][d]];
        if (b == d) value += left[kVoigt[a][c]];
        put(entry, value);
      }
    }
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
};

/// 1/2 E : C : E - S0 : E + constant, from its 28 numbers.
struct Quadratic {
  const double* numbers;

  static constexpr Index kTangentInputs = 15;  ///< F, S

  template <Want want>
  Vec evaluate(const Vec* H, Vec* P, Vec* inputs) const {
    Vec E[6], S[6];
    green_strain(H, E);
    if constexpr (want != Want::kEnergy) {
      second_piola_kirchhoff(E, S);
      add_stress(H, S, P);
    }
    if constexpr (want == Want::kStiffness) {
      add_identity(H, inputs);
      for (Index i = 0; i < 6; ++i) inputs[9 + i] = S[i];
    }
    return energy(E);
  }

  /// put(entry, value) of delta_ac S_bd + F_ai C_ibjd F_cj.
  template <class Put>
  void tangent(const Vec* inputs, Put put) const {
    const Vec *F = inputs, *S = inputs + 9;
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
            put(triangle_entry<9>(row, column), value);
          }
      }
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
};

// --- stable neo-Hookean ----------------------------------------------------------------------------------------------

struct StableNeoHookean {
  Vec mu, lambda;

  StableNeoHookean(Vec lame_mu, Vec lame_lambda) : mu(4.0 / 3 * lame_mu), lambda(lame_lambda + 5.0 / 6 * lame_mu) {}

  static constexpr Index kTangentInputs = 22;  ///< F, its cofactors, and the four numbers of tangent()
  static constexpr bool kTangentInFloats = true;

  template <Want want>
  Vec evaluate(const Vec* H, Vec* P, Vec* inputs) const {
    Vec E[6], F[9], cofactor_H[9], cofactor[9];
    green_strain(H, E);
    add_identity(H, F);
    cofactors(H, cofactor_H);
    cofactors(F, cofactor);
    const Vec strain = E[0] + E[1] + E[2], a = 2.0 * strain, J = dot(F, cofactor, 3);
    const Vec second = E[0] * E[1] + E[1] * E[2] + E[2] * E[0] - E[3] * E[3] - E[4] * E[4] - E[5] * E[5];
    const Vec third =
        E[0] * (E[1] * E[2] - E[3] * E[3]) - E[5] * (E[5] * E[2] - E[3] * E[4]) + E[4] * (E[5] * E[3] - E[1] * E[4]);
    const Vec j = select(J > 0.0, (a + 4.0 * second + 8.0 * third) / (J + 1.0), J - 1.0);
    const Vec inverse = 1.0 / (4.0 + a);
    if constexpr (want != Want::kEnergy) {
      const Vec own = 0.25 * mu * a * inverse, volume = lambda * j, shear = 0.75 * mu;
      const Vec trace = H[0] + H[4] + H[8];
      for (Index i = 0; i < 9; ++i) {
        Vec symmetric = H[i] + H[3 * (i % 3) + i / 3] - cofactor_H[i];
        if (i % 4 == 0) symmetric -= trace;
        P[i] += shear * symmetric + own * F[i] + volume * cofactor[i];
      }
    }
    if constexpr (want == Want::kStiffness) {
      for (Index i = 0; i < 9; ++i) {
        inputs[i] = F[i];
        inputs[9 + i] = cofactor[i];
      }
      inputs[18] = mu * (3.0 + a) * inverse;
      inputs[19] = 2.0 * mu * inverse * inverse;
      inputs[20] = lambda * j - 0.75 * mu;
      inputs[21] = lambda;
    }
    return 0.5 * lambda * j * j + 0.5 * mu * (0.75 * j * j - 3.0 * second - 6.0 * third + log_remainder(0.25 * a));
  }

  template <class Lanes, class Put>
  static void tangent(const Lanes* inputs, Put put) {
    const Lanes *F = inputs, *cofactor = inputs + 9;
    const Lanes shear = inputs[18], growth = inputs[19], pressure = inputs[20], lambda = inputs[21];
    Lanes signed_F[9];
    for (Index i = 0; i < 9; ++i) signed_F[i] = pressure * F[i];
    Index entry = 0;
#pragma GCC unroll 9
    for (Index i = 0; i < 9; ++i) {
      const Index row = i / 3, column = i % 3;
      const Lanes own = growth * F[i], volume = lambda * cofactor[i];
#pragma GCC unroll 9
      for (Index k = i; k < 9; ++k, ++entry) {
        const Index other_row = k / 3, other_column = k % 3;
        Lanes value = own * F[k] + volume * cofactor[k];
        if (k == i) value += shear;
        if (row != other_row && column != other_column) {
          const Lanes derivative = signed_F[3 * (3 - row - other_row) + 3 - column - other_column];
          const bool positive = (other_row - row + 3) % 3 == (other_column - column + 3) % 3;
          value = positive ? value + derivative : value - derivative;
        }
        put(entry, value);
      }
    }
  }
};

#include "runtime/kernels/nearest_rotation_isa.inl"

// --- corotational ----------------------------------------------------------------------------------------------------

struct Corotational {
  Vec mu, lambda;

  Corotational(Vec lame_mu, Vec lame_lambda) : mu(lame_mu), lambda(lame_lambda) {}

  static constexpr Index kTangentInputs = 20;  ///< R, what turns it, 2 mu, lambda
  /// Turns cost nothing only as far as large terms cancel; bodies bend by turns that are large beside their strains.
  static constexpr bool kTangentInFloats = false;

  template <Want want>
  Vec evaluate(const Vec* H, Vec* P, Vec* inputs) const {
    const NearestRotation at(H);
    if constexpr (want != Want::kEnergy) {
      const Vec pressure = lambda * at.trace;
      for (Index i = 0; i < 9; ++i) {
        const Vec own = 2.0 * mu * at.stretch[i] + pressure * at.turned[i];
        P[i] += i % 4 == 0 ? own + pressure : own;
      }
    }
    if constexpr (want == Want::kStiffness) set_inputs(at, inputs);
    return mu * dot(at.stretch, at.stretch, 9) + 0.5 * lambda * at.trace * at.trace;
  }

  /// put(entry, value) of 2 mu I + lambda R R + (lambda (tr S - 3) - 2 mu) dR/dF. The turn of R is G^-1 of the skew
  /// part of R^T dF, so block (a, c) of dR/dF is X_a G^-1 X_c^T with X_a the cross product with row a of R.
  template <class Lanes, class Put>
  static void tangent(const Lanes* inputs, Put put) {
    const Lanes *R = inputs, *turning = inputs + 9, twice_mu = inputs[18], lambda = inputs[19];
    Lanes products[27];
    for (Index c = 0; c < 3; ++c)
      for (Index i = 0; i < 3; ++i) cross(R + 3 * c, turning + 3 * i, products + 9 * c + 3 * i);
    Index entry = 0;
#pragma GCC unroll 9
    for (Index i = 0; i < 9; ++i) {
      const Index a = i / 3, b = i % 3, next = (b + 1) % 3, last = (b + 2) % 3;
      const Lanes scaled = lambda * R[i];
#pragma GCC unroll 9
      for (Index j = i; j < 9; ++j, ++entry) {
        const Index c = j / 3, d = j % 3;
        // Row b of X_a times column d of G^-1 X_c^T.
        Lanes value = scaled * R[j] + R[3 * a + next] * products[9 * c + 3 * last + d] -
                      R[3 * a + last] * products[9 * c + 3 * next + d];
        if (i == j) value += twice_mu;
        put(entry, value);
      }
    }
  }

 private:
  void set_inputs(const NearestRotation& at, Vec* inputs) const {
    Vec M[9], inverse[9];
    add_identity(at.turned, inputs);
    at.rotated_stretch(M);
    at.inverse_sums(M, inverse);
    const Vec turning = lambda * at.trace - 2.0 * mu;
    for (Index i = 0; i < 9; ++i) inputs[9 + i] = inverse[i] * turning;
    inputs[18] = 2.0 * mu;
    inputs[19] = lambda;
  }

  template <class Lanes>
  static void cross(const Lanes* a, const Lanes* b, Lanes* product) {
    for (Index i = 0; i < 3; ++i) product[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
  }
};
