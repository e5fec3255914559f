// Part of kernels_isa.inl, which includes this file: weights and targets of kLanes bodies side by side.

/// One register's bodies at a time. `examples` is a constant, so that loops over the examples unroll.
template <Index examples>
inline void lanes_choose_weights(const WeightCandidates& candidates, const double* load_, double* weights) {
  const Index stride = padded(candidates.count);
  Vec loads[examples], chosen[examples];
  for (Index k = 0; k < examples; ++k) {
    loads[k] = load(load_ + k * kLanes);
    chosen[k] = zero();
  }
  Vec best = zero() - __builtin_inf();
  for (Index n = 0; n < candidates.count; ++n) {
    Vec least = zero(), values[examples];
    const double* numbers = candidates.numbers + n;
#pragma GCC unroll 4
    for (Index k = 0; k < examples; ++k) {
      Vec value = zero() + *numbers;
      numbers += stride;
#pragma GCC unroll 4
      for (Index j = 1; j < examples; ++j, numbers += stride) value += loads[j] * *numbers;
      values[k] = value;
      least = select(value < least, value, least);
    }
    const IntVec better = least > best;
    best = select(better, least, best);
#pragma GCC unroll 4
    for (Index k = 0; k < examples; ++k)
      chosen[k] = select(better, larger(values[k], zero()) * candidates.members[k * stride + n], chosen[k]);
  }
  Vec sum = chosen[0];
  for (Index k = 1; k < examples; ++k) sum += chosen[k];
  const Vec share = 1.0 / sum;  // one but for rounding
  for (Index k = 0; k < examples; ++k) store(weights + k * kLanes, chosen[k] * share);
}

void lanes_weights(const WeightCandidates& candidates, const double* load, double* weights) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    if (candidates.examples == 1) lanes_choose_weights<1>(candidates, load + at, weights + at);
    if (candidates.examples == 2) lanes_choose_weights<2>(candidates, load + at, weights + at);
    if (candidates.examples == 3) lanes_choose_weights<3>(candidates, load + at, weights + at);
    if (candidates.examples == 4) lanes_choose_weights<4>(candidates, load + at, weights + at);
  }
}

/// A candidate in each lane.
void choose_weights(const WeightCandidates& candidates, const double* load_, double* weights) {
  constexpr Index kMost = WeightCandidates::kMostExamples, kMostSets = padded((1 << kMost) - 1);
  const Index examples = candidates.examples, stride = padded(candidates.count);
  alignas(kAlignment) double values[kMost * kMostSets], least[kMostSets];
  for (Index n = 0; n < stride; n += kWidth) {
    const double* numbers = candidates.numbers + n;
    Vec lowest = zero();
    for (Index k = 0; k < examples; ++k) {
      Vec value = load(numbers);
      numbers += stride;
      for (Index j = 1; j < examples; ++j, numbers += stride) value += load(numbers) * load_[j];
      store(values + k * kMostSets + n, value);
      lowest = select(value < lowest, value, lowest);
    }
    store(least + n, lowest);
  }
  Index best = 0;
  for (Index n = 1; n < candidates.count; ++n) best = least[n] > least[best] ? n : best;
  double sum = 0;
  for (Index k = 0; k < examples; ++k) {
    const double value = values[k * kMostSets + best];
    weights[k] = (value > 0 ? value : 0) * candidates.members[k * stride + best];
    sum += weights[k];
  }
  const double share = 1 / sum;  // one but for rounding
  for (Index k = 0; k < examples; ++k) weights[k] *= share;
}

/// The polynomials whose first `k` exponents are given, `product` of their factors, the others adding up to `left`.
inline void lanes_expand(const BernsteinArrays& basis, Index k, Index left, Vec product, const double* powers,
                         const double* pairs, double*& next) {
  if (k + 2 < basis.weights) {
    const double* const own = powers + k * (basis.degree + 1) * kLanes;
    const double* const binomials = basis.binomials + left * (basis.degree + 1);
    for (Index a = left; a >= 0; --a)
      lanes_expand(basis, k + 1, left - a, product * binomials[a] * load(own + a * kLanes), powers, pairs, next);
    return;
  }
  const double* const own = pairs + left * (left + 1) / 2 * kLanes;
  for (Index b = 0; b <= left; ++b, next += kLanes) store(next, product * load(own + b * kLanes));
}

/// Products of the last two weights: C(m, b) w^(m - b) w'^b, m (m + 1) / 2 + b-th for each m from `first` to degree.
inline void lanes_pairs(const BernsteinArrays& basis, Index first, const double* powers, double* pairs) {
  const Index numbers = (basis.degree + 1) * kLanes;
  const double* const one = powers + (basis.weights - 2) * numbers;
  for (Index m = first; m <= basis.degree; ++m)
    for (Index b = 0; b <= m; ++b)
      store(pairs + (m * (m + 1) / 2 + b) * kLanes, load(one + (m - b) * kLanes) * load(one + numbers + b * kLanes) *
                                                        basis.binomials[m * (basis.degree + 1) + b]);
}

void lanes_bernstein(const BernsteinArrays& basis, const double* weights, double* scratch, double* values) {
  const Index numbers = (basis.degree + 1) * kLanes;
  for (Index at = 0; at < kLanes; at += kWidth) {
    double* const powers = scratch + at;
    double* const pairs = powers + basis.weights * numbers;
    for (Index k = 0; k < basis.weights; ++k) {
      Vec power = zero() + 1.0;
      for (Index a = 0; a <= basis.degree; ++a) {
        power = select(power < basis.smallest_power, zero(), power);
        store(powers + k * numbers + a * kLanes, power);
        power *= load(weights + k * kLanes + at);
      }
    }
    lanes_pairs(basis, basis.weights == 2 ? basis.degree : 0, powers, pairs);
    double* next = values + at;
    lanes_expand(basis, 0, basis.degree, zero() + 1.0, powers, pairs, next);
  }
}
