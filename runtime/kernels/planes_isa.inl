// Part of kernels_isa.inl, which includes this file: kLanes vertices beside planes at once, by the law of
// contact_law.h.

/// As SlipLaw of contact_law.cpp, of those that rub.
struct SlipLanes {
  SlipLanes(Vec limit, Vec stiffness, const Vec* slip) : square(dot3(slip, slip)), length(square_root(square)) {
    share = 0.5 * length * stiffness / limit;
    sticks = share < 1.0;
    secant = select(sticks, stiffness * (1.0 - 0.5 * share), limit / select(sticks, zero() + 1.0, length));
  }
  Vec energy(Vec limit, Vec stiffness) const {
    return select(sticks, stiffness * square * (0.5 - share * (1.0 / 6)),
                  limit * (length - (2.0 / 3) * limit / stiffness));
  }
  Vec tangent(Vec stiffness) const { return select(sticks, stiffness * (1.0 - share), zero()); }

  Vec square, length, share, secant;
  IntVec sticks;
};

inline void load3(const double (*numbers)[kLanes], Index at, Vec* v) {
  for (Index i = 0; i < 3; ++i) v[i] = load(numbers[i] + at);
}

inline void store3(const Vec* v, Index at, double (*numbers)[kLanes]) {
  for (Index i = 0; i < 3; ++i) store(numbers[i] + at, v[i]);
}

/// Gathers vectors that lie vertex by vertex, from `vectors` on.
inline void gather3(const double* vectors, Vec* v) {
  for (Index i = 0; i < 3; ++i) {
    v[i] = zero();
    for (Index lane = 0; lane < kWidth; ++lane) v[i][lane] = vectors[3 * lane + i];
  }
}

inline void scatter3(const Vec* v, double* vectors) {
  for (Index i = 0; i < 3; ++i)
    for (Index lane = 0; lane < kWidth; ++lane) vectors[3 * lane + i] = v[i][lane];
}

/// Places of the vertices of one register, and what they feel of their planes.
struct PlaneLanes {
  PlaneLanes(const PlaneContactPanel& panel, Index at, const double* pose, const double* products) {
    Vec rest[3], moved[3], start[3];
    load3(panel.rest, at, rest);
    load3(panel.start, at, start);
    load3(panel.normal, at, normal);
    gather3(products + 3 * at, moved);
    for (Index i = 0; i < 3; ++i) moved[i] += rest[i];
    for (Index i = 0; i < 3; ++i) {
      arm[i] = pose[3 * i] * moved[0] + pose[3 * i + 1] * moved[1] + pose[3 * i + 2] * moved[2];
      way[i] = pose[9 + i] + arm[i] - start[i];
    }
    stiffness = load(panel.stiffness + at);
    damping = load(panel.damping + at);
    limit = load(panel.friction + at);
    const Vec risen = dot3(normal, way);
    gap = load(panel.distance + at) + risen;
    const Vec depth = -gap - damping * risen;
    normal_force = stiffness * larger(depth, zero());
    energy = 0.5 * normal_force * depth;
    load3(panel.stretch, at, slip);
    for (Index i = 0; i < 3; ++i) slip[i] += (1.0 + damping) * (way[i] - risen * normal[i]);
    rubs = limit > 0.0;
    if (bits(rubs) == 0) return;
    const Vec some = select(rubs, limit, zero() + 1.0);
    const SlipLanes law(some, stiffness, slip);
    secant = select(rubs, law.secant, zero());
    energy += select(rubs, law.energy(some, stiffness), zero());
  }

  Vec normal[3], arm[3], way[3], slip[3];
  Vec stiffness, damping, limit, gap, normal_force;
  Vec energy;  ///< (1 + gamma) W
  Vec secant = zero();
  IntVec rubs;
};

unsigned plane_contacts(PlaneContactPanel& panel, const double* pose, const double* products, double* turned,
                        double* sums) {
  unsigned loaded = 0;
  for (Index at = 0; at < kLanes; at += kWidth) {
    const PlaneLanes lanes(panel, at, pose, products);
    Vec force[3], own[3];
    for (Index i = 0; i < 3; ++i) force[i] = lanes.normal_force * lanes.normal[i] - lanes.secant * lanes.slip[i];
    for (Index i = 0; i < 3; ++i) own[i] = pose[i] * force[0] + pose[3 + i] * force[1] + pose[6 + i] * force[2];
    scatter3(own, turned + 3 * at);
    store3(lanes.arm, at, panel.arm);
    store3(force, at, panel.force);
    store3(lanes.slip, at, panel.slip);
    store(panel.normal_force + at, lanes.normal_force);
    store(panel.gap + at, lanes.gap);
    const IntVec touches = lanes.normal_force > 0.0;
    loaded |= bits(touches | lanes.rubs) << at;
    const auto add = [&](Index number, Vec value) {
      double* const to = sums + number * kLanes + at;
      store(to, load(to) + value);
    };
    for (Index i = 0; i < 3; ++i) {
      const Index j = (i + 1) % 3, k = (i + 2) % 3;
      add(i, force[i]);
      add(3 + i, lanes.arm[j] * force[k] - lanes.arm[k] * force[j]);
    }
    add(6, load(panel.share + at) * lanes.energy);
    add(7, select(touches, lanes.stiffness * (1.0 + lanes.damping), zero()));
    add(8, select(touches, zero() + 1.0, zero()));
  }
  return loaded;
}

void plane_potential(const PlaneContactPanel& panel, const double* pose, const double* products, double* sums) {
  for (Index at = 0; at < kLanes; at += kWidth)
    store(sums + at, load(sums + at) + load(panel.share + at) * PlaneLanes(panel, at, pose, products).energy);
}

Index plane_factors(const PlaneContactPanel& panel, const double* pose, double* vectors, double* rigid, int* lanes) {
  constexpr Index kFactors = 3, kNumbers = 9;  // of a vertex; frame of the body, then force and torque
  alignas(kAlignment) double all[kFactors][kNumbers][kLanes];
  unsigned wanted[kFactors] = {};
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec normal[3], arm[3], slip[3];
    load3(panel.normal, at, normal);
    load3(panel.arm, at, arm);
    load3(panel.slip, at, slip);
    const Vec stiffness = load(panel.stiffness + at), limit = load(panel.friction + at);
    const Vec damped = 1.0 + load(panel.damping + at);
    const IntVec touches = load(panel.normal_force + at) > 0.0, rubs = limit > 0.0;
    const auto write = [&](Index factor, IntVec own, Vec square, const Vec* direction) {
      wanted[factor] |= bits(own & (square > 0.0)) << at;
      const Vec size = square_root(select(own, square, zero()));
      Vec vector[3];
      for (Index i = 0; i < 3; ++i) vector[i] = size * direction[i];
      for (Index i = 0; i < 3; ++i) {
        const Index j = (i + 1) % 3, k = (i + 2) % 3;
        store(all[factor][i] + at, pose[i] * vector[0] + pose[3 + i] * vector[1] + pose[6 + i] * vector[2]);
        store(all[factor][3 + i] + at, vector[i]);
        store(all[factor][6 + i] + at, arm[j] * vector[k] - arm[k] * vector[j]);
      }
    };
    write(0, touches, stiffness * damped, normal);
    if (bits(rubs) == 0) continue;
    const SlipLanes law(select(rubs, limit, zero() + 1.0), stiffness, slip);
    // Any direction along the plane does where nothing slips: the projection of the axis farthest from the normal.
    const IntVec moves = law.length > 0.0;
    const Vec x = normal[0] * normal[0], y = normal[1] * normal[1], z = normal[2] * normal[2];
    const IntVec by_x = (x <= y) & (x <= z), by_y = ~by_x & (y <= z);
    const Vec most = select(by_x, normal[0], select(by_y, normal[1], normal[2]));
    Vec along[3], across[3];
    for (Index i = 0; i < 3; ++i) {
      const Vec axis = select(i == 0 ? by_x : i == 1 ? by_y : ~(by_x | by_y), zero() + 1.0, zero());
      along[i] = select(moves, slip[i], axis - most * normal[i]);
    }
    const Vec inverse = 1.0 / square_root(dot3(along, along));
    for (Index i = 0; i < 3; ++i) along[i] *= inverse;
    for (Index i = 0; i < 3; ++i) {
      const Index j = (i + 1) % 3, k = (i + 2) % 3;
      across[i] = normal[j] * along[k] - normal[k] * along[j];
    }
    write(1, rubs, damped * law.tangent(stiffness), along);
    write(2, rubs, damped * law.secant, across);
  }
  Index count = 0;
  for (unsigned left = wanted[0] | wanted[1] | wanted[2]; left != 0; left &= left - 1) {
    const int lane = __builtin_ctz(left);
    for (Index factor = 0; factor < kFactors; ++factor) {
      if ((wanted[factor] >> lane & 1) == 0) continue;
      for (Index i = 0; i < 3; ++i) vectors[3 * count + i] = all[factor][i][lane];
      for (Index i = 0; i < 6; ++i) rigid[6 * count + i] = all[factor][3 + i][lane];
      lanes[count++] = lane;
    }
  }
  return count;
}
