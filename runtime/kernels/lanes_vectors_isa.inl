// Part of kernels_isa.inl, which includes this file: vectors of kLanes bodies side by side, and the quadratic form of
// their steps.

void lanes_dot(Index n, const double* a, const double* b, double* sum) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec even = zero(), odd = zero();
    Index c = 0;
    for (; c + 1 < n; c += 2) {
      even += load(a + c * kLanes + at) * load(b + c * kLanes + at);
      odd += load(a + (c + 1) * kLanes + at) * load(b + (c + 1) * kLanes + at);
    }
    if (c < n) even += load(a + c * kLanes + at) * load(b + c * kLanes + at);
    store(sum + at, even + odd);
  }
}

void lanes_sum(Index n, const double* a, const double* b, double* sum) {
  for (Index i = 0; i < n * kLanes; i += kWidth) store(sum + i, load(a + i) + load(b + i));
}

void lanes_add_constants(Index n, const double* constants, const double* factor, double* numbers) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    const Vec own = load(factor + at);
    for (Index i = 0; i < n; ++i) add_to(numbers + i * kLanes + at, own * constants[i]);
  }
}

void lanes_take(Index n, const double* chosen, const double* from, double* to) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    const IntVec wanted = load(chosen + at) != 0.0;
    for (Index i = at; i < n * kLanes; i += kLanes) store(to + i, select(wanted, load(from + i), load(to + i)));
  }
}

void lanes_prepare(const LaneForm& form, const double* stiffness, double* offset, double* quadratic, double* linear,
                   double* trace) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    const Vec factor = load(form.velocity_factor + at);
    for (Index i = at; i < form.modes * kLanes; i += kLanes)
      store(offset + i, factor * (load(form.start + i) - load(form.velocity_centre + i)));
  }
  lanes_symmetric_product(stiffness, form.modes, offset, linear);
  for (Index at = 0; at < kLanes; at += kWidth) {
    const Vec inertia = load(form.acceleration_factor + at), mass_damping = load(form.mass_damping + at),
              stiffness_damping = load(form.stiffness_damping + at), factor = load(form.velocity_factor + at);
    for (Index i = at; i < form.modes * kLanes; i += kLanes)
      store(linear + i, stiffness_damping * load(linear + i) + mass_damping * load(offset + i) +
                            inertia * (load(form.start + i) - load(form.acceleration_centre + i)) -
                            load(form.external + i));
    const Vec damping = stiffness_damping * factor, diagonal = inertia + factor * mass_damping;
    for (Index i = at; i < lane_triangle(form.modes); i += kLanes) store(quadratic + i, damping * load(stiffness + i));
    Vec sum = zero();
    for (Index i = 0; i < form.modes; ++i) {
      const Vec own = load(stiffness + lane_entry(i, i) + at);
      sum += select(own < 0.0, -own, own);
      add_to(quadratic + lane_entry(i, i) + at, diagonal);
    }
    store(trace + at, sum);
  }
}

void lanes_assemble(const LaneForm& form, const double* x, const double* quadratic, const double* linear,
                    const double* internal, double* offset, double* gradient, double* sums) {
  for (Index i = 0; i < form.modes * kLanes; i += kWidth) store(offset + i, load(x + i) - load(form.start + i));
  lanes_symmetric_product(quadratic, form.modes, offset, gradient);
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec square = zero(), slope = zero(), force = zero(), way = zero(), size = zero(), residual = zero();
    for (Index i = at; i < form.modes * kLanes; i += kLanes) {
      const Vec product = load(gradient + i), own_linear = load(linear + i), own_force = load(internal + i),
                own_offset = load(offset + i), own_x = load(x + i),
                own_way = own_x - load(form.acceleration_centre + i);
      const Vec own = own_force + own_linear + product;
      store(gradient + i, own);
      square += own_offset * product;
      slope += own_linear * own_offset;
      force += own_force * own_force;
      way += own_way * own_way;
      size += own_x * own_x;
      residual += own * own;
    }
    const Vec found[kLaneSums] = {square, slope, force, way, size, residual};
    for (Index k = 0; k < kLaneSums; ++k) store(sums + k * kLanes + at, found[k]);
  }
}
