// Part of kernels_isa.inl, which includes this file: the rotation of one body by itself. What each line is of:
// free_motion.h and deforming_inertia.h.

constexpr Index kPanelsAtOnce = kWidth / 2;  // of a product, what the registers hold with two sums for each

template <class Number>
inline Number load_as(const double* p) {
  if constexpr (std::is_same_v<Number, double>)
    return *p;
  else
    return load(p);
}
inline void store(double* p, double v) { *p = v; }

/// work<Number>(row) of all rows, a register at a time; the last ones may be computed twice.
template <class Work>
inline void for_rows(Index rows, Work work) {
  if (rows < kWidth) {
    for (Index i = 0; i < rows; ++i) work.template operator()<double>(i);
    return;
  }
  Index i = 0;
  for (; i + kWidth <= rows; i += kWidth) work.template operator()<Vec>(i);
  if (i < rows) work.template operator()<Vec>(rows - kWidth);
}

/// Lanes from `first` on.
inline IntVec lanes_from(Index first) { return lane_numbers() >= first; }

/// sums [count] of x times column<Number>(k, row) over the rows.
template <Index count, class Column>
inline void dots(Index rows, const double* x, Column column, double* sums) {
  static_assert(count <= kLanes);
  if (rows < kWidth) {
    for (Index k = 0; k < count; ++k) sums[k] = 0;
    for (Index i = 0; i < rows; ++i)
      for (Index k = 0; k < count; ++k) sums[k] += x[i] * column.template operator()<double>(k, i);
    return;
  }
  Vec totals[kLanes] = {};
  const auto add = [&](Vec here, Index i) {
#pragma GCC unroll 8
    for (Index k = 0; k < count; ++k) totals[k] += here * column.template operator()<Vec>(k, i);
  };
  Index i = 0;
  for (; i + kWidth <= rows; i += kWidth) add(load(x + i), i);
  if (i < rows) add(select(lanes_from(kWidth - (rows - i)), load(x + rows - kWidth), zero()), rows - kWidth);
  double found[kLanes];
  for (Index k = 0; k < count; k += kWidth) store(found + k, sums_of_lanes(totals + k));
  for (Index k = 0; k < count; ++k) sums[k] = found[k];
}

/// Products of so many panels and vectors x, two sums for each register of a product.
template <Index panels, Index vectors>
inline void panels_at_once(const double* A, Index columns, const double* const* x, double* const* y) {
  constexpr Index kRegisters = panels * kParts;
  Vec even[vectors][kRegisters] = {}, odd[vectors][kRegisters] = {};
  const auto add = [&](Index c, Vec(&sums)[vectors][kRegisters]) {
#pragma GCC unroll 4
    for (Index v = 0; v < kRegisters; ++v) {
      const Vec a = load(A + (v / kParts * columns + c) * kLanes + v % kParts * kWidth);
#pragma GCC unroll 2
      for (Index k = 0; k < vectors; ++k) sums[k][v] += a * x[k][c];
    }
  };
  Index c = 0;
  for (; c + 1 < columns; c += 2) {
    add(c, even);
    add(c + 1, odd);
  }
  if (c < columns) add(c, even);
#pragma GCC unroll 2
  for (Index k = 0; k < vectors; ++k)
#pragma GCC unroll 4
    for (Index v = 0; v < kRegisters; ++v) store(y[k] + v * kWidth, even[k][v] + odd[k][v]);
}

template <Index vectors>
inline void panel_products(const double* A, Index panels, Index columns, const double* const (&x)[vectors],
                           double* (&y)[vectors]) {
  constexpr Index kAtOnce = kPanelsAtOnce / vectors > 0 ? kPanelsAtOnce / vectors : 1;
  const auto take = [&]<Index count>() {
    panels_at_once<count, vectors>(A, columns, x, y);
    A += count * columns * kLanes;
    for (Index k = 0; k < vectors; ++k) y[k] += count * kLanes;
    panels -= count;
  };
  while (panels >= kAtOnce) take.template operator()<kAtOnce>();
  if constexpr (kAtOnce > 2)
    if (panels >= 2) take.template operator()<2>();
  if (panels > 0) take.template operator()<1>();
}

void panel_product(const double* A, Index panels, Index columns, const double* x, double* y) {
  const double* const from[] = {x};
  double* to[] = {y};
  panel_products(A, panels, columns, from, to);
}

void rotation_moments(const RotationArrays& own, const double* q, const double* centre, double* products,
                      double* centre_products, double* sums) {
  const Index modes = own.modes, turning = padded(3 * modes) / kLanes;
  double* const turns = products + rotation_turns(modes);
  panel_product(own.panels, padded(5 * modes) / kLanes, modes, q, products + modes);
  if (centre == nullptr) {
    panel_product(own.turning_panels, turning, modes, q, turns);
  } else {
    const double* const from[] = {q, centre};
    double* to[] = {turns, centre_products};
    panel_products(own.turning_panels, turning, modes, from, to);
  }
  for_rows(modes, [&]<class Number>(Index i) {
    store(products + i,
          load_as<Number>(q + i) - load_as<Number>(products + modes + i) - load_as<Number>(products + 2 * modes + i));
  });
  dots<kPairs>(
      modes, q,
      [&]<class Number>(Index pair, Index i) {
        return load_as<Number>(products + pair * modes + i) + load_as<Number>(own.linear + pair * modes + i);
      },
      sums);
}

void rotation_dots(Index modes, const double* columns, const double* x, double* sums) {
  dots<3>(
      modes, x, [&]<class Number>(Index c, Index i) { return load_as<Number>(columns + c * modes + i); }, sums);
}

void rotation_force(const RotationArrays& own, const double* products, const double* velocity_products,
                    const double* slopes, const double* by_velocity, const double* by_pose, double* force) {
  const Index modes = own.modes;
  const double* const deformation = products + rotation_turns(modes);
  for_rows(modes, [&]<class Number>(Index i) {
    Number sum{}, twice{};
#pragma GCC unroll 6
    for (Index pair = 0; pair < kPairs; ++pair) {
      sum += slopes[pair] * load_as<Number>(own.linear + pair * modes + i);
      twice += slopes[pair] * load_as<Number>(products + pair * modes + i);
    }
#pragma GCC unroll 3
    for (Index c = 0; c < 3; ++c)
      sum += by_velocity[c] * load_as<Number>(velocity_products + c * modes + i) +
             by_pose[c] * load_as<Number>(deformation + c * modes + i);
    store(force + i, sum + 2.0 * twice);
  });
}

/// (D + V)^T, and J^-1 times that and times H^T, into `factors`.
inline void set_rotation_factors(const RotationArrays& own, const double* products, const double* velocity_products,
                                 const double* spin, const double* inverse_inertia, double* factors) {
  const Index modes = own.modes;
  const double* const deformation = products + rotation_turns(modes);
  for_rows(modes, [&]<class Number>(Index i) {
    Number gradients[kPairs], slope[3], turn[3];
#pragma GCC unroll 6
    for (Index pair = 0; pair < kPairs; ++pair)
      gradients[pair] =
          load_as<Number>(own.linear + pair * modes + i) + 2.0 * load_as<Number>(products + pair * modes + i);
    const Number trace = gradients[0] + gradients[1] + gradients[2];
#pragma GCC unroll 3
    for (Index c = 0; c < 3; ++c) {
      turn[c] = load_as<Number>(deformation + c * modes + i);
      slope[c] = spin[c] * (trace - gradients[c]) - load_as<Number>(velocity_products + c * modes + i);
    }
#pragma GCC unroll 3
    for (Index pair = 3; pair < kPairs; ++pair) {
      slope[kPairFirst[pair]] -= spin[kPairSecond[pair]] * gradients[pair];
      slope[kPairSecond[pair]] -= spin[kPairFirst[pair]] * gradients[pair];
    }
#pragma GCC unroll 3
    for (Index c = 0; c < 3; ++c) {
      const double* const row = inverse_inertia + 3 * c;
      store(factors + c * modes + i, slope[c]);
      store(factors + (3 + c) * modes + i, row[0] * slope[0] + row[1] * slope[1] + row[2] * slope[2]);
      store(factors + (6 + c) * modes + i, row[0] * turn[0] + row[1] * turn[1] + row[2] * turn[2]);
    }
  });
}

/// Lower triangle of `hessian` += slope stiffening^T - deformation lost^T, from the last rows up: what is left at the
/// top is less than a register.
inline void add_rotation_products(Index modes, const double* slope, const double* deformation, const double* stiffening,
                                  const double* lost, double* hessian, Index outer) {
  Index first = modes - kWidth;
  for (; first >= 0; first -= kWidth) {
    Vec left[6];
#pragma GCC unroll 3
    for (Index c = 0; c < 3; ++c) {
      left[c] = load(slope + c * modes + first);
      left[3 + c] = load(deformation + c * modes + first);
    }
    for (Index j = 0; j < first + kWidth; ++j) {
      double* const column = hessian + j * outer + first;
      Vec sum = zero(), other = zero();
#pragma GCC unroll 3
      for (Index c = 0; c < 3; ++c) {
        sum += left[c] * stiffening[c * modes + j];
        other += left[3 + c] * lost[c * modes + j];
      }
      sum -= other;
      store(column, load(column) + (j <= first ? sum : select(lanes_from(j - first), sum, zero())));
    }
  }
  for (Index j = 0; j < first + kWidth; ++j)
    for (Index i = j; i < first + kWidth; ++i)
      for (Index c = 0; c < 3; ++c)
        hessian[j * outer + i] +=
            slope[c * modes + i] * stiffening[c * modes + j] - deformation[c * modes + i] * lost[c * modes + j];
}

void rotation_stiffness(const RotationArrays& own, const double* products, const double* velocity_products, double rate,
                        const double* spin, const double* inverse_inertia, double* factors, double* hessian,
                        Index outer) {
  const Index modes = own.modes;
  set_rotation_factors(own, products, velocity_products, spin, inverse_inertia, factors);
  double* const lost = factors + 9 * modes;
  const Vec inertia = zero() + rate * rate;
  for_rows(3 * modes, [&]<class Number>(Index i) {
    if constexpr (std::is_same_v<Number, double>)
      lost[i] = rate * rate * factors[6 * modes + i];
    else
      store(lost + i, inertia * load(factors + 6 * modes + i));
  });
  add_rotation_products(modes, factors, products + rotation_turns(modes), factors + 3 * modes, lost, hessian, outer);
}

void rotation_product(const RotationArrays& own, const double* deformation, const double* factors, double rate,
                      const double* spin, const double* x, double* scratch, double* product) {
  const Index modes = own.modes;
  panel_product(own.turning_panels, padded(3 * modes) / kLanes, modes, x, scratch);
  double sums[6], turning[3];
  dots<6>(
      modes, x, [&]<class Number>(Index k, Index i) { return load_as<Number>(factors + (3 + k) * modes + i); }, sums);
  for (Index k = 0; k < 6; ++k) sums[k] *= rate;
  for (Index c = 0; c < 3; ++c) turning[c] = 2 * rate * spin[c];
  for_rows(modes, [&]<class Number>(Index i) {
    Number sum{};
#pragma GCC unroll 3
    for (Index c = 0; c < 3; ++c)
      sum += sums[3 + c] * load_as<Number>(factors + c * modes + i) -
             sums[c] * load_as<Number>(deformation + c * modes + i) +
             turning[c] * load_as<Number>(scratch + c * modes + i);
    store(product + i, sum);
  });
}
