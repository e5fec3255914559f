// Part of kernels_isa.inl, which includes this file: kLanes bodies of one model side by side, a number of each in each
// lane. Constants of the model are read once for all of them, and nothing is summed across lanes: a body's numbers do
// not depend on the others'. One register's bodies at a time, at their first lane.

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

inline void lanes_clear(double* numbers, Index count) {
  for (Index i = 0; i < count; ++i) store(numbers + i * kLanes, zero());
}

template <Want want, class Law>
inline void lanes_evaluate(const ElementArrays& elements, const ElementLaw& law, const double* q, double* energy,
                           double* force, double* stiffness) {
  constexpr Index kTangent = kTangentNumbers * kLanes;
  alignas(kAlignment) double tangents[want == Want::kStiffness ? kElementsAtOnce * kTangent : kLanes];
  const Index stride = elements.stride;
  Vec total = zero();
  if constexpr (want != Want::kEnergy) lanes_clear(force, elements.modes);
  for (Index first = 0; first < elements.count; first += kElementsAtOnce) {
    const Index count = elements.count - first < kElementsAtOnce ? elements.count - first : kElementsAtOnce;
    const double* const block = elements.by_element + first * 9 * stride;
    for (Index e = 0; e < count; ++e) {
      const double* const B = block + e * 9 * stride;
      Vec H[9], P[9];
      lanes_gradient(B, stride, elements.modes, q, H);
      clear_result<Want::kForce>(P, nullptr);
      const Law material{zero() + law.mu[first + e], zero() + law.lambda[first + e]};
      total += evaluate_one<want>(material, H, P, tangents + (want == Want::kStiffness ? e * kTangent : 0));
      if constexpr (want != Want::kEnergy) lanes_add_force(B, stride, elements.modes, P, force);
    }
    if constexpr (want == Want::kStiffness)
      lanes_add_stiffness<InDoubles>(tangents, block, stride, elements.modes, count, first == 0, stiffness);
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

/// The tangents of two elements as floats beside each other, from what they are made of; evaluated in floats where
/// these are good enough.
template <class Law>
inline void pair_of_tangents(const Law& law, const Vec (&inputs)[2][Law::kTangentInputs], float* tangent) {
  const auto put = [&](Index entry, FloatVec value) { store(tangent + entry * 2 * kLanes, value); };
  if constexpr (Law::kTangentInFloats) {
    FloatVec both[Law::kTangentInputs];
    for (Index i = 0; i < Law::kTangentInputs; ++i) both[i] = in_pairs(inputs[0][i], inputs[1][i]);
    law.tangent(both, put);
  } else {
    Vec even[kTangentNumbers];
    law.tangent(inputs[0], [&](Index entry, Vec value) { even[entry] = value; });
    law.tangent(inputs[1], [&](Index entry, Vec value) { put(entry, in_pairs(even[entry], value)); });
  }
}

/// As lanes_evaluate() with the stiffness, which holds floats until the end. An element beyond the last is made of
/// zeros.
template <class Law>
inline void lanes_evaluate_mixed(const ElementArrays& elements, const ElementLaw& law, const double* q, double* energy,
                                 double* force, double* stiffness) {
  constexpr Index kTangent = 2 * kTangentNumbers * kLanes;
  alignas(kAlignment) float tangents[kElementsAtOnce * kTangent];
  Vec inputs[2][Law::kTangentInputs];
  const Index stride = elements.stride, pairs = (elements.count + 1) / 2;
  float* const sums = reinterpret_cast<float*>(stiffness);
  Vec total = zero();
  lanes_clear(force, elements.modes);
  for (Index first = 0; first < pairs; first += kElementsAtOnce) {
    const Index count = pairs - first < kElementsAtOnce ? pairs - first : kElementsAtOnce;
    for (Index e = 0; e < 2 * count; ++e) {
      const Index element = 2 * first + e;
      const double* const B = elements.by_element + element * 9 * stride;
      Vec H[9], P[9];
      lanes_gradient(B, stride, elements.modes, q, H);
      clear_result<Want::kForce>(P, nullptr);
      const Law material{zero() + law.mu[element], zero() + law.lambda[element]};
      total += material.template evaluate<Want::kStiffness>(H, P, inputs[e % 2]);
      lanes_add_force(B, stride, elements.modes, P, force);
      if (e % 2 == 1) pair_of_tangents(material, inputs, tangents + e / 2 * kTangent);
    }
    lanes_add_stiffness<InPairsOfFloats>(tangents, elements.by_pair + first * 18 * stride, stride, elements.modes,
                                         count, first == 0, sums);
  }
  for (Index i = 0; i < lane_triangle(elements.modes); i += kLanes)
    store(stiffness + i, sum_of_pairs(load(sums + 2 * i)));
  store(energy, total);
}

template <Want want>
inline void lanes_evaluate_parts(const ElementArrays& elements, const ElementLaw& law, const double* q, double* energy,
                                 double* force, double* stiffness) {
  for (Index at = 0; at < kLanes; at += kWidth)
    with_law(law, [&]<class Law>() {
      if constexpr (!std::is_same_v<Law, Quadratic>)
        lanes_evaluate<want, Law>(elements, law, q + at, energy + at, force + at, stiffness + at);
    });
}

void lanes_energy(const ElementArrays& elements, const ElementLaw& law, const double* q, double* energy) {
  double none[kLanes];
  lanes_evaluate_parts<Want::kEnergy>(elements, law, q, energy, none, none);
}

void lanes_force(const ElementArrays& elements, const ElementLaw& law, const double* q, double* energy, double* force) {
  double none[kLanes];
  lanes_evaluate_parts<Want::kForce>(elements, law, q, energy, force, none);
}

void lanes_force_and_stiffness(const ElementArrays& elements, const ElementLaw& law, const double* q, double* energy,
                               double* force, double* stiffness) {
  lanes_evaluate_parts<Want::kStiffness>(elements, law, q, energy, force, stiffness);
}

void lanes_force_and_mixed_stiffness(const ElementArrays& elements, const ElementLaw& law, const double* q,
                                     double* energy, double* force, double* stiffness) {
  for (Index at = 0; at < kLanes; at += kWidth)
    with_law(law, [&]<class Law>() {
      if constexpr (!std::is_same_v<Law, Quadratic>)
        lanes_evaluate_mixed<Law>(elements, law, q + at, energy + at, force + at, stiffness + at);
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

/// Factor of the first `count` rows and columns of a diagonal block, the diagonal its inverse. Lanes that fail become
/// NaN. The next pivot waits for a division alone, not for the root.
template <Index count>
inline void lanes_factor_block(double* block) {
  Vec b[count][count];
#pragma GCC unroll 4
  for (Index m = 0; m < count; ++m)
#pragma GCC unroll 4
    for (Index n = 0; n <= m; ++n) b[m][n] = load(block + in_block(m, n));
#pragma GCC unroll 4
  for (Index j = 0; j < count; ++j) {
    const Vec pivot = select(b[j][j] > 0.0, b[j][j], zero() + __builtin_nan(""));
    const Vec inverse = 1.0 / pivot, root = square_root(inverse);
#pragma GCC unroll 4
    for (Index k = j + 1; k < count; ++k)
#pragma GCC unroll 4
      for (Index i = k; i < count; ++i) b[i][k] -= b[i][j] * b[k][j] * inverse;
    store(block + in_block(j, j), root);
#pragma GCC unroll 4
    for (Index i = j + 1; i < count; ++i) store(block + in_block(i, j), b[i][j] * root);
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
        if (row > column) {
          lanes_solve_block(L + block_start(column, column) + at, block);
          continue;
        }
        const Index count = n - kBlock * row;
        if (count >= 4) lanes_factor_block<4>(block);
        if (count == 3) lanes_factor_block<3>(block);
        if (count == 2) lanes_factor_block<2>(block);
        if (count == 1) lanes_factor_block<1>(block);
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

constexpr Index kProductRows = kWidth == 8 ? 12 : 8;  // what the registers hold at once

/// y [rows] = A x, one register's bodies.
template <Index rows>
inline void lanes_product_rows(const double* A, Index columns, Index outer, const double* x, double* y) {
  Vec sums[rows];
#pragma GCC unroll 12
  for (Index i = 0; i < rows; ++i) sums[i] = zero();
  for (Index c = 0; c < columns; ++c) {
    const Vec here = load(x + c * kLanes);
#pragma GCC unroll 12
    for (Index i = 0; i < rows; ++i) sums[i] += here * A[c * outer + i];
  }
#pragma GCC unroll 12
  for (Index i = 0; i < rows; ++i) store(y + i * kLanes, sums[i]);
}

/// The same of fewer rows than kProductRows.
template <Index most = kProductRows - 1>
inline void lanes_product_rest(Index rows, const double* A, Index columns, Index outer, const double* x, double* y) {
  if constexpr (most > 0) {
    if (rows == most)
      lanes_product_rows<most>(A, columns, outer, x, y);
    else
      lanes_product_rest<most - 1>(rows, A, columns, outer, x, y);
  }
}

void lanes_matrix_product(const double* A, Index rows, Index columns, Index outer, const double* x, double* y) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    Index i = 0;
    for (; i + kProductRows <= rows; i += kProductRows)
      lanes_product_rows<kProductRows>(A + i, columns, outer, x + at, y + i * kLanes + at);
    lanes_product_rest(rows - i, A + i, columns, outer, x + at, y + i * kLanes + at);
  }
}
