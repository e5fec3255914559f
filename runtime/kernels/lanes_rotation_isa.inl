// Part of kernels_isa.inl, which includes this file: the rotation of kLanes free bodies side by side. What each line is
// of: free_motion.h, spin.h and deforming_inertia.h.

constexpr Index kPairs = 6, kPairFirst[kPairs] = {0, 1, 2, 1, 0, 0}, kPairSecond[kPairs] = {0, 1, 2, 2, 2, 1};
constexpr Index kMostSpinIterations = 30;
constexpr double kSpinTolerance = 4e-15;  // of |J w| + |h|
constexpr double kMostTurn = 1;           // [rad] that the series below are for

inline Vec load3(const double* numbers, Index i) { return load(numbers + i * kLanes); }

/// (sin t / t, (1 - cos t) / t^2, (t - sin t) / t^3) for t up to kMostTurn, to rounding.
inline void turn_coefficients(Vec square, Vec* found) {
  constexpr double kFirst[] = {1, 1.0 / 2, 1.0 / 6};
  for (Index k = 0; k < 3; ++k) {
    // The sum over n of (-square)^n / (2 n + k + 1)!.
    Vec sum = zero() + 1.0;
    for (Index n = 9; n >= 1; --n) {
      const auto m = static_cast<double>(2 * n + k);
      sum = 1.0 - square * sum * (1 / (m * (m + 1)));
    }
    found[k] = sum * kFirst[k];
  }
}

inline void cross(const Vec* a, const Vec* b, Vec* product) {
  product[0] = a[1] * b[2] - a[2] * b[1];
  product[1] = a[2] * b[0] - a[0] * b[2];
  product[2] = a[0] * b[1] - a[1] * b[0];
}

/// M^-1, 3 x 3, by rows.
inline void invert3(const Vec* M, Vec* inverse) {
  Vec C[9];
  cofactors(M, C);
  const Vec share = 1.0 / (M[0] * C[0] + M[1] * C[1] + M[2] * C[2]);
  for (Index i = 0; i < 3; ++i)
    for (Index j = 0; j < 3; ++j) inverse[3 * i + j] = C[3 * j + i] * share;
}

inline void multiply3(const Vec* M, const Vec* x, Vec* product) {
  for (Index i = 0; i < 3; ++i) product[i] = M[3 * i] * x[0] + M[3 * i + 1] * x[1] + M[3 * i + 2] * x[2];
}

/// One iteration of Newton's method from the residual J w + h - l: w less that over J - factor [l]x J_r(t).
inline void improve_spin(const Vec* J, const Vec* l, const Vec* t, const Vec* coefficients, Vec factor,
                         const Vec* residual, Vec* change) {
  Vec M[9];
  for (Index j = 0; j < 3; ++j) {
    // Column j of the right Jacobian I - c_1 [t] + c_2 [t]^2.
    Vec unit[3] = {zero(), zero(), zero()}, once[3], twice[3], column[3], turned[3];
    unit[j] = zero() + 1.0;
    cross(t, unit, once);
    cross(t, once, twice);
    for (Index i = 0; i < 3; ++i) column[i] = unit[i] - coefficients[1] * once[i] + coefficients[2] * twice[i];
    cross(l, column, turned);
    for (Index i = 0; i < 3; ++i) M[3 * i + j] = J[3 * i + j] - factor * turned[i];
  }
  Vec inverse[9];
  invert3(M, inverse);
  multiply3(inverse, residual, change);
}

/// As solve_spin(), of the lanes that are active; the others keep theirs. 1 where there is one.
inline Vec solve_spins(const LaneRotationArrays& own, Index at, IntVec active, const Vec* J, const Vec* h) {
  const Vec factor = load(own.factor + at);
  Vec w[3], t[3], momentum[3];
  Vec momentum_square = zero(), h_square = zero();
  for (Index i = 0; i < 3; ++i) {
    momentum[i] = load3(own.momentum + at, i);
    w[i] = load3(own.spin + at, i);
    t[i] = load3(own.offset + at, i) + factor * w[i];
    momentum_square += momentum[i] * momentum[i];
    h_square += h[i] * h[i];
  }
  const Vec scale = square_root(momentum_square) + square_root(h_square);
  Vec before = zero() + __builtin_inf(), found = zero();
  IntVec open = active;
  for (Index iteration = 0; iteration < kMostSpinIterations; ++iteration) {
    const Vec angle_square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
    open = open & (angle_square <= kMostTurn * kMostTurn);
    Vec c[3], once[3], twice[3], l[3], residual[3], change[3];
    turn_coefficients(angle_square, c);
    cross(t, momentum, once);
    cross(t, once, twice);
    multiply3(J, w, residual);
    for (Index i = 0; i < 3; ++i) {
      l[i] = momentum[i] - c[0] * once[i] + c[1] * twice[i];
      residual[i] += h[i] - l[i];
    }
    const Vec size = square_root(residual[0] * residual[0] + residual[1] * residual[1] + residual[2] * residual[2]);
    IntVec done = size <= kSpinTolerance * scale;
    if (iteration > 3) done = done | ((size >= before) & (size <= 1e3 * kSpinTolerance * scale));
    found = select(open & done, zero() + 1.0, found);
    open = open & ~done;
    if (all(open == 0)) break;
    before = size;
    improve_spin(J, l, t, c, factor, residual, change);
    for (Index i = 0; i < 3; ++i) {
      w[i] = select(open, w[i] - change[i], w[i]);
      t[i] = load3(own.offset + at, i) + factor * w[i];
    }
  }
  for (Index i = 0; i < 3; ++i) {
    store(own.spin + i * kLanes + at, select(active, w[i], load3(own.spin + at, i)));
    store(own.rotation + i * kLanes + at, select(active, t[i], load3(own.rotation + at, i)));
  }
  return found;
}

/// d(1/2 w^T J w)/dP of the six pairs.
inline void energy_slopes(const Vec* w, Vec* slopes) {
  const Vec square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
  for (Index pair = 0; pair < kPairs; ++pair)
    slopes[pair] = pair < 3 ? 0.5 * (square - w[pair] * w[pair]) : -w[kPairFirst[pair]] * w[kPairSecond[pair]];
}

void lanes_begin_rotation(const LaneRotationArrays& own) {
  for (Index c = 0; c < 3; ++c)
    lanes_matrix_product(own.stacked + (kPairs + c) * own.stride, own.modes, own.modes, 9 * own.stride,
                         own.velocity_centre, own.centre_products + c * own.modes * kLanes);
}

/// J and h at x of one register's bodies.
inline void moments_of(const LaneRotationArrays& own, Index at, const double* x, Vec* J, Vec* h) {
  const Index block = own.modes * kLanes;
  const double* const products = own.products + at;
  const Vec rate = load(own.velocity_factor + at);
  Vec P[kPairs];
  for (Index pair = 0; pair < kPairs; ++pair) P[pair] = zero() + own.second_moments[pair];
  for (Index c = 0; c < 3; ++c) h[c] = zero();
  for (Index i = 0; i < own.modes; ++i) {
    const Vec here = load(x + i * kLanes + at), v = rate * (here - load(own.velocity_centre + i * kLanes + at));
#pragma GCC unroll 6
    for (Index pair = 0; pair < kPairs; ++pair)
      P[pair] += here * (load(products + pair * block + i * kLanes) + own.linear[pair * own.modes + i]);
#pragma GCC unroll 3
    for (Index c = 0; c < 3; ++c) h[c] -= load(products + (kPairs + c) * block + i * kLanes) * v;
  }
  const Vec trace = P[0] + P[1] + P[2];
  for (Index pair = 0; pair < kPairs; ++pair) {
    const Index a = kPairFirst[pair], b = kPairSecond[pair];
    J[3 * a + b] = J[3 * b + a] = a == b ? trace - P[pair] : -P[pair];
  }
}

void lanes_rotate(const LaneRotationArrays& own, const double* active, const double* x, double* force, double* found) {
  const Index block = own.modes * kLanes;
  for (Index k = 1; k < 9; ++k)
    lanes_matrix_product(own.stacked + k * own.stride, own.modes, own.modes, 9 * own.stride, x,
                         own.products + k * block);
  for (Index i = 0; i < block; i += kWidth)
    store(own.products + i, load(x + i) - load(own.products + block + i) - load(own.products + 2 * block + i));
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec J[9], h[3], inverse[9], w[3], slopes[kPairs], turning[3];
    moments_of(own, at, x, J, h);
    store(found + at, solve_spins(own, at, load(active + at) != 0.0, J, h));
    invert3(J, inverse);
    for (Index i = 0; i < 9; ++i) store(own.inverse_inertia + i * kLanes + at, inverse[i]);
    const Vec rate = load(own.velocity_factor + at);
    for (Index c = 0; c < 3; ++c) {
      w[c] = load3(own.spin + at, c);
      turning[c] = rate * w[c];
    }
    energy_slopes(w, slopes);
    for (Index i = 0; i < own.modes; ++i) {
      const double* const products = own.products + i * kLanes + at;
      Vec sum = zero(), twice = zero();
#pragma GCC unroll 6
      for (Index pair = 0; pair < kPairs; ++pair) {
        sum += slopes[pair] * own.linear[pair * own.modes + i];
        twice += slopes[pair] * load(products + pair * block);
      }
#pragma GCC unroll 3
      for (Index c = 0; c < 3; ++c) {
        twice += turning[c] * load(products + (kPairs + c) * block);
        sum -= turning[c] * load(own.centre_products + c * block + i * kLanes + at);
      }
      store(force + i * kLanes + at, sum + 2.0 * twice);
    }
  }
}

inline void store_chosen(IntVec chosen, const Vec* values, double* numbers) {
  for (Index c = 0; c < 3; ++c) store(numbers + c * kLanes, select(chosen, values[c], load(numbers + c * kLanes)));
}

/// (D + V)^T and H^T of each mode, and J^-1 times them, into `factors` of the chosen.
inline void set_rotation_factors(const LaneRotationArrays& own, Index at, IntVec chosen) {
  const Index block = own.modes * kLanes;
  const Vec rate = load(own.velocity_factor + at);
  Vec w[3], inverse[9];
  for (Index c = 0; c < 3; ++c) w[c] = load3(own.spin + at, c);
  for (Index i = 0; i < 9; ++i) inverse[i] = load3(own.inverse_inertia + at, i);
  for (Index i = 0; i < own.modes; ++i) {
    const double* const products = own.products + i * kLanes + at;
    Vec gradients[kPairs], slope[3], deformation[3], found[3];
    for (Index pair = 0; pair < kPairs; ++pair)
      gradients[pair] = own.linear[pair * own.modes + i] + 2.0 * load(products + pair * block);
    const Vec trace = gradients[0] + gradients[1] + gradients[2];
    for (Index c = 0; c < 3; ++c) {
      const Vec product = load(products + (kPairs + c) * block);
      deformation[c] = -product;
      slope[c] =
          w[c] * (trace - gradients[c]) + rate * (product - load(own.centre_products + c * block + i * kLanes + at));
    }
    for (Index pair = 3; pair < kPairs; ++pair) {
      slope[kPairFirst[pair]] -= w[kPairSecond[pair]] * gradients[pair];
      slope[kPairSecond[pair]] -= w[kPairFirst[pair]] * gradients[pair];
    }
    double* const factors = own.factors + 12 * i * kLanes + at;
    store_chosen(chosen, slope, factors);
    store_chosen(chosen, deformation, factors + 3 * kLanes);
    multiply3(inverse, slope, found);
    store_chosen(chosen, found, factors + 6 * kLanes);
    multiply3(inverse, deformation, found);
    store_chosen(chosen, found, factors + 9 * kLanes);
  }
}

/// Adds the rotation's part to `rows` rows of the Hessian from row i on, up to the diagonal. `soft`: slopes of the six
/// pairs, null: none.
template <Index rows>
inline void add_rotation_rows(const LaneRotationArrays& own, Index at, Index i, Vec inertia, const Vec* soft,
                              double* hessian) {
  Vec slope[rows][3], lost[rows][3];
#pragma GCC unroll 2
  for (Index m = 0; m < rows; ++m)
#pragma GCC unroll 3
    for (Index c = 0; c < 3; ++c) {
      const double* const row = own.factors + 12 * (i + m) * kLanes + at;
      slope[m][c] = load3(row, c);
      lost[m][c] = inertia * load3(row, 3 + c);
    }
  for (Index j = 0; j < i + rows; ++j) {
    const double* const column = own.factors + (12 * j + 6) * kLanes + at;
    Vec gains[rows] = {}, losses[rows] = {};
#pragma GCC unroll 3
    for (Index c = 0; c < 3; ++c) {
      const Vec stiffening = load3(column, c), other = load3(column, 3 + c);
#pragma GCC unroll 2
      for (Index m = 0; m < rows; ++m) {
        gains[m] += slope[m][c] * stiffening;
        losses[m] += lost[m][c] * other;
      }
    }
#pragma GCC unroll 2
    for (Index m = 0; m < rows; ++m) {
      if (j > i + m) continue;
      Vec sum = gains[m] - losses[m];
      if (soft != nullptr)
        for (Index pair = 0; pair < kPairs; ++pair)
          sum += soft[pair] * own.stacked[(j * 9 + pair) * own.stride + i + m];
      add_to(hessian + lane_entry(i + m, j) + at, sum);
    }
  }
}

void lanes_rotation_stiffness(const LaneRotationArrays& own, const double* chosen, const double* softening,
                              double* hessian) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    set_rotation_factors(own, at, load(chosen + at) != 0.0);
    const Vec rate = load(own.velocity_factor + at), inertia = rate * rate, soft = load(softening + at);
    Vec w[3], slopes[kPairs];
    for (Index c = 0; c < 3; ++c) w[c] = load3(own.spin + at, c);
    energy_slopes(w, slopes);
    for (Index pair = 0; pair < kPairs; ++pair) slopes[pair] *= -2.0 * soft;
    const Vec* const softens = all(soft == 0.0) ? nullptr : slopes;
    Index i = 0;
    for (; i + 2 <= own.modes; i += 2) add_rotation_rows<2>(own, at, i, inertia, softens, hessian);
    if (i < own.modes) add_rotation_rows<1>(own, at, i, inertia, softens, hessian);
  }
}

void lanes_gyroscopic_product(const LaneRotationArrays& own, const double* x, double* scratch, double* product) {
  const Index block = own.modes * kLanes;
  for (Index c = 0; c < 3; ++c)
    lanes_matrix_product(own.stacked + (kPairs + c) * own.stride, own.modes, own.modes, 9 * own.stride, x,
                         scratch + c * block);
  for (Index at = 0; at < kLanes; at += kWidth) {
    const Vec rate = load(own.velocity_factor + at);
    Vec by_slope[3] = {}, by_deformation[3] = {}, turning[3];
    for (Index i = 0; i < own.modes; ++i) {
      const double* const factors = own.factors + 12 * i * kLanes + at;
      const Vec here = load(x + i * kLanes + at);
      for (Index c = 0; c < 3; ++c) {
        by_slope[c] += load3(factors, 6 + c) * here;
        by_deformation[c] += load3(factors, 9 + c) * here;
      }
    }
    for (Index c = 0; c < 3; ++c) turning[c] = 2.0 * load3(own.spin + at, c);
    for (Index i = 0; i < own.modes; ++i) {
      const double* const factors = own.factors + 12 * i * kLanes + at;
      Vec sum = zero();
      for (Index c = 0; c < 3; ++c)
        sum += load3(factors, c) * by_deformation[c] - load3(factors, 3 + c) * by_slope[c] -
               turning[c] * load(scratch + c * block + i * kLanes + at);
      store(product + i * kLanes + at, rate * sum);
    }
  }
}
