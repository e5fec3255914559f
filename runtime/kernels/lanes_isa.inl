// Part of kernels_isa.inl, which includes this file: kLanes bodies of one model side by side, a number of each in each
// lane. Constants of the model are read once for all of them, and nothing is summed across lanes: a body's numbers do
// not depend on the others'. One register's bodies at a time, at their first lane.

constexpr Index kBlock = kLaneBlock;
constexpr Index kBlockNumbers = kBlock * kBlock * kLanes;
constexpr Index kBlockColumns = kWidth == 8 ? kBlock : 2;  // what the registers hold at once

inline Index block_start(Index row, Index column) { return (row * (row + 1) / 2 + column) * kBlockNumbers; }
inline Index in_block(Index m, Index n) { return (m * kBlock + n) * kLanes; }

/// H = B q of one element.
inline void lanes_gradient(const double* B, Index stride, Index modes, const double* q, Vec* H) {
  for (Index i = 0; i < 9; ++i) H[i] = zero();
  for (Index c = 0; c < modes; ++c) {
    const Vec x = load(q + c * kLanes);
#pragma GCC unroll 9
    for (Index i = 0; i < 9; ++i) H[i] += x * B[i * stride + c];
  }
}

/// force += B^T P of one element.
inline void lanes_add_force(const double* B, Index stride, Index modes, const Vec* P, double* force) {
  for (Index c = 0; c < modes; ++c) {
    Vec even = load(force + c * kLanes), odd = zero();
#pragma GCC unroll 4
    for (Index i = 0; i < 8; i += 2) {
      even += P[i] * B[i * stride + c];
      odd += P[i + 1] * B[(i + 1) * stride + c];
    }
    store(force + c * kLanes, even + odd + P[8] * B[8 * stride + c]);
  }
}

/// How the stiffness is summed up. In doubles: an element at a time, B's numbers as they are.
struct InDoubles {
  using Number = double;
  using Lanes = Vec;
  static constexpr Index kSpread = kLanes;  ///< from number to number of one body
  static constexpr Index kEach = 1;         ///< numbers of B in one place
  static double factor(const double* B, Index i) { return B[i]; }
};

/// In floats: two elements at a time, the even and the odd lanes of a register, which holds as many bodies as one of
/// doubles; B's numbers in pairs of these elements.
struct InPairsOfFloats {
  using Number = float;
  using Lanes = FloatVec;
  static constexpr Index kSpread = 2 * kLanes, kEach = 2;
  static FloatVec factor(const float* B, Index i) {
    using Bits = long long __attribute__((vector_size(sizeof(Vec))));
    long long pair;
    __builtin_memcpy(&pair, B + 2 * i, sizeof pair);
    return reinterpret_cast<FloatVec>(Bits{} + pair);
  }
};

/// product [9 x rows x kSpread] = D B of one element, or of a pair, the first `modes` columns.
template <class In>
inline void lanes_tangent_product(const typename In::Number* tangent, const typename In::Number* B, Index stride,
                                  Index modes, Index rows, typename In::Number* product) {
  using Lanes = typename In::Lanes;
#pragma GCC unroll 9
  for (Index i = 0; i < 9; ++i) {
    Lanes D[9];
#pragma GCC unroll 9
    for (Index k = 0; k < 9; ++k) D[k] = load(tangent + triangle_entry<9>(i, k) * In::kSpread);
    for (Index c = 0; c < modes; ++c) {
      Lanes even = D[0] * In::factor(B, c), odd = D[1] * In::factor(B, stride + c);
#pragma GCC unroll 7
      for (Index k = 2; k < 9; ++k) (k % 2 == 0 ? even : odd) += D[k] * In::factor(B, k * stride + c);
      store(product + (i * rows + c) * In::kSpread, even + odd);
    }
  }
}

/// kBlockColumns columns, from `first` on, of a block of the stiffness += B^T (D B) over `depth` rows, those of B
/// `stride` and those of D B `rows` numbers apart; only the first `count` rows of the block, of a diagonal one the
/// lower triangle.
template <class In, bool diagonal, Index count, Index first>
inline void lanes_add_columns(const typename In::Number* B, Index stride, const typename In::Number* product,
                              Index rows, Index depth, typename In::Number* block) {
  using Lanes = typename In::Lanes;
  constexpr auto wanted = [](Index m, Index n) { return !diagonal || first + n <= m; };
  constexpr auto place = [](Index m, Index n) { return (m * kBlock + first + n) * In::kSpread; };
  Lanes sums[count][kBlockColumns];
#pragma GCC unroll 4
  for (Index m = 0; m < count; ++m)
#pragma GCC unroll 4
    for (Index n = 0; n < kBlockColumns; ++n)
      if (wanted(m, n)) sums[m][n] = load(block + place(m, n));
  for (Index k = 0; k < depth; ++k) {
    Lanes right[kBlockColumns];
#pragma GCC unroll 4
    for (Index n = 0; n < kBlockColumns; ++n)
      if (wanted(count - 1, n)) right[n] = load(product + (k * rows + first + n) * In::kSpread);
#pragma GCC unroll 4
    for (Index m = 0; m < count; ++m) {
      const auto left = In::factor(B, k * stride + m);
#pragma GCC unroll 4
      for (Index n = 0; n < kBlockColumns; ++n)
        if (wanted(m, n)) sums[m][n] += right[n] * left;
    }
  }
#pragma GCC unroll 4
  for (Index m = 0; m < count; ++m)
#pragma GCC unroll 4
    for (Index n = 0; n < kBlockColumns; ++n)
      if (wanted(m, n)) store(block + place(m, n), sums[m][n]);
}

template <class In, bool diagonal, Index count>
inline void lanes_add_block(const typename In::Number* B, Index stride, const typename In::Number* product, Index rows,
                            Index depth, typename In::Number* block) {
  lanes_add_columns<In, diagonal, count, 0>(B, stride, product, rows, depth, block);
  if constexpr (kBlockColumns < kBlock && (!diagonal || count > kBlockColumns))
    lanes_add_columns<In, diagonal, count, kBlock - kBlockColumns>(B, stride, product, rows, depth, block);
}

/// One row of blocks of the stiffness, `count` rows of it.
template <class In, Index count>
inline void lanes_add_row(const typename In::Number* B, Index stride, const typename In::Number* product, Index rows,
                          Index depth, Index row, typename In::Number* stiffness) {
  const auto block = [&](Index column) { return stiffness + block_start(row, column) / kLanes * In::kSpread; };
  B += In::kEach * kBlock * row;
  for (Index column = 0; column < row; ++column)
    lanes_add_block<In, false, count>(B, stride, product + kBlock * column * In::kSpread, rows, depth, block(column));
  lanes_add_block<In, true, count>(B, stride, product + kBlock * row * In::kSpread, rows, depth, block(row));
}

/// Stiffness += B^T (D B) over `depth` rows.
template <class In>
inline void lanes_add_stiffness(const typename In::Number* B, Index stride, const typename In::Number* product,
                                Index modes, Index depth, typename In::Number* stiffness) {
  const Index rows = lane_rows(modes), whole = modes / kBlock;
  for (Index row = 0; row < whole; ++row) lanes_add_row<In, kBlock>(B, stride, product, rows, depth, row, stiffness);
  if (modes % kBlock == 1) lanes_add_row<In, 1>(B, stride, product, rows, depth, whole, stiffness);
  if (modes % kBlock == 2) lanes_add_row<In, 2>(B, stride, product, rows, depth, whole, stiffness);
  if (modes % kBlock == 3) lanes_add_row<In, 3>(B, stride, product, rows, depth, whole, stiffness);
}

inline void lanes_clear(double* numbers, Index count) {
  for (Index i = 0; i < count; ++i) store(numbers + i * kLanes, zero());
}

constexpr Index kElementsAtOnce = 2;  // their B and D B stay in the first-level cache
static_assert(lane_scratch(kBlock) == kElementsAtOnce * 9 * kBlock * kLanes);

/// `product` [kElementsAtOnce x 9 x rows x kLanes].
template <Want want, class Law>
inline void lanes_evaluate(const ElementArrays& elements, const ElementLaw& law, const double* q, double* product,
                           double* energy, double* force, double* stiffness) {
  alignas(kAlignment) double tangent[kTangentNumbers * kLanes];
  const Index stride = elements.stride, rows = lane_rows(elements.modes);
  Vec total = zero();
  if constexpr (want != Want::kEnergy) lanes_clear(force, elements.modes);
  if constexpr (want == Want::kStiffness) lanes_clear(stiffness, lane_triangle(elements.modes) / kLanes);
  for (Index first = 0; first < elements.count; first += kElementsAtOnce) {
    const Index count = elements.count - first < kElementsAtOnce ? elements.count - first : kElementsAtOnce;
    const double* const block = elements.by_element + first * 9 * stride;
    for (Index e = 0; e < count; ++e) {
      const double* const B = block + e * 9 * stride;
      Vec H[9], P[9];
      lanes_gradient(B, stride, elements.modes, q, H);
      clear_result<want>(P, tangent);
      const Law material{zero() + law.mu[first + e], zero() + law.lambda[first + e]};
      total += material.template evaluate<want>(H, P, tangent);
      if constexpr (want != Want::kEnergy) lanes_add_force(B, stride, elements.modes, P, force);
      if constexpr (want == Want::kStiffness)
        lanes_tangent_product<InDoubles>(tangent, B, stride, elements.modes, rows, product + e * 9 * rows * kLanes);
    }
    if constexpr (want == Want::kStiffness)
      lanes_add_stiffness<InDoubles>(block, stride, product, elements.modes, 9 * count, stiffness);
  }
  store(energy, total);
}

/// The numbers of two elements, as floats beside each other.
inline FloatVec in_pairs(Vec even, Vec odd) {
  using Half = float __attribute__((vector_size(kWidth * sizeof(float))));
  using HalfBits = unsigned __attribute__((vector_size(kWidth * sizeof(unsigned))));
  using Bits = unsigned long long __attribute__((vector_size(sizeof(Vec))));
  const auto bits = [](Vec numbers) {
    return __builtin_convertvector(reinterpret_cast<HalfBits>(__builtin_convertvector(numbers, Half)), Bits);
  };
  return reinterpret_cast<FloatVec>(bits(even) | (bits(odd) << 32));
}

/// The sums of what stands beside each other.
inline Vec sum_of_pairs(FloatVec pairs) {
  using Half = float __attribute__((vector_size(kWidth * sizeof(float))));
  using HalfBits = unsigned __attribute__((vector_size(kWidth * sizeof(unsigned))));
  using Bits = unsigned long long __attribute__((vector_size(sizeof(Vec))));
  const auto numbers = [](Bits bits) {
    return __builtin_convertvector(reinterpret_cast<Half>(__builtin_convertvector(bits, HalfBits)), Vec);
  };
  const Bits bits = reinterpret_cast<Bits>(pairs);
  return numbers(bits & 0xffffffffU) + numbers(bits >> 32);
}

/// As lanes_evaluate() with the stiffness, which is summed up in floats: `product` holds two pairs of elements in place
/// of two elements, and `stiffness` floats until the end. Elements beyond the last are zeros.
template <class Law>
inline void lanes_evaluate_mixed(const ElementArrays& elements, const ElementLaw& law, const double* q, float* product,
                                 double* energy, double* force, double* stiffness) {
  alignas(kAlignment) double tangents[2][kTangentNumbers * kLanes];
  alignas(kAlignment) float pair[2 * kTangentNumbers * kLanes];
  const Index stride = elements.stride, rows = lane_rows(elements.modes), depth = 9 * kElementsAtOnce;
  float* const sums = reinterpret_cast<float*>(stiffness);
  Vec total = zero();
  lanes_clear(force, elements.modes);
  lanes_clear(stiffness, lane_triangle(elements.modes) / kLanes);
  for (Index first = 0; first < elements.count; first += 2 * kElementsAtOnce) {
    const float* const block = elements.by_pair + first * 9 * stride;
    for (Index e = 0; e < 2 * kElementsAtOnce; ++e) {
      const double* const B = elements.by_element + (first + e) * 9 * stride;
      double* const tangent = tangents[e % 2];
      Vec H[9], P[9];
      lanes_gradient(B, stride, elements.modes, q, H);
      clear_result<Want::kStiffness>(P, tangent);
      const Law material{zero() + law.mu[first + e], zero() + law.lambda[first + e]};
      total += material.template evaluate<Want::kStiffness>(H, P, tangent);
      lanes_add_force(B, stride, elements.modes, P, force);
      if (e % 2 == 0) continue;
      for (Index i = 0; i < kTangentNumbers; ++i)
        store(pair + i * 2 * kLanes, in_pairs(load(tangents[0] + i * kLanes), load(tangents[1] + i * kLanes)));
      lanes_tangent_product<InPairsOfFloats>(pair, block + e / 2 * 18 * stride, stride, elements.modes, rows,
                                             product + e / 2 * 18 * rows * kLanes);
    }
    lanes_add_stiffness<InPairsOfFloats>(block, stride, product, elements.modes, depth, sums);
  }
  for (Index i = 0; i < lane_triangle(elements.modes); i += kLanes)
    store(stiffness + i, sum_of_pairs(load(sums + 2 * i)));
  store(energy, total);
}

template <Want want>
inline void lanes_evaluate_parts(const ElementArrays& elements, const ElementLaw& law, const double* q, double* product,
                                 double* energy, double* force, double* stiffness) {
  for (Index at = 0; at < kLanes; at += kWidth)
    with_law(law, [&]<class Law>() {
      if constexpr (!std::is_same_v<Law, Quadratic>)
        lanes_evaluate<want, Law>(elements, law, q + at, product, energy + at, force + at, stiffness + at);
    });
}

void lanes_energy(const ElementArrays& elements, const ElementLaw& law, const double* q, double* energy) {
  double none[kLanes];
  lanes_evaluate_parts<Want::kEnergy>(elements, law, q, none, energy, none, none);
}

void lanes_force(const ElementArrays& elements, const ElementLaw& law, const double* q, double* energy, double* force) {
  double none[kLanes];
  lanes_evaluate_parts<Want::kForce>(elements, law, q, none, energy, force, none);
}

void lanes_force_and_stiffness(const ElementArrays& elements, const ElementLaw& law, const double* q, double* product,
                               double* energy, double* force, double* stiffness) {
  lanes_evaluate_parts<Want::kStiffness>(elements, law, q, product, energy, force, stiffness);
}

void lanes_force_and_mixed_stiffness(const ElementArrays& elements, const ElementLaw& law, const double* q,
                                     double* product, double* energy, double* force, double* stiffness) {
  for (Index at = 0; at < kLanes; at += kWidth)
    with_law(law, [&]<class Law>() {
      if constexpr (!std::is_same_v<Law, Quadratic>)
        lanes_evaluate_mixed<Law>(elements, law, q + at, reinterpret_cast<float*>(product), energy + at, force + at,
                                  stiffness + at);
    });
}

/// block -= left right^T of two blocks of a factor.
inline void lanes_subtract(const double* left, const double* right, double* block) {
#pragma GCC unroll 2
  for (Index first = 0; first < kBlock; first += kBlockColumns) {
    Vec sums[kBlock][kBlockColumns];
#pragma GCC unroll 4
    for (Index m = 0; m < kBlock; ++m)
#pragma GCC unroll 4
      for (Index n = 0; n < kBlockColumns; ++n) sums[m][n] = load(block + in_block(m, first + n));
#pragma GCC unroll 4
    for (Index k = 0; k < kBlock; ++k) {
      Vec r[kBlockColumns];
#pragma GCC unroll 4
      for (Index n = 0; n < kBlockColumns; ++n) r[n] = load(right + in_block(first + n, k));
#pragma GCC unroll 4
      for (Index m = 0; m < kBlock; ++m) {
        const Vec l = load(left + in_block(m, k));
#pragma GCC unroll 4
        for (Index n = 0; n < kBlockColumns; ++n) sums[m][n] -= l * r[n];
      }
    }
#pragma GCC unroll 4
    for (Index m = 0; m < kBlock; ++m)
#pragma GCC unroll 4
      for (Index n = 0; n < kBlockColumns; ++n) store(block + in_block(m, first + n), sums[m][n]);
  }
}

/// Factor of a diagonal block, the diagonal its inverse; only `count` rows are there. Lanes that fail become NaN.
inline void lanes_factor_block(double* block, Index count) {
  for (Index j = 0; j < count; ++j) {
    Vec pivot = load(block + in_block(j, j));
    pivot = select(pivot > 0.0, pivot, zero() + __builtin_nan(""));
    const Vec inverse = 1.0 / square_root(pivot);
    store(block + in_block(j, j), inverse);
    for (Index i = j + 1; i < count; ++i) store(block + in_block(i, j), load(block + in_block(i, j)) * inverse);
    for (Index k = j + 1; k < count; ++k) {
      const Vec right = load(block + in_block(k, j));
      for (Index i = k; i < count; ++i)
        store(block + in_block(i, k), load(block + in_block(i, k)) - load(block + in_block(i, j)) * right);
    }
  }
}

/// block <- block L^-T of the factored diagonal block L.
inline void lanes_solve_block(const double* L, double* block) {
  Vec b[kBlock][kBlock];
#pragma GCC unroll 4
  for (Index m = 0; m < kBlock; ++m)
#pragma GCC unroll 4
    for (Index n = 0; n < kBlock; ++n) b[m][n] = load(block + in_block(m, n));
#pragma GCC unroll 4
  for (Index j = 0; j < kBlock; ++j) {
    const Vec inverse = load(L + in_block(j, j));
#pragma GCC unroll 4
    for (Index m = 0; m < kBlock; ++m) b[m][j] *= inverse;
#pragma GCC unroll 4
    for (Index k = j + 1; k < kBlock; ++k) {
      const Vec l = load(L + in_block(k, j));
#pragma GCC unroll 4
      for (Index m = 0; m < kBlock; ++m) b[m][k] -= b[m][j] * l;
    }
  }
#pragma GCC unroll 4
  for (Index m = 0; m < kBlock; ++m)
#pragma GCC unroll 4
    for (Index n = 0; n < kBlock; ++n) store(block + in_block(m, n), b[m][n]);
}

void lanes_cholesky(double* L, Index n) {
  const Index blocks = lane_rows(n) / kBlock;
  for (Index at = 0; at < kLanes; at += kWidth)
    for (Index column = 0; column < blocks; ++column)
      for (Index row = column; row < blocks; ++row) {
        double* const block = L + block_start(row, column) + at;
        for (Index k = 0; k < column; ++k)
          lanes_subtract(L + block_start(row, k) + at, L + block_start(column, k) + at, block);
        if (row > column)
          lanes_solve_block(L + block_start(column, column) + at, block);
        else
          lanes_factor_block(block, n - kBlock * row < kBlock ? n - kBlock * row : kBlock);
      }
}

void lanes_cholesky_solve(const double* L, Index n, double* x) {
  const Index blocks = lane_rows(n) / kBlock;
  for (Index at = 0; at < kLanes; at += kWidth) {
    double* const own = x + at;
    for (Index row = 0; row < blocks; ++row) {
      const Index count = n - kBlock * row < kBlock ? n - kBlock * row : kBlock;
      Vec here[kBlock];
      for (Index m = 0; m < count; ++m) here[m] = load(own + (kBlock * row + m) * kLanes);
      for (Index column = 0; column < row; ++column) {
        const double* const block = L + block_start(row, column) + at;
        for (Index k = 0; k < kBlock; ++k) {
          const Vec known = load(own + (kBlock * column + k) * kLanes);
          for (Index m = 0; m < count; ++m) here[m] -= load(block + in_block(m, k)) * known;
        }
      }
      const double* const block = L + block_start(row, row) + at;
      for (Index m = 0; m < count; ++m) {
        for (Index k = 0; k < m; ++k) here[m] -= load(block + in_block(m, k)) * here[k];
        here[m] *= load(block + in_block(m, m));
        store(own + (kBlock * row + m) * kLanes, here[m]);
      }
    }
    for (Index row = blocks - 1; row >= 0; --row) {
      const Index count = n - kBlock * row < kBlock ? n - kBlock * row : kBlock;
      Vec here[kBlock];
      for (Index m = 0; m < count; ++m) here[m] = load(own + (kBlock * row + m) * kLanes);
      for (Index below = row + 1; below < blocks; ++below) {
        const double* const block = L + block_start(below, row) + at;
        const Index known_count = n - kBlock * below < kBlock ? n - kBlock * below : kBlock;
        for (Index k = 0; k < known_count; ++k) {
          const Vec known = load(own + (kBlock * below + k) * kLanes);
          for (Index m = 0; m < count; ++m) here[m] -= load(block + in_block(k, m)) * known;
        }
      }
      const double* const block = L + block_start(row, row) + at;
      for (Index m = count - 1; m >= 0; --m) {
        for (Index k = m + 1; k < count; ++k) here[m] -= load(block + in_block(k, m)) * here[k];
        here[m] *= load(block + in_block(m, m));
        store(own + (kBlock * row + m) * kLanes, here[m]);
      }
    }
  }
}

/// The first `count` rows of a block, `diagonal`: its lower triangle alone. here += B x, there += B^T y.
template <bool diagonal, Index count>
inline void lanes_add_products(const double* block, const Vec* x, const Vec* y, Vec* here, Vec* there) {
#pragma GCC unroll 4
  for (Index m = 0; m < count; ++m)
#pragma GCC unroll 4
    for (Index k = 0; k < (diagonal ? m : kBlock); ++k) {
      const Vec a = load(block + in_block(m, k));
      here[m] += a * x[k];
      there[k] += a * y[m];
    }
}

/// One row of blocks, `count` rows of it.
template <Index count>
inline void lanes_symmetric_rows(const double* A, Index row, const double* x, double* y) {
  Vec own[count], here[count];
#pragma GCC unroll 4
  for (Index m = 0; m < count; ++m) {
    own[m] = load(x + (kBlock * row + m) * kLanes);
    here[m] = zero();
  }
  for (Index column = 0; column < row; ++column) {
    double* const above = y + kBlock * column * kLanes;
    Vec others[kBlock], there[kBlock];
#pragma GCC unroll 4
    for (Index k = 0; k < kBlock; ++k) {
      others[k] = load(x + (kBlock * column + k) * kLanes);
      there[k] = load(above + k * kLanes);
    }
    lanes_add_products<false, count>(A + block_start(row, column), others, own, here, there);
#pragma GCC unroll 4
    for (Index k = 0; k < kBlock; ++k) store(above + k * kLanes, there[k]);
  }
  const double* const block = A + block_start(row, row);
  lanes_add_products<true, count>(block, own, own, here, here);
#pragma GCC unroll 4
  for (Index m = 0; m < count; ++m)
    store(y + (kBlock * row + m) * kLanes, here[m] + load(block + in_block(m, m)) * own[m]);
}

void lanes_symmetric_product(const double* A, Index n, const double* x, double* y) {
  const Index whole = n / kBlock;
  for (Index at = 0; at < kLanes; at += kWidth) {
    for (Index row = 0; row < whole; ++row) lanes_symmetric_rows<kBlock>(A + at, row, x + at, y + at);
    if (n % kBlock == 1) lanes_symmetric_rows<1>(A + at, whole, x + at, y + at);
    if (n % kBlock == 2) lanes_symmetric_rows<2>(A + at, whole, x + at, y + at);
    if (n % kBlock == 3) lanes_symmetric_rows<3>(A + at, whole, x + at, y + at);
  }
}

/// y [rows] = A x, one register's bodies.
template <Index rows>
inline void lanes_product_rows(const double* A, Index columns, Index outer, const double* x, double* y) {
  Vec sums[rows];
#pragma GCC unroll 8
  for (Index i = 0; i < rows; ++i) sums[i] = zero();
  for (Index c = 0; c < columns; ++c) {
    const Vec here = load(x + c * kLanes);
#pragma GCC unroll 8
    for (Index i = 0; i < rows; ++i) sums[i] += here * A[c * outer + i];
  }
#pragma GCC unroll 8
  for (Index i = 0; i < rows; ++i) store(y + i * kLanes, sums[i]);
}

void lanes_matrix_product(const double* A, Index rows, Index columns, Index outer, const double* x, double* y) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    Index i = 0;
    for (; i + 8 <= rows; i += 8) lanes_product_rows<8>(A + i, columns, outer, x + at, y + i * kLanes + at);
    for (; i + 4 <= rows; i += 4) lanes_product_rows<4>(A + i, columns, outer, x + at, y + i * kLanes + at);
    for (; i < rows; ++i) lanes_product_rows<1>(A + i, columns, outer, x + at, y + i * kLanes + at);
  }
}
