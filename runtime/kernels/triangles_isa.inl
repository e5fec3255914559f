// Part of kernels_isa.inl, which includes this file: distances from kLanes triangles at once.

/// What the squared terms of a distance may be wrong by, of the square of the way to the first corner.
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

inline Vec dot3(const Vec* a, const Vec* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
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

void triangle_distances(const double* corners, const double* point, double* squared) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec v, w;
    store(squared + at, larger(nearest_on_triangles(TriangleLanes(corners + at, point), v, w), zero()));
  }
}

void approached_triangles(const double* corners, const double* point, const double* rest_corners,
                          const double* rest_point, double share, double* squared) {
  for (Index at = 0; at < kLanes; at += kWidth) {
    Vec v, w;
    const Vec distance = larger(nearest_on_triangles(TriangleLanes(corners + at, point), v, w), zero());
    const Vec at_rest = TriangleLanes(rest_corners + at, rest_point).squared_distance(v, w);
    store(squared + at, select(distance <= share * at_rest, distance, zero() + __builtin_inf()));
  }
}
