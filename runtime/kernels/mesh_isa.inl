// Elements of a whole mesh, for kernels_isa.inl, which includes this file. A vertex is a register of four numbers, so
// gathers and scatters need no shuffles but where four elements change into lanes of a law.

// A vertex of doubles, and a group of such.
#if EXMAT_SIMD_WIDTH == 2
/// Two registers: GCC keeps vectors that are wider than its registers in memory.
struct Quad {
  Vec low, high;

  double operator[](Index i) const { return i < 2 ? low[i] : high[i - 2]; }
  Quad& operator+=(Quad other) { return *this = *this + other; }
  Quad& operator-=(Quad other) { return *this = {low - other.low, high - other.high}; }
  Quad& operator*=(double factor) { return *this = *this * factor; }
  friend Quad operator+(Quad a, Quad b) { return {a.low + b.low, a.high + b.high}; }
  friend Quad operator*(Quad a, Quad b) { return {a.low * b.low, a.high * b.high}; }
  friend Quad operator*(Quad a, double factor) { return {a.low * factor, a.high * factor}; }
  friend Quad operator*(double factor, Quad a) { return a * factor; }
};
inline Quad load_quad(const double* p) { return {load(p), load(p + 2)}; }
inline void store_quad(double* p, Quad v) {
  store(p, v.low);
  store(p + 2, v.high);
}
template <Index c>
inline Quad repeat_number(Quad v) {
  const Vec half = c < 2 ? v.low : v.high, number = __builtin_shufflevector(half, half, c % 2, c % 2);
  return {number, number};
}
inline void transpose(Quad* rows) {
  const auto even = [](Vec a, Vec b) { return __builtin_shufflevector(a, b, 0, 2); };
  const auto odd = [](Vec a, Vec b) { return __builtin_shufflevector(a, b, 1, 3); };
  const Quad a = rows[0], b = rows[1], c = rows[2], d = rows[3];
  rows[0] = {even(a.low, b.low), even(c.low, d.low)};
  rows[1] = {odd(a.low, b.low), odd(c.low, d.low)};
  rows[2] = {even(a.high, b.high), even(c.high, d.high)};
  rows[3] = {odd(a.high, b.high), odd(c.high, d.high)};
}
using DoubleGroup = Quad;
inline DoubleGroup load_group(const double* p) { return load_quad(p); }
inline void store_group(double* p, DoubleGroup v) { store_quad(p, v); }
#else
using Quad = double __attribute__((vector_size(4 * sizeof(double))));
using StoredQuad = Quad __attribute__((may_alias, aligned(alignof(double))));
inline Quad load_quad(const double* p) { return *reinterpret_cast<const StoredQuad*>(p); }
inline void store_quad(double* p, Quad v) { *reinterpret_cast<StoredQuad*>(p) = v; }
using DoubleGroup = Vec;
inline DoubleGroup load_group(const double* p) { return load(p); }
inline void store_group(double* p, DoubleGroup v) { store(p, v); }
#endif
using FloatQuad = float __attribute__((vector_size(4 * sizeof(float))));
using StoredFloatQuad = FloatQuad __attribute__((may_alias, aligned(alignof(float))));
inline FloatQuad load_quad(const float* p) { return *reinterpret_cast<const StoredFloatQuad*>(p); }
inline void store_quad(float* p, FloatQuad v) { *reinterpret_cast<StoredFloatQuad*>(p) = v; }

template <class Number>
using QuadOf = decltype(load_quad(static_cast<const Number*>(nullptr)));

/// A group: as many vertices as a register holds, at least one.
using FloatGroup = FloatVec;
inline FloatGroup load_group(const float* p) { return load(p); }
inline void store_group(float* p, FloatGroup v) { store(p, v); }

template <class Number>
using GroupOf = decltype(load_group(static_cast<const Number*>(nullptr)));
template <class Group>
constexpr Index kVertices = sizeof(Group) / sizeof(decltype(Group{}[0])) / 4;

/// The number c of each vertex in its four.
template <Index c, class Group>
inline Group repeat_number(Group v) {
  if constexpr (kVertices<Group> == 4)
    return __builtin_shufflevector(v, v, c, c, c, c, 4 + c, 4 + c, 4 + c, 4 + c, 8 + c, 8 + c, 8 + c, 8 + c, 12 + c,
                                   12 + c, 12 + c, 12 + c);
  else if constexpr (kVertices<Group> == 2)
    return __builtin_shufflevector(v, v, c, c, c, c, 4 + c, 4 + c, 4 + c, 4 + c);
  else
    return __builtin_shufflevector(v, v, c, c, c, c);
}

/// The vertices at places i and j of a, then those of b; in groups of four.
template <Index i, Index j, class Group>
inline Group choose_vertices(Group a, Group b) {
  constexpr Index k = 4 * i, l = 4 * j;
  return __builtin_shufflevector(a, b, k, k + 1, k + 2, k + 3, l, l + 1, l + 2, l + 3, 16 + k, 17 + k, 18 + k, 19 + k,
                                 16 + l, 17 + l, 18 + l, 19 + l);
}

/// Vertex i of a, then vertex i of b; in groups of two.
template <Index i, class Group>
inline Group pair_vertices(Group a, Group b) {
  constexpr Index k = 4 * i;
  return __builtin_shufflevector(a, b, k, k + 1, k + 2, k + 3, 8 + k, 9 + k, 10 + k, 11 + k);
}

/// Vertex i of four, in all places of a group.
template <Index i, class Group>
inline Group repeat_vertex(const Group* v) {
  if constexpr (kVertices<Group> == 4)
    return choose_vertices<i, i>(v[0], v[0]);
  else if constexpr (kVertices<Group> == 2)
    return pair_vertices<i % 2>(v[i / 2], v[i / 2]);
  else
    return v[i];
}

/// Adds up the vertices of each of four fields of groups: four sums, each a vertex.
template <class Group>
inline void add_vertices(const Group* v, Group* sums) {
  if constexpr (kVertices<Group> == 4) {
    const Group a = choose_vertices<0, 1>(v[0], v[1]) + choose_vertices<2, 3>(v[0], v[1]),
                b = choose_vertices<0, 1>(v[2], v[3]) + choose_vertices<2, 3>(v[2], v[3]);
    sums[0] = choose_vertices<0, 2>(a, b) + choose_vertices<1, 3>(a, b);
  } else if constexpr (kVertices<Group> == 2) {
    sums[0] = pair_vertices<0>(v[0], v[1]) + pair_vertices<1>(v[0], v[1]);
    sums[1] = pair_vertices<0>(v[2], v[3]) + pair_vertices<1>(v[2], v[3]);
  } else {
    for (Index i = 0; i < 4; ++i) sums[i] = v[i];
  }
}

template <class Four>
inline void transpose(Four* rows) {
  const Four a = __builtin_shufflevector(rows[0], rows[1], 0, 4, 2, 6),
             b = __builtin_shufflevector(rows[0], rows[1], 1, 5, 3, 7),
             c = __builtin_shufflevector(rows[2], rows[3], 0, 4, 2, 6),
             d = __builtin_shufflevector(rows[2], rows[3], 1, 5, 3, 7);
  rows[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
  rows[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
  rows[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
  rows[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

/// Transposes the 4 x 4 numbers of each place of four groups.
template <class Group>
inline void transpose_numbers(Group* rows) {
  if constexpr (kVertices<Group> == 4) {
    const auto low = [](Group a, Group b) {
      return __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
    };
    const auto high = [](Group a, Group b) {
      return __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
    };
    const auto first = [](Group a, Group b) {
      return __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29);
    };
    const auto second = [](Group a, Group b) {
      return __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31);
    };
    const Group a = low(rows[0], rows[1]), b = high(rows[0], rows[1]), c = low(rows[2], rows[3]),
                d = high(rows[2], rows[3]);
    rows[0] = first(a, c);
    rows[1] = second(a, c);
    rows[2] = first(b, d);
    rows[3] = second(b, d);
  } else if constexpr (kVertices<Group> == 2) {
    const auto low = [](Group a, Group b) { return __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13); };
    const auto high = [](Group a, Group b) { return __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15); };
    const auto first = [](Group a, Group b) { return __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13); };
    const auto second = [](Group a, Group b) { return __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15); };
    const Group a = low(rows[0], rows[1]), b = high(rows[0], rows[1]), c = low(rows[2], rows[3]),
                d = high(rows[2], rows[3]);
    rows[0] = first(a, c);
    rows[1] = second(a, c);
    rows[2] = first(b, d);
    rows[3] = second(b, d);
  } else {
    transpose(rows);
  }
}

/// Transposes the vertices of as many groups as each has places.
template <class Group>
inline void transpose_vertices(Group* rows) {
  if constexpr (kVertices<Group> == 4) {
    const Group a = choose_vertices<0, 1>(rows[0], rows[1]), b = choose_vertices<2, 3>(rows[0], rows[1]),
                c = choose_vertices<0, 1>(rows[2], rows[3]), d = choose_vertices<2, 3>(rows[2], rows[3]);
    rows[0] = choose_vertices<0, 2>(a, c);
    rows[1] = choose_vertices<1, 3>(a, c);
    rows[2] = choose_vertices<0, 2>(b, d);
    rows[3] = choose_vertices<1, 3>(b, d);
  } else if constexpr (kVertices<Group> == 2) {
    const Group a = pair_vertices<0>(rows[0], rows[1]);
    rows[1] = pair_vertices<1>(rows[0], rows[1]);
    rows[0] = a;
  }
}

// The three columns of an element's 3 x 3 numbers stand side by side as vertices do: a line of kMeshLine numbers, of
// which a register holds one group.

template <class Group>
constexpr Index kLineGroups = (3 + kVertices<Group> - 1) / kVertices<Group>;

// A vertex in all places of a group: repeat(). Numbers of a gradient, of which four are read, each in the four of the
// column that it belongs to: spread(); the number itself where a group is one vertex. Compilers make wider registers of
// narrow ones by memory, if left alone.

#if EXMAT_SIMD_WIDTH == 8
inline FloatGroup repeat(const float* p) { return _mm512_maskz_broadcast_f32x4(0xffff, _mm_loadu_ps(p)); }
inline DoubleGroup repeat(const double* p) { return _mm512_maskz_broadcast_f64x4(0xff, _mm256_loadu_pd(p)); }
template <Index part>
inline FloatGroup spread(const float* gradient) {
  const __m512i places = _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
  return _mm512_maskz_permutevar_ps(0xffff, repeat(gradient), places);
}
template <Index part>
inline DoubleGroup spread(const double* gradient) {
  constexpr Index a = 2 * part, b = a + 1;
  return _mm512_maskz_permutexvar_pd(0xff, _mm512_set_epi64(b, b, b, b, a, a, a, a), repeat(gradient));
}
#elif EXMAT_SIMD_WIDTH == 4
inline FloatGroup repeat(const float* p) { return _mm256_broadcast_ps(reinterpret_cast<const __m128*>(p)); }
inline DoubleGroup repeat(const double* p) { return load_quad(p); }
template <Index part>
inline FloatGroup spread(const float* gradient) {
  constexpr int a = 2 * part, b = a + 1;
  return _mm256_permutevar_ps(repeat(gradient), _mm256_set_epi32(b, b, b, b, a, a, a, a));
}
template <Index part>
inline double spread(const double* gradient) {
  return gradient[part];
}
#else
inline FloatGroup repeat(const float* p) { return load_quad(p); }
inline DoubleGroup repeat(const double* p) { return load_quad(p); }
template <Index part, class Number>
inline Number spread(const Number* gradient) {
  return gradient[part];
}
#endif

inline const double* gradients_of(const MeshArrays& mesh, double) { return mesh.gradients; }
inline const float* gradients_of(const MeshArrays& mesh, float) { return mesh.rounded_gradients; }
inline const double* gradients_around(const MeshArrays& mesh, double) { return mesh.gradients_around; }
inline const float* gradients_around(const MeshArrays& mesh, float) { return mesh.rounded_gradients_around; }

/// Displacement gradients of elements in lines, by groups, to H [9 x lanes].
template <Index lanes, class Number, class Group>
inline void lines_to_lanes(const Group (*lines)[kLineGroups<Group>], Number* H) {
  constexpr Index count = kVertices<Group>;
#pragma GCC unroll 4
  for (Index begin = 0; begin < lanes; begin += 4 * count)
#pragma GCC unroll 3
    for (Index part = 0; part < kLineGroups<Group>; ++part) {
      Group turned[count][4];
#pragma GCC unroll 4
      for (Index group = 0; group < count; ++group) {
#pragma GCC unroll 4
        for (Index i = 0; i < 4; ++i) turned[group][i] = lines[begin + 4 * group + i][part];
        transpose_numbers(turned[group]);
      }
#pragma GCC unroll 3
      for (Index a = 0; a < 3; ++a) {
        Group across[count];
#pragma GCC unroll 4
        for (Index group = 0; group < count; ++group) across[group] = turned[group][a];
        transpose_vertices(across);
#pragma GCC unroll 4
        for (Index i = 0; i < count; ++i)
          if (part * count + i < 3) store_group(H + (3 * a + part * count + i) * lanes + begin, across[i]);
      }
    }
}

/// Stresses P [9 x lanes] of elements to their lines.
template <Index lanes, class Number>
inline void lanes_to_lines(const Number* P, Number* lines) {
  using Group = GroupOf<Number>;
  constexpr Index count = kVertices<Group>;
#pragma GCC unroll 4
  for (Index begin = 0; begin < lanes; begin += 4 * count)
#pragma GCC unroll 3
    for (Index part = 0; part < kLineGroups<Group>; ++part) {
      Group turned[count][4] = {};
#pragma GCC unroll 3
      for (Index a = 0; a < 3; ++a) {
        Group across[count] = {};
#pragma GCC unroll 4
        for (Index i = 0; i < count; ++i)
          if (part * count + i < 3) across[i] = load_group(P + (3 * a + part * count + i) * lanes + begin);
        transpose_vertices(across);
#pragma GCC unroll 4
        for (Index group = 0; group < count; ++group) turned[group][a] = across[group];
      }
#pragma GCC unroll 4
      for (Index group = 0; group < count; ++group) {
        transpose_numbers(turned[group]);
#pragma GCC unroll 4
        for (Index i = 0; i < 4; ++i)
          store_group(lines + (begin + 4 * group + i) * kMeshLine + part * 4 * count, turned[group][i]);
      }
    }
}

/// Lists of kMeshGroup that are gone through at once: as many as have sums in registers.
template <class Group, Index fields>
constexpr Index kTogether = std::clamp<Index>(2 * kWidth * Index(sizeof(Vec)) /
                                                  (fields * kLineGroups<Group> * Index(sizeof(Group))),
                                              1, kMeshGroup);

/// H [9 x lanes] of the elements from `first` on, of each of some fields of vertices.
template <Index lanes, Index fields, class Number>
inline void gather_gradients(const MeshArrays& mesh, Index first, const Number* const* of, Number* const* H) {
  using Group = GroupOf<Number>;
  constexpr Index together = kTogether<Group, fields>;
  Group lines[fields][lanes][kLineGroups<Group>];
  for (Index lane = 0; lane < lanes; lane += together) {
    Group sums[fields][together][kLineGroups<Group>] = {};
    const Index list = (first + lane) / kMeshGroup, end = mesh.starts[list + 1];
    const Index begin = mesh.starts[list] * kMeshGroup + lane % kMeshGroup;
    const int* corner = mesh.corners + begin;
    const Number* gradient = gradients_of(mesh, Number{}) + 3 * begin;
    for (Index k = mesh.starts[list]; k < end; ++k, corner += kMeshGroup, gradient += 3 * kMeshGroup)
#pragma GCC unroll 4
      for (Index i = 0; i < together; ++i)
#pragma GCC unroll 2
        for (Index field = 0; field < fields; ++field) {
          const Group x = repeat(of[field] + 4 * Index(corner[i]));
          Group* const own = sums[field][i];
          own[0] += spread<0>(gradient + 3 * i) * x;
          if constexpr (kLineGroups < Group >> 1) own[1] += spread<1>(gradient + 3 * i) * x;
          if constexpr (kLineGroups < Group >> 2) own[2] += spread<2>(gradient + 3 * i) * x;
        }
#pragma GCC unroll 2
    for (Index field = 0; field < fields; ++field)
#pragma GCC unroll 4
      for (Index i = 0; i < together; ++i)
#pragma GCC unroll 3
        for (Index part = 0; part < kLineGroups<Group>; ++part) lines[field][lane + i][part] = sums[field][i][part];
  }
#pragma GCC unroll 2
  for (Index field = 0; field < fields; ++field) lines_to_lanes<lanes>(lines[field], H[field]);
}

/// The sum of the three columns of a line.
template <class Number, class Group>
inline QuadOf<Number> add_columns(const Group* line) {
  if constexpr (kVertices<Group> == 4)
    return (__builtin_shufflevector(line[0], line[0], 0, 1, 2, 3) +
            __builtin_shufflevector(line[0], line[0], 4, 5, 6, 7)) +
           __builtin_shufflevector(line[0], line[0], 8, 9, 10, 11);
  else if constexpr (kVertices<Group> == 2)
    return (__builtin_shufflevector(line[0], line[0], 0, 1, 2, 3) +
            __builtin_shufflevector(line[0], line[0], 4, 5, 6, 7)) +
           __builtin_shufflevector(line[1], line[1], 0, 1, 2, 3);
  else
    return (line[0] + line[1]) + line[2];
}

/// Calls use(row, sum of P b over the elements about its vertex) for all rows, P in lines.
template <class Number, class Use>
inline void gather_stresses(const MeshArrays& mesh, const Number* lines, const Use& use) {
  using Group = GroupOf<Number>;
  constexpr Index numbers = 4 * kVertices<Group>, together = kTogether<Group, 1>;
  for (Index row = 0; row < mesh.vertices; row += together) {
    Group sums[together][kLineGroups<Group>] = {};
    const Index list = row / kMeshGroup, end = mesh.around_starts[list + 1];
    const Index begin = mesh.around_starts[list] * kMeshGroup + row % kMeshGroup;
    const int* element = mesh.around + begin;
    const Number* gradient = gradients_around(mesh, Number{}) + 3 * begin;
    for (Index k = mesh.around_starts[list]; k < end; ++k, element += kMeshGroup, gradient += 3 * kMeshGroup)
#pragma GCC unroll 4
      for (Index i = 0; i < together; ++i) {
        const Number* line = lines + kMeshLine * Index(element[i]);
        sums[i][0] += spread<0>(gradient + 3 * i) * load_group(line);
        if constexpr (kLineGroups < Group >> 1) sums[i][1] += spread<1>(gradient + 3 * i) * load_group(line + numbers);
        if constexpr (kLineGroups < Group >> 2)
          sums[i][2] += spread<2>(gradient + 3 * i) * load_group(line + 2 * numbers);
      }
#pragma GCC unroll 4
    for (Index i = 0; i < together; ++i)
      if (row + i < mesh.vertices) use(row + i, add_columns<Number>(sums[i]));
  }
}

/// image [9] = T x, T the upper triangle by rows of a symmetric 9 x 9, its numbers `stride` apart.
template <class Lanes, class Number>
inline void tangent_product(const Number* tangent, Index stride, const Lanes* x, Lanes* image) {
  for (Index i = 0; i < 9; ++i) image[i] = Lanes{};
  Index entry = 0;
#pragma GCC unroll 9
  for (Index i = 0; i < 9; ++i) {
    image[i] += load(tangent + entry++ * stride) * x[i];
#pragma GCC unroll 9
    for (Index j = i + 1; j < 9; ++j, ++entry) {
      const Lanes value = load(tangent + entry * stride);
      image[i] += value * x[j];
      image[j] += value * x[i];
    }
  }
}

inline void store_rounded(float* p, Vec v) {
  using Half = float __attribute__((vector_size(kWidth * sizeof(float))));
  using StoredHalf = Half __attribute__((may_alias, aligned(alignof(float))));
  *reinterpret_cast<StoredHalf*>(p) = __builtin_convertvector(v, Half);
}

void mesh_inertia(const MeshArrays& mesh, const MeshInertia& terms, double* inertia_force, double* force,
                  double* sums) {
  Quad inertia{}, damping{}, spread{};
  for (Index i = 0; i < mesh.vertices; ++i) {
    const Index row = mesh.rows[i], end = mesh.row_starts[i + 1];
    Quad Ma{}, Mw{}, Lx{}, Lw{};
    for (Index k = mesh.row_starts[i]; k < end; ++k) {
      const Index column = 4 * mesh.columns[k];
      const double mass = mesh.mass[k], variance = mesh.variance_matrix[k];
      const Quad w = load_quad(terms.rate + column);
      Ma += load_quad(terms.offset + column) * mass;
      Mw += w * mass;
      Lx += load_quad(terms.displacement + column) * variance;
      Lw += w * variance;
    }
    Ma *= terms.acceleration_factor;
    const Quad damped = Mw * terms.mass_damping + Lw * terms.stiffness_damping;
    store_quad(inertia_force + 4 * row, Ma);
    store_quad(force + 4 * row, damped + Lx);
    inertia += Ma * load_quad(terms.offset + 4 * row);
    damping += damped * load_quad(terms.rate + 4 * row);
    spread += Lx * load_quad(terms.displacement + 4 * row);
  }
  const auto add_up = [](Quad v) { return (v[0] + v[1]) + v[2]; };
  sums[0] = 0.5 * add_up(inertia);
  sums[1] = 0.5 * add_up(damping);
  sums[2] = 0.5 * add_up(spread);
  sums[3] = 0;
}

/// As mesh_force() and mesh_force_and_tangents().
template <Want want, class Law>
inline void evaluate_mesh(const MeshArrays& mesh, const ElementLaw& law, const ElementLaw* example,
                          const MeshInertia& terms, bool freeze, double* frozen, float* tangents, double* lines,
                          double* force, double* sums) {
  alignas(kAlignment) double H[9 * kLanes], rates[9 * kLanes], P[9 * kLanes], tangent[kTangentNumbers * kLanes];
  alignas(kAlignment) double example_tangent[want == Want::kStiffness ? kTangentNumbers * kLanes : kLanes];
  const bool damped = terms.stiffness_damping > 0;
  Vec elastic = zero(), damping = zero(), pulled = zero();
  for (Index first = 0; first < mesh.panels * kMeshLanes; first += kLanes) {
    double* const own_frozen = damped ? frozen + first * kTangentNumbers : nullptr;
    const double* const fields[] = {terms.displacement, terms.rate};
    double* const gradients[] = {H, rates};
    if (damped)
      gather_gradients<kLanes, 2>(mesh, first, fields, gradients);
    else
      gather_gradients<kLanes, 1>(mesh, first, fields, gradients);
    for (Index lane = 0; lane < kLanes; lane += kWidth) {
      Vec h[9], p[9];
      for (Index i = 0; i < 9; ++i) h[i] = load(H + i * kLanes + lane);
      elastic += evaluate_law<want, Law>(law, first + lane, h, p, tangent + lane);
      const Vec variance = load(mesh.variance + first + lane);
      elastic -= 0.5 * variance * dot(h, h, 9);
      for (Index i = 0; i < 9; ++i) p[i] -= variance * h[i];
      if constexpr (want == Want::kStiffness) {
        for (Index i = 0; i < 9; ++i) add_to(tangent + triangle_entry<9>(i, i) * kLanes + lane, -variance);
        if (damped && freeze)
          for (Index k = 0; k < kTangentNumbers; ++k)
            store(own_frozen + k * kLanes + lane, load(tangent + k * kLanes + lane));
      }
      if (damped) {
        Vec w[9], image[9];
        for (Index i = 0; i < 9; ++i) w[i] = load(rates + i * kLanes + lane);
        tangent_product(own_frozen + lane, kLanes, w, image);
        for (Index i = 0; i < 9; ++i) {
          image[i] *= terms.stiffness_damping;
          p[i] += image[i];
        }
        damping += dot(w, image, 9);
      }
      if (example != nullptr) {
        Vec pull[9];
        pulled += evaluate_law<want, Law>(*example, first + lane, h, pull, example_tangent + lane);
        for (Index i = 0; i < 9; ++i) p[i] += pull[i];
        if constexpr (want == Want::kStiffness)
          for (Index k = 0; k < kTangentNumbers; ++k)
            add_to(tangent + k * kLanes + lane, load(example_tangent + k * kLanes + lane));
      }
      for (Index i = 0; i < 9; ++i) store(P + i * kLanes + lane, p[i]);
    }
    lanes_to_lines<kLanes>(P, lines + first * kMeshLine);
    if constexpr (want == Want::kStiffness) {
      float* const rounded = tangents + first / kMeshLanes * kTangentNumbers * kMeshLanes + first % kMeshLanes;
      const double share = damped ? terms.stiffness_damping : 0;
      const double* const other = damped ? own_frozen : tangent;
      for (Index k = 0; k < kTangentNumbers; ++k)
        for (Index lane = 0; lane < kLanes; lane += kWidth)
          store_rounded(rounded + k * kMeshLanes + lane,
                        load(tangent + k * kLanes + lane) + share * load(other + k * kLanes + lane));
    }
  }
  gather_stresses(mesh, lines, [&](Index row, Quad own) {
    double* const at = force + 4 * mesh.rows[row];
    store_quad(at, load_quad(at) + own);
  });
  sums[1] += 0.5 * sum(damping);
  sums[2] += sum(elastic);
  sums[3] += sum(pulled);
}

void mesh_force(const MeshArrays& mesh, const ElementLaw& law, const ElementLaw* example, const MeshInertia& terms,
                const double* frozen, double* lines, double* force, double* sums) {
  with_law(law, [&]<class Law>() {
    evaluate_mesh<Want::kForce, Law>(mesh, law, example, terms, false, const_cast<double*>(frozen), nullptr, lines,
                                     force, sums);
  });
}

void mesh_force_and_tangents(const MeshArrays& mesh, const ElementLaw& law, const ElementLaw* example,
                             const MeshInertia& terms, bool freeze, double* frozen, float* tangents, double* lines,
                             double* force, double* sums) {
  with_law(law, [&]<class Law>() {
    evaluate_mesh<Want::kStiffness, Law>(mesh, law, example, terms, freeze, frozen, tangents, lines, force, sums);
  });
}

void mesh_product(const MeshArrays& mesh, const float* matrix, const float* tangents, const float* x, float* lines,
                  float* product) {
  constexpr Index kFloats = 2 * kWidth;
  alignas(kAlignment) float H[9 * kMeshLanes];
  float* const gradients = H;
  for (Index panel = 0; panel < mesh.panels; ++panel) {
    gather_gradients<kMeshLanes, 1>(mesh, panel * kMeshLanes, &x, &gradients);
    for (Index lane = 0; lane < kMeshLanes; lane += kFloats) {
      FloatVec h[9], image[9];
      for (Index i = 0; i < 9; ++i) h[i] = load(H + i * kMeshLanes + lane);
      tangent_product(tangents + panel * kTangentNumbers * kMeshLanes + lane, kMeshLanes, h, image);
      for (Index i = 0; i < 9; ++i) store(H + i * kMeshLanes + lane, image[i]);
    }
    lanes_to_lines<kMeshLanes>(H, lines + panel * kMeshLanes * kMeshLine);
  }
  gather_stresses(mesh, lines, [&](Index row, FloatQuad stresses) {
    FloatQuad even{}, odd{};
    const Index end = mesh.row_starts[row + 1];
    Index k = mesh.row_starts[row];
    for (; k + 1 < end; k += 2) {
      even += load_quad(x + 4 * mesh.columns[k]) * matrix[k];
      odd += load_quad(x + 4 * mesh.columns[k + 1]) * matrix[k + 1];
    }
    if (k < end) even += load_quad(x + 4 * mesh.columns[k]) * matrix[k];
    store_quad(product + 4 * mesh.rows[row], (even + odd) + stresses);
  });
}

// Blocks of kFactorBlock x kFactorBlock numbers, by rows: groups of rows.

template <class Group>
constexpr Index kRowGroups = kFactorBlock / kVertices<Group>;
constexpr Index kFactorNumbers = 4 * kFactorBlock;

template <class Number, class Group>
inline void load_block(const Number* from, Group* block) {
  for (Index part = 0; part < kRowGroups<Group>; ++part) block[part] = load_group(from + part * 4 * kVertices<Group>);
}
template <class Number, class Group>
inline void store_block(Number* to, const Group* block) {
  for (Index part = 0; part < kRowGroups<Group>; ++part) store_group(to + part * 4 * kVertices<Group>, block[part]);
}

template <class Group>
inline void repeat_vertices(const Group* x, Group* repeated) {
  repeated[0] = repeat_vertex<0>(x);
  repeated[1] = repeat_vertex<1>(x);
  repeated[2] = repeat_vertex<2>(x);
  repeated[3] = repeat_vertex<3>(x);
}

/// image = B x, each vertex of x in all places of a group.
template <class Number, class Group>
inline void block_product(const Number* numbers, const Group* x, Group* image) {
  Group block[kRowGroups<Group>];
  load_block(numbers, block);
  for (Index part = 0; part < kRowGroups<Group>; ++part)
    image[part] = (repeat_number<0>(block[part]) * x[0] + repeat_number<1>(block[part]) * x[1]) +
                  (repeat_number<2>(block[part]) * x[2] + repeat_number<3>(block[part]) * x[3]);
}

/// add_vertices() of sums [4] += B^T x.
template <class Number, class Group>
inline void add_transposed_product(const Number* numbers, const Number* x, Group* sums) {
  Group block[kRowGroups<Group>], own[kRowGroups<Group>];
  load_block(numbers, block);
  load_block(x, own);
  for (Index part = 0; part < kRowGroups<Group>; ++part) {
    sums[0] += repeat_number<0>(block[part]) * own[part];
    sums[1] += repeat_number<1>(block[part]) * own[part];
    sums[2] += repeat_number<2>(block[part]) * own[part];
    sums[3] += repeat_number<3>(block[part]) * own[part];
  }
}

float mesh_solve_lower(const MeshFactor& factor, const float* right, float* x) {
  constexpr Index kGroups = kRowGroups<FloatGroup>;
  FloatGroup squares[kGroups] = {};
  std::memcpy(x, right, static_cast<std::size_t>(factor.blocks * kFactorNumbers) * sizeof(float));
  for (Index column = 0; column < factor.blocks; ++column) {
    FloatGroup own[kGroups], repeated[kFactorBlock], image[kGroups];
    load_block(x + column * kFactorNumbers, own);
    repeat_vertices(own, repeated);
    block_product(factor.diagonal + 2 * column * kFactorNumbers, repeated, own);
    store_block(x + column * kFactorNumbers, own);
    for (Index part = 0; part < kGroups; ++part) squares[part] += own[part] * own[part];
    repeat_vertices(own, repeated);
    for (Index k = factor.starts[column]; k < factor.starts[column + 1]; ++k) {
      float* const below = x + factor.rows[k] * kFactorNumbers;
      block_product(factor.values + k * kFactorNumbers, repeated, image);
      load_block(below, own);
      for (Index part = 0; part < kGroups; ++part) own[part] -= image[part];
      store_block(below, own);
    }
  }
  float total = 0;
  for (Index part = 0; part < kGroups; ++part)
    for (Index i = 0; i < 4 * kVertices<FloatGroup>; ++i) total += squares[part][i];
  return total;
}

void mesh_solve_upper(const MeshFactor& factor, float* x) {
  constexpr Index kGroups = kRowGroups<FloatGroup>;
  for (Index column = factor.blocks - 1; column >= 0; --column) {
    FloatGroup sums[4] = {}, image[kGroups], own[kGroups], repeated[kFactorBlock];
    for (Index k = factor.starts[column]; k < factor.starts[column + 1]; ++k)
      add_transposed_product(factor.values + k * kFactorNumbers, x + factor.rows[k] * kFactorNumbers, sums);
    add_vertices(sums, image);
    load_block(x + column * kFactorNumbers, own);
    for (Index part = 0; part < kGroups; ++part) own[part] -= image[part];
    repeat_vertices(own, repeated);
    block_product(factor.diagonal + (2 * column + 1) * kFactorNumbers, repeated, own);
    store_block(x + column * kFactorNumbers, own);
  }
}

/// Blocks of vertices of a field: its last one may have fewer than kFactorBlock and stands apart.
template <class Number>
class BlocksOf {
 public:
  BlocksOf(Number* field, Index vertices)
      : field_(field), whole_(vertices / kFactorBlock), left_(vertices % kFactorBlock) {
    for (Index i = 0; i < 4 * left_; ++i) last_[i] = field[whole_ * kFactorNumbers + i];
  }
  Number* at(Index block) { return block < whole_ ? field_ + block * kFactorNumbers : last_; }
  void take_back() {
    for (Index i = 0; i < 4 * left_; ++i) field_[whole_ * kFactorNumbers + i] = last_[i];
  }

 private:
  Number* field_;
  Index whole_, left_;
  alignas(kAlignment) Number last_[kFactorNumbers] = {};
};

template <class Number>
inline void coefficients_of(const MeshFilter<Number>& filter, const Number* field, Number* coefficients) {
  using Group = GroupOf<Number>;
  BlocksOf<Number> blocks(const_cast<Number*>(field), filter.vertices);
  for (Index column = 0; column < filter.blocks; ++column) {
    Group sums[4] = {}, own[kRowGroups<Group>];
    for (Index k = filter.starts[column]; k < filter.starts[column + 1]; ++k)
      add_transposed_product(filter.values + k * kFactorNumbers, blocks.at(filter.rows[k]), sums);
    add_vertices(sums, own);
    store_block(coefficients + column * kFactorNumbers, own);
  }
}

template <class Number>
inline void add_functions(const MeshFilter<Number>& filter, Number factor, const Number* coefficients, Number* field) {
  using Group = GroupOf<Number>;
  constexpr Index kGroups = kRowGroups<Group>;
  BlocksOf<Number> blocks(field, filter.vertices);
  for (Index column = 0; column < filter.blocks; ++column) {
    Group own[kGroups], repeated[kFactorBlock], image[kGroups];
    load_block(coefficients + column * kFactorNumbers, own);
    for (Index part = 0; part < kGroups; ++part) own[part] *= factor;
    repeat_vertices(own, repeated);
    for (Index k = filter.starts[column]; k < filter.starts[column + 1]; ++k) {
      Number* const at = blocks.at(filter.rows[k]);
      block_product(filter.values + k * kFactorNumbers, repeated, image);
      load_block(at, own);
      for (Index part = 0; part < kGroups; ++part) own[part] += image[part];
      store_block(at, own);
    }
  }
  blocks.take_back();
}

void mesh_coefficients(const MeshFilter<double>& filter, const double* field, double* coefficients) {
  coefficients_of(filter, field, coefficients);
}
void mesh_rounded_coefficients(const MeshFilter<float>& filter, const float* field, float* coefficients) {
  coefficients_of(filter, field, coefficients);
}
void mesh_add_functions(const MeshFilter<double>& filter, double factor, const double* coefficients, double* field) {
  add_functions(filter, factor, coefficients, field);
}
void mesh_add_rounded_functions(const MeshFilter<float>& filter, float factor, const float* coefficients,
                                float* field) {
  add_functions(filter, factor, coefficients, field);
}
