// Part of kernels_isa.inl, which includes this file: stiffness as the sum of B^T (D B) with something of its own in
// each lane: a body of several (lanes_isa.inl), or an element of one body. So no register is half empty, however many
// modes there are. Matrices are made of blocks, see kLaneBlock.

constexpr Index kBlock = kLaneBlock;
constexpr Index kBlockNumbers = kBlock * kBlock * kLanes;
constexpr Index kBlockColumns = kWidth == 8 ? kBlock : 2;  // what the registers hold at once

inline Index block_start(Index row, Index column) { return (row * (row + 1) / 2 + column) * kBlockNumbers; }
inline Index in_block(Index m, Index n) { return (m * kBlock + n) * kLanes; }

// Layouts of the sums: the numbers, the registers of them, how far the numbers of one lane are from each other in sums
// and products (kSpread) and in tangents, and B, whose rows `stride` are apart.

/// Bodies in doubles: an element at a time, B the same for all.
struct InDoubles {
  using Number = double;
  using Lanes = Vec;
  static constexpr Index kSpread = kLanes, kTangentSpread = kLanes;
  static double factor(const double* B, Index stride, Index k, Index column) { return B[k * stride + column]; }
  static const double* columns_from(const double* B, Index column) { return B + column; }
  static const double* rows_from(const double* B, Index stride, Index row) { return B + row * stride; }
};

/// Bodies in floats: two elements at a time, the even and the odd lanes of a register, which holds as many bodies
/// as one of doubles; B's numbers in pairs of these elements.
struct InPairsOfFloats {
  using Number = float;
  using Lanes = FloatVec;
  static constexpr Index kSpread = 2 * kLanes, kTangentSpread = kSpread;
  static FloatVec factor(const float* B, Index stride, Index k, Index column) {
    using Bits = long long __attribute__((vector_size(sizeof(Vec))));
    long long pair;
    __builtin_memcpy(&pair, B + 2 * (k * stride + column), sizeof pair);
    return reinterpret_cast<FloatVec>(Bits{} + pair);
  }
  static const float* columns_from(const float* B, Index column) { return B + 2 * column; }
  static const float* rows_from(const float* B, Index stride, Index row) { return B + 2 * row * stride; }
};

/// Elements of one body, with the nine rows of B of each: ElementArrays::by_mode.
struct InElements {
  using Number = double;
  using Lanes = Vec;
  static constexpr Index kSpread = kWidth, kTangentSpread = kLanes;
  static Vec factor(const double* B, Index /*stride*/, Index k, Index column) {
    return load(B + (9 * column + k) * kLanes);
  }
};

/// product [9 x kBlock x kSpread] = D B of one element of each lane, `columns` columns of B. As many rows at once as
/// the registers hold: each number of B is read once for them.
template <class In, Index columns, Index first = 0>
inline void lanes_tangent_product(const typename In::Number* tangent, const typename In::Number* B, Index stride,
                                  typename In::Number* product) {
  using Lanes = typename In::Lanes;
  constexpr Index kRows = kWidth == 8 && first + 2 <= 9 ? 2 : 1;
  Lanes D[kRows][9];
#pragma GCC unroll 2
  for (Index i = 0; i < kRows; ++i)
#pragma GCC unroll 9
    for (Index k = 0; k < 9; ++k) D[i][k] = load(tangent + triangle_entry<9>(first + i, k) * In::kTangentSpread);
#pragma GCC unroll 4
  for (Index c = 0; c < columns; ++c) {
    Lanes sums[kRows];
#pragma GCC unroll 9
    for (Index k = 0; k < 9; ++k) {
      const auto factor = In::factor(B, stride, k, c);
#pragma GCC unroll 2
      for (Index i = 0; i < kRows; ++i) sums[i] = k == 0 ? D[i][k] * factor : sums[i] + D[i][k] * factor;
    }
#pragma GCC unroll 2
    for (Index i = 0; i < kRows; ++i) store(product + ((first + i) * kBlock + c) * In::kSpread, sums[i]);
  }
  if constexpr (first + kRows < 9) lanes_tangent_product<In, columns, first + kRows>(tangent, B, stride, product);
}

/// kBlockColumns columns, from `first` on, of a block of the stiffness += B^T (D B) over `depth` rows, or = where it
/// `begins`; only the first `count` rows of the block, of a diagonal one the lower triangle.
template <class In, bool diagonal, Index count, Index first>
inline void lanes_add_columns(const typename In::Number* B, Index stride, const typename In::Number* product,
                              Index depth, bool begins, typename In::Number* block) {
  using Lanes = typename In::Lanes;
  constexpr auto wanted = [](Index m, Index n) { return !diagonal || first + n <= m; };
  constexpr auto place = [](Index m, Index n) { return (m * kBlock + first + n) * In::kSpread; };
  Lanes sums[count][kBlockColumns] = {};
#pragma GCC unroll 4
  for (Index m = 0; m < count; ++m)
#pragma GCC unroll 4
    for (Index n = 0; n < kBlockColumns; ++n)
      if (wanted(m, n) && !begins) sums[m][n] = load(block + place(m, n));
  for (Index k = 0; k < depth; ++k) {
    Lanes right[kBlockColumns];
#pragma GCC unroll 4
    for (Index n = 0; n < kBlockColumns; ++n)
      if (wanted(count - 1, n)) right[n] = load(product + (k * kBlock + first + n) * In::kSpread);
#pragma GCC unroll 4
    for (Index m = 0; m < count; ++m) {
      const auto left = In::factor(B, stride, k, m);
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
inline void lanes_add_block(const typename In::Number* B, Index stride, const typename In::Number* product, Index depth,
                            bool begins, typename In::Number* block) {
  lanes_add_columns<In, diagonal, count, 0>(B, stride, product, depth, begins, block);
  if constexpr (kBlockColumns < kBlock && (!diagonal || count > kBlockColumns))
    lanes_add_columns<In, diagonal, count, kBlock - kBlockColumns>(B, stride, product, depth, begins, block);
}

constexpr Index kElementsAtOnce = 4;  // of each lane: their tangents, B and D B stay in the first-level cache

/// One column of blocks of the stiffness, see below: its first row of blocks has `columns` rows, the others kBlock but
/// for the last.
template <class In, Index columns>
inline void lanes_add_column(const typename In::Number* tangents, const typename In::Number* B, Index stride,
                             Index modes, Index elements, Index column, bool begins, typename In::Number* stiffness) {
  alignas(kAlignment) typename In::Number product[kElementsAtOnce * 9 * kBlock * In::kSpread];
  const Index depth = 9 * elements, whole = modes / kBlock;
  const auto block = [&](Index row) { return stiffness + block_start(row, column) / kLanes * In::kSpread; };
  const typename In::Number* const own = In::columns_from(B, kBlock * column);
  for (Index e = 0; e < elements; ++e)
    lanes_tangent_product<In, columns>(tangents + e * kTangentNumbers * In::kTangentSpread,
                                       In::rows_from(own, stride, 9 * e), stride,
                                       product + e * 9 * kBlock * In::kSpread);
  lanes_add_block<In, true, columns>(own, stride, product, depth, begins, block(column));
  for (Index row = column + 1; row < whole; ++row)
    lanes_add_block<In, false, kBlock>(In::columns_from(B, kBlock * row), stride, product, depth, begins, block(row));
  if (column >= whole) return;
  const typename In::Number* const last = In::columns_from(B, kBlock * whole);
  if (modes % kBlock == 1) lanes_add_block<In, false, 1>(last, stride, product, depth, begins, block(whole));
  if (modes % kBlock == 2) lanes_add_block<In, false, 2>(last, stride, product, depth, begins, block(whole));
  if (modes % kBlock == 3) lanes_add_block<In, false, 3>(last, stride, product, depth, begins, block(whole));
}

/// Stiffness += B^T (D B) of so many elements of each lane, or = where it `begins`.
template <class In>
inline void lanes_add_stiffness(const typename In::Number* tangents, const typename In::Number* B, Index stride,
                                Index modes, Index elements, bool begins, typename In::Number* stiffness) {
  const Index whole = modes / kBlock;
  for (Index column = 0; column < whole; ++column)
    lanes_add_column<In, kBlock>(tangents, B, stride, modes, elements, column, begins, stiffness);
  if (modes % kBlock == 1) lanes_add_column<In, 1>(tangents, B, stride, modes, elements, whole, begins, stiffness);
  if (modes % kBlock == 2) lanes_add_column<In, 2>(tangents, B, stride, modes, elements, whole, begins, stiffness);
  if (modes % kBlock == 3) lanes_add_column<In, 3>(tangents, B, stride, modes, elements, whole, begins, stiffness);
}

// --- of one body -----------------------------------------------------------------------------------------------------

/// [a_0 + a_g, ..., b_0 + b_g, ...] in each run of 2 g numbers, g of a and as many of b.
template <Index group, Index... i>
inline Vec add_groups(Vec a, Vec b, std::integer_sequence<Index, i...> /*lanes*/) {
  constexpr auto place = [](Index lane, Index shift) {
    const Index in_run = lane % (2 * group);
    return lane - in_run + in_run % group + (in_run < group ? 0 : kWidth) + shift;
  };
  return __builtin_shufflevector(a, b, place(i, 0)...) + __builtin_shufflevector(a, b, place(i, group)...);
}

/// The sums of kWidth registers, each over its lanes, in order; of `count` of them in each run of `count` lanes.
template <Index count = kWidth>
inline Vec sums_of_lanes(const Vec* registers) {
  if constexpr (count == 1) {
    return *registers;
  } else {
    constexpr Index kHalf = count / 2;
    return add_groups<kHalf>(sums_of_lanes<kHalf>(registers), sums_of_lanes<kHalf>(registers + kHalf),
                             std::make_integer_sequence<Index, kWidth>());
  }
}

constexpr Index kElementRows = kWidth == 8 ? 4 : 2;  // of a block, what the registers hold at once

/// Rows `first` to first + kElementRows - 1 of a block [kBlock x kBlock] of the stiffness += B^T (D B), summed over the
/// elements of the lanes; B from its first column of the block's rows on, product [9 x kBlock] of its columns. Only the
/// first `count` rows of the block; of a diagonal one the lower triangle, whatever is above.
template <bool diagonal, Index count, Index first>
inline void add_element_rows(const double* B, const double* product, double* block) {
  constexpr auto wanted = [](Index m, Index n) { return first + m < count && (!diagonal || n <= first + m); };
  constexpr auto read = [wanted](Index n) {
    bool found = false;
    for (Index m = 0; m < kElementRows; ++m) found = found || wanted(m, n);
    return found;
  };
  Vec sums[kElementRows * kBlock] = {};
  for (Index k = 0; k < 9; ++k, product += kBlock * kWidth) {
    Vec right[kBlock];
#pragma GCC unroll 4
    for (Index n = 0; n < kBlock; ++n)
      if (read(n)) right[n] = load(product + n * kWidth);
#pragma GCC unroll 4
    for (Index m = 0; m < kElementRows; ++m) {
      if (!wanted(m, 0)) continue;
      const Vec left = InElements::factor(B, 0, k, first + m);
#pragma GCC unroll 4
      for (Index n = 0; n < kBlock; ++n)
        if (wanted(m, n)) sums[m * kBlock + n] += right[n] * left;
    }
  }
#pragma GCC unroll 4
  for (Index i = 0; i < kElementRows * kBlock; i += kWidth) add_to(block + first * kBlock + i, sums_of_lanes(sums + i));
}

template <bool diagonal, Index count>
inline void add_element_block(const double* B, const double* product, double* block) {
  add_element_rows<diagonal, count, 0>(B, product, block);
  if constexpr (kElementRows < count) add_element_rows<diagonal, count, kBlock - kElementRows>(B, product, block);
}

/// Adds the last row of blocks, which has fewer rows than a block.
template <bool diagonal>
inline void add_last_element_block(Index count, const double* B, const double* product, double* block) {
  if (count == 1) add_element_block<diagonal, 1>(B, product, block);
  if (count == 2) add_element_block<diagonal, 2>(B, product, block);
  if (count == 3) add_element_block<diagonal, 3>(B, product, block);
}

/// Blocks [kBlock x kBlock] of the stiffness, by columns of blocks, += those of a panel's elements.
inline void add_panel_stiffness(const ElementArrays& elements, Index panel, const double* tangents, double* stiffness) {
  alignas(kAlignment) double product[9 * kBlock * kWidth];
  const Index modes = elements.modes, whole = modes / kBlock * kBlock, left = modes - whole;
  for (Index at = 0; at < kLanes; at += kWidth) {
    const double* const B = elements.by_mode + panel * modes * 9 * kLanes + at;
    const double* const last = B + 9 * whole * kLanes;
    double* block = stiffness;
    for (Index column = 0; column < whole; column += kBlock) {
      const double* own = B + 9 * column * kLanes;
      lanes_tangent_product<InElements, kBlock>(tangents + at, own, 0, product);
      add_element_block<true, kBlock>(own, product, block);
      block += kBlock * kBlock;
      for (Index row = column + kBlock; row < whole; row += kBlock, block += kBlock * kBlock) {
        own += 9 * kBlock * kLanes;
        add_element_block<false, kBlock>(own, product, block);
      }
      add_last_element_block<false>(left, last, product, block);
      if (left > 0) block += kBlock * kBlock;
    }
    if (left == 1) lanes_tangent_product<InElements, 1>(tangents + at, last, 0, product);
    if (left == 2) lanes_tangent_product<InElements, 2>(tangents + at, last, 0, product);
    if (left == 3) lanes_tangent_product<InElements, 3>(tangents + at, last, 0, product);
    add_last_element_block<true>(left, last, product, block);
  }
}

/// From those blocks into a lower triangle by columns.
inline void copy_blocks(const double* blocks, Index modes, double* stiffness, Index outer) {
  for (Index column = 0; column < modes; column += kBlock)
    for (Index row = column; row < modes; row += kBlock, blocks += kBlock * kBlock)
      for (Index n = 0; n < kBlock && column + n < modes; ++n)
        for (Index m = row == column ? n : 0; m < kBlock && row + m < modes; ++m)
          stiffness[(column + n) * outer + row + m] = blocks[m * kBlock + n];
}
