// Part of kernels_isa.inl, which includes this file: kLanes triangles, or leaves of them, at once.

/// Error that the squared terms of a distance may have, over the square of the way to the first corner.
constexpr double kTriangleRounding = 1e-14;
constexpr double kNoLength = 1e-300;  // an edge without length is its corner

/// The first corner of some triangles and the edges that begin there, `corners` as Kernels::triangle_distances() has
/// them.
struct TriangleLanes {
  TriangleLanes(const double* corners, const double* point) {
    for (Index axis = 0; axis < 3; ++axis) {
      const Vec a = load(corners + axis * kLanes);
      first[axis] = load(corners + (3 + axis) * kLanes) - a;
      second[axis] = load(corners + (6 + axis) * kLanes) - a;
      away[axis] = point[axis] - a;
    }
  }
  /// Squared distance of the point from corner + v first + w second.
  Vec squared_distance(Vec v, Vec w) const {
    Vec sum = zero();
    for (Index axis = 0; axis < 3; ++axis) {
      const Vec left = away[axis] - v * first[axis] - w * second[axis];
      sum += left * left;
    }
    return sum;
  }
  Vec first[3], second[3], away[3];
};

inline Vec unit_clamp(Vec x) { return select(x < 0.0, zero(), select(x > 1.0, zero() + 1.0, x)); }

/// The nearest points corner + v first + w second: of the three edges, or inside where the foot of the point is there.
/// Returns a bound below their squared distances.
inline Vec nearest_on_triangles(const TriangleLanes& lanes, Vec& v, Vec& w) {
  const Vec aa = dot3(lanes.first, lanes.first), bb = dot3(lanes.second, lanes.second),
            ab = dot3(lanes.first, lanes.second), da = dot3(lanes.first, lanes.away),
            db = dot3(lanes.second, lanes.away);
  const auto value = [&](Vec x, Vec y) { return x * (aa * x + 2.0 * (ab * y - da)) + y * (bb * y - 2.0 * db); };
  v = unit_clamp(da / larger(aa, zero() + kNoLength));
  w = zero();
  Vec least = value(v, w);
  const auto take = [&](IntVec wanted, Vec x, Vec y, Vec there) {
    v = select(wanted, x, v);
    w = select(wanted, y, w);
    least = select(wanted, there, least);
  };
  const Vec along_second = unit_clamp(db / larger(bb, zero() + kNoLength));
  const Vec on_second = value(zero(), along_second);
  take(on_second < least, zero(), along_second, on_second);
  const Vec third = aa + bb - 2.0 * ab;
  const Vec along_third = unit_clamp((aa - ab - da + db) / larger(third, zero() + kNoLength));
  const Vec on_third = value(1.0 - along_third, along_third);
  take(on_third < least, 1.0 - along_third, along_third, on_third);
  const Vec area = aa * bb - ab * ab;
  const Vec foot_v = bb * da - ab * db, foot_w = aa * db - ab * da;
  const IntVec inside = (foot_v > 0.0) & (foot_w > 0.0) & (foot_v + foot_w < area);
  const Vec scale = 1.0 / larger(area, zero() + kNoLength);
  const Vec on_face = value(foot_v * scale, foot_w * scale);
  take(inside & (on_face < least), foot_v * scale, foot_w * scale, on_face);
  return lanes.squared_distance(v, w) - kTriangleRounding * dot3(lanes.away, lanes.away);
}

unsigned triangle_distances(const double* corners, const double* point, double limit, double* squared) {
  unsigned near = 0;
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec v, w;
    const Vec distance = larger(nearest_on_triangles(TriangleLanes(corners + at, point), v, w), zero());
    store(squared + at, distance);
    near |= bits(distance <= limit) << at;
  }
  return near;
}

unsigned approached_triangles(const double* corners, const double* point, const double* rest_corners,
                              const double* rest_point, double share, double limit, double* squared) {
  unsigned near = 0;
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec v, w;
    const Vec distance = larger(nearest_on_triangles(TriangleLanes(corners + at, point), v, w), zero());
    const Vec at_rest = TriangleLanes(rest_corners + at, rest_point).squared_distance(v, w);
    store(squared + at, distance);
    near |= bits((distance <= limit) & (distance < share * at_rest)) << at;
  }
  return near;
}

unsigned approachable_triangles(const double* corners, const double* point, const double* rest_corners,
                                const double* rest_point, double share, double beyond, double limit) {
  unsigned near = 0;
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec now[3][3], at_rest[3][3];
    for (Index corner = 0; corner < 3; ++corner)
      for (Index axis = 0; axis < 3; ++axis) {
        const Index begin = (3 * corner + axis) * kLanes + at;
        now[corner][axis] = load(corners + begin) - point[axis];
        at_rest[corner][axis] = load(rest_corners + begin) - rest_point[axis];
      }
    // Squared distances are quadratic over a triangle: nowhere below the least coefficient in Bernstein's basis.
    Vec distance = dot3(now[0], now[0]);
    Vec approach = distance - share * dot3(at_rest[0], at_rest[0]);
    for (Index i = 1; i < 3; ++i)
      for (Index j = 0; j <= i; ++j) {
        const Vec coefficient = dot3(now[i], now[j]);
        distance = smaller(distance, coefficient);
        approach = smaller(approach, coefficient - share * dot3(at_rest[i], at_rest[j]));
      }
    near |= bits((distance <= limit) & (approach < beyond)) << at;
  }
  return near;
}

void gather_triangles(const double* points, const int* vertices, double* corners, double* box) {
  for (Index corner = 0; corner < 3; ++corner)
    for (Index lane = 0; lane < kLanes; ++lane) {
      const double* const point = points + 3 * vertices[corner * kLanes + lane];
      for (Index axis = 0; axis < 3; ++axis) corners[(3 * corner + axis) * kLanes + lane] = point[axis];
    }
  for (Index axis = 0; axis < 3; ++axis) {
    Vec lowest = load(corners + axis * kLanes), highest = lowest;
    for (Index at = 0; at < kLanes; at += kWidth)
      for (Index corner = 0; corner < 3; ++corner) {
        const Vec place = load(corners + (3 * corner + axis) * kLanes + at);
        lowest = select(place < lowest, place, lowest);
        highest = larger(place, highest);
      }
    double least = lowest[0], most = highest[0];
    for (Index i = 1; i < kWidth; ++i) {
      least = lowest[i] < least ? lowest[i] : least;
      most = highest[i] > most ? highest[i] : most;
    }
    box[axis * kLanes] = least;
    box[(3 + axis) * kLanes] = most;
  }
}

inline Vec square(Vec v) { return v * v; }

/// Squares of the least distances between boxes `own` and those of kWidth leaves.
inline Vec squared_gaps(const double* boxes, const double* own) {
  Vec sum = zero();
  for (Index axis = 0; axis < 3; ++axis) {
    const Vec above = load(boxes + axis * kLanes) - own[3 + axis],
              below = own[axis] - load(boxes + (3 + axis) * kLanes);
    sum += square(larger(larger(above, below), zero()));
  }
  return sum;
}
/// Squares of the largest distances.
inline Vec squared_spans(const double* boxes, const double* own) {
  Vec sum = zero();
  for (Index axis = 0; axis < 3; ++axis)
    sum += square(larger(load(boxes + (3 + axis) * kLanes) - own[axis], own[3 + axis] - load(boxes + axis * kLanes)));
  return sum;
}

Index near_leaves(const LeafBoxes& leaves, const LeafQuery& query, const LeafPanel* panels, Index count,
                  LeafPanel* kept) {
  constexpr Index kNumbers = 6 * kLanes;
  Index found = 0;
  for (Index i = 0; i < count; ++i) {
    const LeafPanel from = panels[i];
    unsigned lanes = 0;
    for (Index at = 0; at < kLanes; at += kWidth) {
      const Index begin = from.panel * kNumbers + at;
      const Vec gaps = squared_gaps(leaves.places + begin, query.places);
      IntVec near = gaps <= query.radius * query.radius;
      const Vec at_rest = squared_spans(leaves.rest + begin, query.rest);
      near &= query.beyond > 0 ? gaps < square(query.share * square_root(at_rest) + query.beyond)
                               : gaps < query.share * query.share * at_rest;
      if (leaves.velocities != nullptr && bits(near) != 0)
        near &= gaps <= square(query.near +
                               query.time * square_root(squared_spans(leaves.velocities + begin, query.velocities)));
      lanes |= bits(near) << at;
    }
    lanes &= from.lanes;
    if (lanes != 0) kept[found++] = {from.panel, lanes};
  }
  return found;
}
