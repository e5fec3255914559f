// Rows of vertices for one instruction set; included by kernels_isa.inl.

/// The sums of all lanes of three vectors.
inline void lane_sums(Vec a, Vec b, Vec c, double* sums) {
#if EXMAT_SIMD_WIDTH == 2
  const Vec ab = __builtin_shufflevector(a, b, 0, 2) + __builtin_shufflevector(a, b, 1, 3);
  sums[0] = ab[0];
  sums[1] = ab[1];
  sums[2] = c[0] + c[1];
#elif EXMAT_SIMD_WIDTH == 4
  const Vec ab = __builtin_shufflevector(a, b, 0, 4, 2, 6) + __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Vec cc = c + __builtin_shufflevector(c, c, 1, 0, 3, 2);
  sums[0] = ab[0] + ab[2];
  sums[1] = ab[1] + ab[3];
  sums[2] = cc[0] + cc[2];
#else
  const Vec ab = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14) +
                 __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  const Vec cc = c + __builtin_shufflevector(c, c, 1, 0, 3, 2, 5, 4, 7, 6);
  const Vec abcc = __builtin_shufflevector(ab, cc, 0, 1, 8, 9, 4, 5, 12, 13) +
                   __builtin_shufflevector(ab, cc, 2, 3, 10, 11, 6, 7, 14, 15);
  sums[0] = abcc[0] + abcc[4];
  sums[1] = abcc[1] + abcc[5];
  sums[2] = abcc[2] + abcc[6];
#endif
}

/// kWidth numbers from `row` on of the three rows of a vertex, times those of `vector`.
inline Vec rows_sum(const double* row, Index stride, const double* vector) {
  return load(row) * vector[0] + load(row + stride) * vector[1] + load(row + 2 * stride) * vector[2];
}

void vertex_products(const double* rows, Index stride, const int* vertices, Index count, const double* x,
                     double* products) {
  for (Index i = 0; i < count; ++i) {
    const double* own = rows + 3 * stride * vertices[i];
    Vec first = zero(), second = zero(), third = zero();
    for (Index c = 0; c < stride; c += kWidth) {
      const Vec at = load(x + c);
      first += load(own + c) * at;
      second += load(own + stride + c) * at;
      third += load(own + 2 * stride + c) * at;
    }
    lane_sums(first, second, third, products + 3 * i);
  }
}

void add_vertex_loads(const double* rows, Index stride, const int* vertices, Index count, const double* vectors,
                      double* sums) {
  for (Index i = 0; i < count; ++i) {
    const double* own = rows + 3 * stride * vertices[i];
    for (Index c = 0; c < stride; c += kWidth)
      store(sums + c, load(sums + c) + rows_sum(own + c, stride, vectors + 3 * i));
  }
}

void vertex_loads(const double* rows, Index stride, const int* vertices, Index count, const double* vectors,
                  double* loads, Index outer) {
  for (Index i = 0; i < count; ++i) {
    const double* own = rows + 3 * stride * vertices[i];
    for (Index c = 0; c < stride; c += kWidth) store(loads + i * outer + c, rows_sum(own + c, stride, vectors + 3 * i));
  }
}

void add_squares(const double* factors, Index count, Index stride, double* squares) {
  half_product(factors, factors, stride, stride, count, squares);
}
