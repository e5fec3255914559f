// Part of kernels_isa.inl, which includes this file: the stiffness of St.Venant-Kirchhoff of kLanes bodies side by side
// as the polynomial that it is, see StiffnessPolynomialArrays. With m_ijk = C_ijk + 1/2 D_ijkl q_l, which is symmetric,
// K_ij = K0_ij + m_ijk q_k: each m is computed once, for i >= j >= k, and serves as many entries as it has indices. m_i
// is a matrix of i + 1 rows, in blocks.

/// Rows and columns of a block, of one on the diagonal its lower triangle: where each number is.
template <bool diagonal>
constexpr Index slope_entry(Index m, Index n) {
  return diagonal ? m * (m + 1) / 2 + n : m * kBlock + n;
}

/// A block of m_i of `rows` rows, from row `first` on: K_jk += m_ijk q_i, but of row i, the `last` one; and with both k
/// and j the sums K_ij += m_ijk q_k. `numbers` of the block times `depth` powers 1, q_0, ...; q and K_i of its rows and
/// of its columns.
template <class In, bool diagonal, bool last, Index rows, Index first = 0>
inline void lanes_add_slopes(const typename In::Number* numbers, Index depth, const typename In::Number* powers,
                             typename In::Lanes largest, const typename In::Number* q_rows,
                             const typename In::Number* q_columns, typename In::Number* block,
                             typename In::Number* row_sums, typename In::Number* column_sums) {
  using Lanes = typename In::Lanes;
  constexpr Index kRows = kWidth == 8 ? kBlock : 2;  // what the registers hold at once
  constexpr Index kEnd = first + kRows < rows ? first + kRows : rows, kEntries = slope_entry<diagonal>(rows, 0),
                  kBegin = slope_entry<diagonal>(first, 0), kCount = slope_entry<diagonal>(kEnd, 0) - kBegin;
  constexpr auto wanted = [](Index m, Index n) { return m >= first && m < kEnd && (!diagonal || n <= m); };
  constexpr auto place = [](Index m, Index n) { return slope_entry<diagonal>(m, n) - kBegin; };
  const auto at = [](auto* vector, Index c) { return vector + c * In::kSpread; };
  const typename In::Number* const own = In::columns_from(numbers, kBegin);
  Lanes slopes[kCount] = {};
  for (Index l = 0; l < depth; ++l) {
    const Lanes power = load(at(powers, l));
#pragma GCC unroll 16
    for (Index t = 0; t < kCount; ++t) slopes[t] += power * In::factor(own, kEntries, l, t);
  }
#pragma GCC unroll 4
  for (Index m = 0; m < kBlock; ++m)
#pragma GCC unroll 4
    for (Index n = 0; n < kBlock; ++n) {
      if (!wanted(m, n) || (last && m + 1 == rows)) continue;
      typename In::Number* const entry = at(block, m * kBlock + n);
      store(entry, load(entry) + slopes[place(m, n)] * largest);
    }
#pragma GCC unroll 4
  for (Index m = 0; m < kBlock; ++m) {
    if (!wanted(m, 0)) continue;
    Lanes sum = load(at(row_sums, m));
#pragma GCC unroll 4
    for (Index n = 0; n < kBlock; ++n)
      if (wanted(m, n)) sum += slopes[place(m, n)] * load(at(q_columns, n));
    store(at(row_sums, m), sum);
  }
#pragma GCC unroll 4
  for (Index n = 0; n < kBlock; ++n) {
    if (!wanted(kEnd - 1, n)) continue;
    Lanes sum = load(at(column_sums, n));
#pragma GCC unroll 4
    for (Index m = 0; m < kBlock; ++m)
      if (wanted(m, n) && !(diagonal && m == n)) sum += slopes[place(m, n)] * load(at(q_rows, m));
    store(at(column_sums, n), sum);
  }
  if constexpr (kEnd < rows)
    lanes_add_slopes<In, diagonal, last, rows, kEnd>(numbers, depth, powers, largest, q_rows, q_columns, block,
                                                     row_sums, column_sums);
}

/// A row of blocks of m_i.
template <class In, bool last, Index rows>
inline const typename In::Number* lanes_add_slope_blocks(const typename In::Number* numbers, Index depth,
                                                         const typename In::Number* powers,
                                                         const typename In::Number* q, Index i, Index row,
                                                         typename In::Number* K) {
  const auto block = [&](Index r, Index c) { return K + block_start(r, c) / kLanes * In::kSpread; };
  const auto own = [&](Index c) { return block(i / kBlock, c) + i % kBlock * kBlock * In::kSpread; };
  const auto part = [&](Index c) { return q + c * kBlock * In::kSpread; };
  const auto largest = load(q + i * In::kSpread);
  for (Index column = 0; column < row; ++column) {
    lanes_add_slopes<In, false, last, rows>(numbers, depth, powers, largest, part(row), part(column),
                                            block(row, column), own(row), own(column));
    numbers = In::rows_from(numbers, slope_entry<false>(rows, 0), depth);
  }
  lanes_add_slopes<In, true, last, rows>(numbers, depth, powers, largest, part(row), part(row), block(row, row),
                                         own(row), own(row));
  return In::rows_from(numbers, slope_entry<true>(rows, 0), depth);
}

/// K += m_ijk q_k.
template <class In>
inline void lanes_add_polynomial(Index modes, const typename In::Number* numbers, Index depth,
                                 const typename In::Number* powers, const typename In::Number* q,
                                 typename In::Number* K) {
  for (Index i = 0; i < modes; ++i) {
    const Index whole = i / kBlock;
    for (Index row = 0; row < whole; ++row)
      numbers = lanes_add_slope_blocks<In, false, kBlock>(numbers, depth, powers, q, i, row, K);
    const auto add_last = [&]<Index rows>() {
      numbers = lanes_add_slope_blocks<In, true, rows>(numbers, depth, powers, q, i, whole, K);
    };
    if (i % kBlock == 0) add_last.template operator()<1>();
    if (i % kBlock == 1) add_last.template operator()<2>();
    if (i % kBlock == 2) add_last.template operator()<3>();
    if (i % kBlock == 3) add_last.template operator()<4>();
  }
}

void lanes_polynomial_stiffness(const StiffnessPolynomialArrays& own, const double* q, double* stiffness) {
  alignas(kAlignment) double powers[(kMostPolynomialModes + 1) * kLanes];
  for (Index at = 0; at < kLanes; at += kWidth) {
    store(powers + at, zero() + 1.0);
    for (Index c = 0; c < own.modes; ++c) store(powers + (c + 1) * kLanes + at, load(q + c * kLanes + at));
    for (Index entry = 0; entry < lane_triangle(own.modes) / kLanes; ++entry)
      store(stiffness + entry * kLanes + at, zero() + own.constant[entry]);
    lanes_add_polynomial<InDoubles>(own.modes, own.numbers, own.modes + 1, powers + at, q + at, stiffness + at);
  }
}

void lanes_mixed_polynomial_stiffness(const StiffnessPolynomialArrays& own, const double* q, double* stiffness) {
  constexpr Index kPair = InPairsOfFloats::kSpread;
  alignas(kAlignment) float powers[(kMostPolynomialModes / 2 + 1) * kPair], twice[kMostPolynomialModes * kPair];
  float* const sums = reinterpret_cast<float*>(stiffness);
  const Index depth = own.modes / 2 + 1;
  for (Index at = 0; at < kLanes; at += kWidth) {
    const auto power = [&](Index n) {
      return n == 0 ? zero() + 1.0 : n <= own.modes ? load(q + (n - 1) * kLanes + at) : zero();
    };
    for (Index n = 0; n < depth; ++n) store(powers + n * kPair, in_pairs(power(2 * n), power(2 * n + 1)));
    for (Index c = 0; c < own.modes; ++c) store(twice + c * kPair, in_pairs(power(c + 1), power(c + 1)));
    for (Index entry = 0; entry < lane_triangle(own.modes) / kLanes; ++entry)
      store(sums + entry * kPair + 2 * at, FloatVec{});
    lanes_add_polynomial<InPairsOfFloats>(own.modes, own.rounded, depth, powers, twice, sums + 2 * at);
    for (Index entry = 0; entry < lane_triangle(own.modes) / kLanes; ++entry)
      store(stiffness + entry * kLanes + at, own.constant[entry] + sum_of_pairs(load(sums + entry * kPair + 2 * at)));
  }
}
