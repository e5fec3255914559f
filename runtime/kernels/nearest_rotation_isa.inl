// The nearest rotation, for materials_isa.inl, which includes this file.

/// F = R S with R the rotation of the largest tr S. As a quaternion it is the eigenvector of the largest eigenvalue of
/// a symmetric 4 x 4 K (Horn 1987), tr S, whose distance to the next one is 2 (s_1 + s_2), twice the least sum of two
/// eigenvalues of S. Newton's method from R = I finds it in a few steps as a rule. Where a lane does not get there:
/// Laguerre's method from above on the characteristic polynomial, inverse iteration by the adjugate squared thrice, two
/// steps of Newton's method. To rounding / distance where the distance is more than 1e-4 |F|; some rotation, of a trace
/// as large to 1e-4 |F|, where it is less.
struct NearestRotation {
  Vec turned[9];   ///< R - I
  Vec stretch[9];  ///< F - R
  Vec trace;       ///< tr S - 3
  Vec size;        ///< |F|

  explicit NearestRotation(const Vec* H) {
    Vec F[9], q[4];
    add_identity(H, F);
    size = square_root(larger(dot(F, F, 9), zero() + 1e-300));
    if (!converge(H, q)) {
      for (Index i = 0; i < 9; ++i) F[i] /= size;
      start(F, q);
      for (Index i = 0; i < kRefinements; ++i) {
        set_rotation(H, q);
        refine(q);
      }
    }
    set_rotation(H, q);
    trace = turned[0] * stretch[0] + stretch[0];
    for (Index i = 1; i < 9; ++i) trace += turned[i] * stretch[i] + (i % 4 == 0 ? stretch[i] : zero());
  }

  /// R^T (F - R), without the identity that S has besides.
  void rotated_stretch(Vec* M) const {
    for (Index i = 0; i < 3; ++i)
      for (Index j = 0; j < 3; ++j)
        M[3 * i + j] = stretch[3 * i + j] + turned[i] * stretch[j] + turned[3 + i] * stretch[3 + j] +
                       turned[6 + i] * stretch[6 + j];
  }

  /// Inverse of G = tr(S) I - S of M = R^T F - I; G has the sums of two eigenvalues of S. Returns det G.
  Vec inverse_sums(const Vec* M, Vec* inverse) const {
    Vec G[9];
    const Vec diagonal = 2.0 + M[0] + M[4] + M[8];
    for (Index i = 0; i < 3; ++i)
      for (Index j = 0; j < 3; ++j) G[3 * i + j] = i == j ? diagonal - M[4 * i] : -0.5 * (M[3 * i + j] + M[3 * j + i]);
    cofactors(G, inverse);
    const Vec determinant = dot(G, inverse, 3);
    const Vec factor = 1.0 / larger(determinant, kLeastDeterminant * size * size * size + 1e-300);
    for (Index i = 0; i < 9; ++i) inverse[i] *= factor;
    return determinant;
  }

 private:
  static constexpr Index kDirectSteps = 5, kLaguerreSteps = 6, kSquarings = 3, kRefinements = 2;
  static constexpr double kLastTurn = 1e-11;          // square of half the angle of a step whose cube is below rounding
  static constexpr double kShift = 1e-5;              // above the eigenvalue, so that the adjugate does not vanish
  static constexpr double kLeastDeterminant = 1e-12;  // of G

  /// tr S for |F| = 1: the largest root of x^4 - 2 x^2 - 8 det F x + 1 - 4 |cof F|^2. All are real: it is approached
  /// from above.
  static Vec largest_trace(const Vec* F) {
    Vec cofactor[9];
    cofactors(F, cofactor);
    const Vec linear = 8.0 * dot(F, cofactor, 3), constant = 1.0 - 4.0 * dot(cofactor, cofactor, 9);
    Vec x = zero() + 1.7320508075688772;
    for (Index i = 0; i < kLaguerreSteps; ++i) {
      const Vec square = x * x;
      const Vec value = ((square - 2.0) * x - linear) * x + constant;
      const Vec slope = 4.0 * (square - 1.0) * x - linear, curvature = 12.0 * square - 4.0;
      const Vec root = square_root(larger(9.0 * slope * slope - 12.0 * value * curvature, zero()));
      x -= larger(4.0 * value / (slope + root + 1e-300), zero());
    }
    return x;
  }

  static void start(const Vec* F, Vec* q) {
    const Vec t = F[0] + F[4] + F[8], x = largest_trace(F) + kShift;
    // Upper triangle of x I - K by rows.
    Vec X[10];
    X[0] = x - t;
    X[1] = F[5] - F[7];
    X[2] = F[6] - F[2];
    X[3] = F[1] - F[3];
    X[4] = x + t - 2.0 * F[0];
    X[5] = -F[1] - F[3];
    X[6] = -F[2] - F[6];
    X[7] = x + t - 2.0 * F[4];
    X[8] = -F[5] - F[7];
    X[9] = x + t - 2.0 * F[8];
    Vec adjugate[10];
    set_adjugate(X, adjugate);
    for (Index i = 0; i < kSquarings; ++i) square(adjugate);
    Vec largest = adjugate[0];
    for (Index j = 0; j < 4; ++j) q[j] = adjugate[j];
    for (Index i = 1; i < 4; ++i) {
      const Vec diagonal = adjugate[triangle_entry<4>(i, i)];
      const IntVec better = diagonal > largest;
      largest = select(better, diagonal, largest);
      for (Index j = 0; j < 4; ++j) q[j] = select(better, adjugate[triangle_entry<4>(i, j)], q[j]);
    }
    normalise(q);
  }

  /// By the 2 x 2 minors of the first two and of the last two rows.
  static void set_adjugate(const Vec* X, Vec* C) {
    const auto x = [X](Index i, Index j) { return X[triangle_entry<4>(i, j)]; };
    const auto minor = [&x](Index row, Index i, Index j) {
      return x(row, i) * x(row + 1, j) - x(row, j) * x(row + 1, i);
    };
    const Vec m01 = minor(2, 0, 1), m02 = minor(2, 0, 2), m03 = minor(2, 0, 3), m12 = minor(2, 1, 2),
              m13 = minor(2, 1, 3), m23 = minor(2, 2, 3);
    const Vec n01 = minor(0, 0, 1), n02 = minor(0, 0, 2), n03 = minor(0, 0, 3), n12 = minor(0, 1, 2),
              n13 = minor(0, 1, 3);
    C[0] = x(1, 1) * m23 - x(1, 2) * m13 + x(1, 3) * m12;
    C[1] = x(1, 2) * m03 - x(1, 0) * m23 - x(1, 3) * m02;
    C[2] = x(1, 0) * m13 - x(1, 1) * m03 + x(1, 3) * m01;
    C[3] = x(1, 1) * m02 - x(1, 0) * m12 - x(1, 2) * m01;
    C[4] = x(0, 0) * m23 - x(0, 2) * m03 + x(0, 3) * m02;
    C[5] = x(0, 1) * m03 - x(0, 0) * m13 - x(0, 3) * m01;
    C[6] = x(0, 0) * m12 - x(0, 1) * m02 + x(0, 2) * m01;
    C[7] = x(3, 0) * n13 - x(3, 1) * n03 + x(3, 3) * n01;
    C[8] = x(3, 1) * n02 - x(3, 0) * n12 - x(3, 2) * n01;
    C[9] = x(2, 0) * n12 - x(2, 1) * n02 + x(2, 2) * n01;
  }

  /// X <- X^2 / tr(X)^2.
  static void square(Vec* X) {
    const Vec scale = 1.0 / (X[0] + X[4] + X[7] + X[9]);
    Vec product[10];
    for (Index i = 0; i < 10; ++i) X[i] *= scale;
    for (Index i = 0, entry = 0; i < 4; ++i)
      for (Index j = i; j < 4; ++j, ++entry) {
        product[entry] = zero();
        for (Index k = 0; k < 4; ++k) product[entry] += X[triangle_entry<4>(i, k)] * X[triangle_entry<4>(j, k)];
      }
    for (Index i = 0; i < 10; ++i) X[i] = product[i];
  }

  static void normalise(Vec* q) {
    const Vec factor = 1.0 / square_root(dot(q, q, 4));
    for (Index i = 0; i < 4; ++i) q[i] *= factor;
  }

  void set_rotation(const Vec* H, const Vec* q) {
    const Vec w = q[0], x = q[1], y = q[2], z = q[3];
    turned[0] = -2.0 * (y * y + z * z);
    turned[1] = 2.0 * (x * y - w * z);
    turned[2] = 2.0 * (x * z + w * y);
    turned[3] = 2.0 * (x * y + w * z);
    turned[4] = -2.0 * (x * x + z * z);
    turned[5] = 2.0 * (y * z - w * x);
    turned[6] = 2.0 * (x * z - w * y);
    turned[7] = 2.0 * (y * z + w * x);
    turned[8] = -2.0 * (x * x + y * y);
    for (Index i = 0; i < 9; ++i) stretch[i] = H[i] - turned[i];
  }

  /// From R = I; false where a lane needs more steps, or would end in no maximum.
  bool converge(const Vec* H, Vec* q) {
    q[0] = zero() + 1.0;
    for (Index i = 1; i < 4; ++i) q[i] = zero();
    for (Index i = 0; i < kDirectSteps; ++i) {
      set_rotation(H, q);
      if (all(refine(q))) return true;
    }
    return false;
  }

  /// A step towards the largest tr(R^T F) from R^T (F - R), which has the digits of H. Tells the lanes where it was the
  /// last one towards a maximum: short, and G positive definite.
  IntVec refine(Vec* q) const {
    Vec M[9], inverse[9];
    rotated_stretch(M);
    const Vec determinant = inverse_sums(M, inverse);
    const Vec skew[3] = {M[7] - M[5], M[2] - M[6], M[3] - M[1]};
    Vec turn[3];
    for (Index i = 0; i < 3; ++i) turn[i] = 0.5 * dot(inverse + 3 * i, skew, 3);
    const Vec w = q[0], x = q[1], y = q[2], z = q[3];
    q[0] = w - x * turn[0] - y * turn[1] - z * turn[2];
    q[1] = x + w * turn[0] + y * turn[2] - z * turn[1];
    q[2] = y + w * turn[1] + z * turn[0] - x * turn[2];
    q[3] = z + w * turn[2] + x * turn[1] - y * turn[0];
    normalise(q);
    // Positive definite by the minors from the last: 1 x 1, 2 x 2 and 3 x 3.
    return (dot(turn, turn, 3) <= kLastTurn) & (2.0 + M[0] + M[4] > 0.0) & (inverse[0] > 0.0) & (determinant > 0.0);
  }
};
