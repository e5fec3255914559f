// Elements of a whole mesh, for kernels_isa.inl, which includes this file. A vertex is a register of four numbers, so
// gathers and scatters need no shuffles but where four elements change into lanes of a law.

using Quad = double __attribute__((vector_size(4 * sizeof(double))));
using FloatQuad = float __attribute__((vector_size(4 * sizeof(float))));
using StoredQuad = Quad __attribute__((may_alias, aligned(alignof(double))));
using StoredFloatQuad = FloatQuad __attribute__((may_alias, aligned(alignof(float))));

inline Quad load_quad(const double* p) { return *reinterpret_cast<const StoredQuad*>(p); }
inline void store_quad(double* p, Quad v) { *reinterpret_cast<StoredQuad*>(p) = v; }
inline FloatQuad load_quad(const float* p) { return *reinterpret_cast<const StoredFloatQuad*>(p); }
inline void store_quad(float* p, FloatQuad v) { *reinterpret_cast<StoredFloatQuad*>(p) = v; }

template <class Number>
using QuadOf = decltype(load_quad(static_cast<const Number*>(nullptr)));

/// A group: as many vertices as a register holds, at least one.
using FloatGroup = FloatVec;
using DoubleGroup = std::conditional_t<(kWidth < 4), Quad, Vec>;
inline FloatGroup load_group(const float* p) { return load(p); }
inline void store_group(float* p, FloatGroup v) { store(p, v); }
using StoredDoubleGroup = DoubleGroup __attribute__((may_alias, aligned(alignof(double))));
inline DoubleGroup load_group(const double* p) { return *reinterpret_cast<const StoredDoubleGroup*>(p); }
inline void store_group(double* p, DoubleGroup v) { *reinterpret_cast<StoredDoubleGroup*>(p) = v; }

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

/// Of four fields of groups, the sum of each over its vertices: four vertices.
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

inline const double* gradients_of(const MeshArrays& mesh, double) { return mesh.gradients; }
inline const float* gradients_of(const MeshArrays& mesh, float) { return mesh.rounded_gradients; }

/// H [9 x lanes] of the elements from `first` on, of a field of vertices.
template <Index lanes, class Number>
inline void gather_gradients(const MeshArrays& mesh, Index first, const Number* field, Number* H) {
  const Number* gradients = gradients_of(mesh, Number{});
  for (Index group = 0; group < lanes; group += 4) {
    QuadOf<Number> columns[3][4];
#pragma GCC unroll 4
    for (Index i = 0; i < 4; ++i) {
      QuadOf<Number> x{}, y{}, z{};
      const Index element = first + group + i, end = mesh.starts[element + 1];
      for (Index k = mesh.starts[element]; k < end; ++k) {
        const QuadOf<Number> u = load_quad(field + 4 * mesh.corners[k]);
        x += u * gradients[3 * k];
        y += u * gradients[3 * k + 1];
        z += u * gradients[3 * k + 2];
      }
      columns[0][i] = x;
      columns[1][i] = y;
      columns[2][i] = z;
    }
#pragma GCC unroll 3
    for (Index b = 0; b < 3; ++b) {
      transpose(columns[b]);
#pragma GCC unroll 3
      for (Index a = 0; a < 3; ++a) store_quad(H + (3 * a + b) * lanes + group, columns[b][a]);
    }
  }
}

/// forces += P b of the elements from `first` on, of stresses [9 x lanes].
template <Index lanes, class Number>
inline void scatter_stresses(const MeshArrays& mesh, Index first, const Number* P, Number* forces) {
  const Number* gradients = gradients_of(mesh, Number{});
  for (Index group = 0; group < lanes; group += 4) {
    QuadOf<Number> columns[3][4];
#pragma GCC unroll 3
    for (Index b = 0; b < 3; ++b) {
#pragma GCC unroll 3
      for (Index a = 0; a < 3; ++a) columns[b][a] = load_quad(P + (3 * a + b) * lanes + group);
      columns[b][3] = QuadOf<Number>{};
      transpose(columns[b]);
    }
#pragma GCC unroll 4
    for (Index i = 0; i < 4; ++i) {
      const Index element = first + group + i, end = mesh.starts[element + 1];
      for (Index k = mesh.starts[element]; k < end; ++k) {
        Number* force = forces + 4 * mesh.corners[k];
        store_quad(force, load_quad(force) + columns[0][i] * gradients[3 * k] + columns[1][i] * gradients[3 * k + 1] +
                              columns[2][i] * gradients[3 * k + 2]);
      }
    }
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
                          const MeshInertia& terms, bool freeze, double* frozen, float* tangents, double* force,
                          double* sums) {
  alignas(kAlignment) double H[9 * kLanes], rates[9 * kLanes], P[9 * kLanes], tangent[kTangentNumbers * kLanes];
  alignas(kAlignment) double example_tangent[want == Want::kStiffness ? kTangentNumbers * kLanes : kLanes];
  const bool damped = terms.stiffness_damping > 0;
  Vec elastic = zero(), damping = zero(), pulled = zero();
  for (Index first = 0; first < mesh.panels * kMeshLanes; first += kLanes) {
    double* const own_frozen = damped ? frozen + first * kTangentNumbers : nullptr;
    gather_gradients<kLanes>(mesh, first, terms.displacement, H);
    if (damped) gather_gradients<kLanes>(mesh, first, terms.rate, rates);
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
    scatter_stresses<kLanes>(mesh, first, P, force);
    if constexpr (want == Want::kStiffness) {
      float* const rounded = tangents + first / kMeshLanes * kTangentNumbers * kMeshLanes + first % kMeshLanes;
      for (Index k = 0; k < kTangentNumbers; ++k)
        for (Index lane = 0; lane < kLanes; ++lane) {
          double value = tangent[k * kLanes + lane];
          if (damped) value += terms.stiffness_damping * own_frozen[k * kLanes + lane];
          rounded[k * kMeshLanes + lane] = static_cast<float>(value);
        }
    }
  }
  sums[1] += 0.5 * sum(damping);
  sums[2] += sum(elastic);
  sums[3] += sum(pulled);
}

void mesh_force(const MeshArrays& mesh, const ElementLaw& law, const ElementLaw* example, const MeshInertia& terms,
                const double* frozen, double* force, double* sums) {
  with_law(law, [&]<class Law>() {
    evaluate_mesh<Want::kForce, Law>(mesh, law, example, terms, false, const_cast<double*>(frozen), nullptr, force,
                                     sums);
  });
}

void mesh_force_and_tangents(const MeshArrays& mesh, const ElementLaw& law, const ElementLaw* example,
                             const MeshInertia& terms, bool freeze, double* frozen, float* tangents, double* force,
                             double* sums) {
  with_law(law, [&]<class Law>() {
    evaluate_mesh<Want::kStiffness, Law>(mesh, law, example, terms, freeze, frozen, tangents, force, sums);
  });
}

void mesh_product(const MeshArrays& mesh, const float* matrix, const float* tangents, const float* x, float* product) {
  constexpr Index kFloats = 2 * kWidth;
  for (Index i = 0; i < mesh.vertices; ++i) {
    FloatQuad even{}, odd{};
    const Index end = mesh.row_starts[i + 1];
    Index k = mesh.row_starts[i];
    for (; k + 1 < end; k += 2) {
      even += load_quad(x + 4 * mesh.columns[k]) * matrix[k];
      odd += load_quad(x + 4 * mesh.columns[k + 1]) * matrix[k + 1];
    }
    if (k < end) even += load_quad(x + 4 * mesh.columns[k]) * matrix[k];
    store_quad(product + 4 * mesh.rows[i], even + odd);
  }
  alignas(kAlignment) float H[9 * kMeshLanes];
  for (Index panel = 0; panel < mesh.panels; ++panel) {
    gather_gradients<kMeshLanes>(mesh, panel * kMeshLanes, x, H);
    for (Index lane = 0; lane < kMeshLanes; lane += kFloats) {
      FloatVec h[9], image[9];
      for (Index i = 0; i < 9; ++i) h[i] = load(H + i * kMeshLanes + lane);
      tangent_product(tangents + panel * kTangentNumbers * kMeshLanes + lane, kMeshLanes, h, image);
      for (Index i = 0; i < 9; ++i) store(H + i * kMeshLanes + lane, image[i]);
    }
    scatter_stresses<kMeshLanes>(mesh, panel * kMeshLanes, H, product);
  }
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

template <class Lanes, Index vectors, class Number>
inline void filter_strip(const MeshFilter<Number>& filter, const Number* field, Index first, Number* coefficients) {
  constexpr Index kNumbers = sizeof(Lanes) / sizeof(Number);
  Lanes sums[3][vectors] = {};
  const Number* row = filter.functions + first;
  for (Index i = 0; i < filter.vertices; ++i, row += filter.stride, field += 4)
#pragma GCC unroll 2
    for (Index v = 0; v < vectors; ++v) {
      const Lanes value = load(row + v * kNumbers);
#pragma GCC unroll 3
      for (Index a = 0; a < 3; ++a) sums[a][v] += value * field[a];
    }
  for (Index a = 0; a < 3; ++a)
    for (Index v = 0; v < vectors; ++v) store(coefficients + a * filter.stride + first + v * kNumbers, sums[a][v]);
}

template <class Lanes, class Number>
inline void coefficients_of(const MeshFilter<Number>& filter, const Number* field, Number* coefficients) {
  constexpr Index kNumbers = sizeof(Lanes) / sizeof(Number);
  Index first = 0;
  for (; first + 2 * kNumbers <= filter.stride; first += 2 * kNumbers)
    filter_strip<Lanes, 2>(filter, field, first, coefficients);
  if (first < filter.stride) filter_strip<Lanes, 1>(filter, field, first, coefficients);
}

template <class Lanes, class Number>
inline void add_functions(const MeshFilter<Number>& filter, Number factor, const Number* coefficients, Number* field) {
  constexpr Index kNumbers = sizeof(Lanes) / sizeof(Number);
  alignas(kAlignment) Number lanes[kNumbers < 4 ? 4 : kNumbers] = {};
  const Number* row = filter.functions;
  for (Index i = 0; i < filter.vertices; ++i, row += filter.stride, field += 4) {
    Lanes sums[3] = {};
    for (Index k = 0; k < filter.stride; k += kNumbers) {
      const Lanes value = load(row + k);
#pragma GCC unroll 3
      for (Index a = 0; a < 3; ++a) sums[a] += value * load(coefficients + a * filter.stride + k);
    }
    QuadOf<Number> totals[4] = {};
#pragma GCC unroll 3
    for (Index a = 0; a < 3; ++a) {
      store(lanes, sums[a]);
      totals[a] = load_quad(lanes);
      for (Index lane = 4; lane < kNumbers; lane += 4) totals[a] += load_quad(lanes + lane);
    }
    transpose(totals);
    store_quad(field, load_quad(field) + factor * ((totals[0] + totals[1]) + (totals[2] + totals[3])));
  }
}

void mesh_coefficients(const MeshFilter<double>& filter, const double* field, double* coefficients) {
  coefficients_of<Vec>(filter, field, coefficients);
}
void mesh_rounded_coefficients(const MeshFilter<float>& filter, const float* field, float* coefficients) {
  coefficients_of<FloatVec>(filter, field, coefficients);
}
void mesh_add_functions(const MeshFilter<double>& filter, double factor, const double* coefficients, double* field) {
  add_functions<Vec>(filter, factor, coefficients, field);
}
void mesh_add_rounded_functions(const MeshFilter<float>& filter, float factor, const float* coefficients,
                                float* field) {
  add_functions<FloatVec>(filter, factor, coefficients, field);
}
