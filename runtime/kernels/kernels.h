#pragma once

#include <cstddef>

namespace exmat::runtime {

// The inner loops of a step, compiled once for each instruction set and chosen at run time. They see plain arrays,
// neither Eigen nor standard containers: whatever they include is compiled for their instruction set alone. Arrays are
// padded with zeros: elements in panels of kLanes, modes to `stride`, a multiple of kLanes; they run fastest at
// kAlignment.

inline constexpr std::ptrdiff_t kLanes = 8;
inline constexpr std::size_t kAlignment = 64;

/// `count` rounded up to a multiple of kLanes.
constexpr std::ptrdiff_t padded(std::ptrdiff_t count) { return (count + kLanes - 1) / kLanes * kLanes; }

/// dF/dq of s elements in two layouts.
struct ElementArrays {
  std::ptrdiff_t panels = 0;           ///< padded(s) / kLanes
  std::ptrdiff_t modes = 0;            ///< r
  std::ptrdiff_t stride = 0;           ///< padded(r)
  const double* by_mode = nullptr;     ///< panels x r x 9 x kLanes: gradients and forces of a panel at once
  const double* by_element = nullptr;  ///< padded(s) x 9 x stride: of bodies side by side
  const float* by_pair = nullptr;      ///< padded(s) / 2 x 9 x stride x 2: of two elements side by side, rounded
  std::ptrdiff_t count = 0;            ///< s
};

/// Energy of a panel's elements as a function of their displacement gradients H = F - I. Weighted: c_j Psi.
struct ElementLaw {
  enum class Kind {
    /// A material of common/elastic: mu, lambda, each panels x kLanes, c_j mu and c_j lambda. With shifts H_k (panels x
    /// count x 9 x kLanes): sum_k shift_weights[k] Psi(I + H - H_k), and with inverses too (panels x count x 10 x
    /// kLanes: A_k = (I + H_k)^-1 and v_k): sum_k shift_weights[k] v_k Psi((I + H) A_k).
    kStVenantKirchhoff,
    kStableNeoHookean,
    kCorotational,
    /// 1/2 E : C : E - S0 : E + constant, E the Green strain: panels x 28 x kLanes, the upper triangle of C by rows in
    /// the order xx, yy, zz, yz, xz, xy, then S0 and the constant. Strains count once, so shears twice in a double dot.
    kQuadraticInGreenStrain,
  };
  Kind kind = Kind::kStVenantKirchhoff;
  const double* mu = nullptr;
  const double* lambda = nullptr;
  std::ptrdiff_t shift_count = 0;  ///< 0: Psi(I + H)
  const double* shifts = nullptr;
  const double* inverses = nullptr;  ///< null: A_k = I, v_k = 1
  const double* shift_weights = nullptr;
  const double* quadratic = nullptr;
};
inline constexpr std::ptrdiff_t kQuadraticNumbers = 28;
inline constexpr std::ptrdiff_t kInverseNumbers = 10;
inline constexpr std::ptrdiff_t kTangentNumbers = 45;  ///< upper triangle by rows of a symmetric 9 x 9

/// Scratch of the functions below.
struct ElementScratch {
  double* force = nullptr;      ///< stride x kLanes
  double* stiffness = nullptr;  ///< lane_triangle(r) / kLanes
};

inline constexpr std::ptrdiff_t kGemmMultiple = 24;

// kLanes bodies side by side: vectors are r x kLanes, a body in each lane; symmetric matrices the lower triangle of
// blocks of kLaneBlock x kLaneBlock by rows, each block by rows, a body in each lane. Blocks on the diagonal are whole,
// only their lower triangles are read. Rows are padded to lane_rows(r).
inline constexpr std::ptrdiff_t kLaneBlock = 4;
constexpr std::ptrdiff_t lane_rows(std::ptrdiff_t modes) { return (modes + kLaneBlock - 1) / kLaneBlock * kLaneBlock; }
/// Doubles of a symmetric matrix of each body.
constexpr std::ptrdiff_t lane_triangle(std::ptrdiff_t modes) {
  return lane_rows(modes) * (lane_rows(modes) + kLaneBlock) / 2 * kLanes;
}
/// Position of the entry of row i and column j <= i, of the first lane.
constexpr std::ptrdiff_t lane_entry(std::ptrdiff_t i, std::ptrdiff_t j) {
  const std::ptrdiff_t row = i / kLaneBlock, column = j / kLaneBlock;
  return ((row * (row + 1) / 2 + column) * kLaneBlock * kLaneBlock + i % kLaneBlock * kLaneBlock + j % kLaneBlock) *
         kLanes;
}
/// The stiffness of St.Venant-Kirchhoff, K0_ij + C_ijk q_k + 1/2 D_ijkl q_k q_l, C and D symmetric in all indices; of r
/// <= kMostPolynomialModes.
struct StiffnessPolynomialArrays {
  std::ptrdiff_t modes = 0;          ///< r
  const double* constant = nullptr;  ///< lane_triangle(r) / kLanes, K0_ij at lane_entry(i, j) / kLanes
  /// For each i the lower triangle of j, k <= i in blocks of kLaneBlock x kLaneBlock by rows, without padding. Of each
  /// block r + 1 times its numbers by rows, of those on the diagonal the lower triangle: C_ijk, then 1/2 D_ijkl of each
  /// l.
  const double* numbers = nullptr;
  const float* rounded = nullptr;  ///< the same, 1 and 0, 2 and 1 ... of l beside each other, r / 2 + 1 such pairs
};
inline constexpr std::ptrdiff_t kMostPolynomialModes = 32;

/// Form of a step of kLanes bodies: vectors [r] and numbers of each, see StepForm and IncrementalPotential.
struct LaneForm {
  std::ptrdiff_t modes = 0;
  const double *start = nullptr, *external = nullptr, *velocity_centre = nullptr, *acceleration_centre = nullptr;
  const double *velocity_factor = nullptr, *acceleration_factor = nullptr, *mass_damping = nullptr,
               *stiffness_damping = nullptr;
};
/// Sums of lanes_assemble(): offset . (A offset), linear . offset, and the squares of the internal force, of x less the
/// centre of the acceleration, of x and of the gradient.
inline constexpr std::ptrdiff_t kLaneSums = 6;

/// The rotation of kLanes free bodies, see DeformingInertia and FreeMotionWorkspace. r modes, padded to `stride`.
struct LaneRotationArrays {
  // Arrays of the model.
  std::ptrdiff_t modes = 0, stride = 0;
  const double* stacked = nullptr;         ///< 9 stride x r by columns: S_ab of six pairs, A_c
  const double* linear = nullptr;          ///< r x 6 by columns
  const double* second_moments = nullptr;  ///< 6
  // Numbers of a step of each body: c_v, q_v [r], and the problem of its spin.
  const double *velocity_factor = nullptr, *velocity_centre = nullptr;
  const double *momentum = nullptr, *offset = nullptr, *factor = nullptr;
  // Results that the calls below leave for each other.
  double *spin = nullptr, *rotation = nullptr;  ///< 3 each, the spin as its first guess at first
  double* inverse_inertia = nullptr;            ///< 9
  double* products = nullptr;                   ///< 9 x r, stacked q
  double* centre_products = nullptr;            ///< 3 x r, A_c q_v
  double* factors = nullptr;                    ///< r x 12: rows of (D + V)^T, of H^T, and those times J^-1
};

/// The rotation of one body, see DeformingInertia. r modes; matrices in panels, see Kernels::panel_product. S_xx q is
/// q - S_yy q - S_zz q, since the mass of the modes is the identity.
struct RotationArrays {
  std::ptrdiff_t modes = 0;
  const double* panels = nullptr;          ///< 5 r rows padded, S_ab of yy, zz, yz, xz, xy
  const double* turning_panels = nullptr;  ///< 3 r rows padded, -A_c
  const double* linear = nullptr;          ///< r x 6 by columns, p1_ab
};
/// Layout of the products of a pose: S_ab q of xx, yy, zz, yz, xz, xy at first; from here on -A_c q.
constexpr std::ptrdiff_t rotation_turns(std::ptrdiff_t modes) { return padded(modes + padded(5 * modes)); }
constexpr std::ptrdiff_t rotation_products(std::ptrdiff_t modes) { return rotation_turns(modes) + padded(3 * modes); }

/// The points of a convex hull that may be the nearest one, each an affine function of the load: see ExampleWeights.
struct WeightCandidates {
  static constexpr std::ptrdiff_t kMostExamples = 4;

  std::ptrdiff_t examples = 0;  ///< K <= kMostExamples
  std::ptrdiff_t count = 0;     ///< N
  const double* numbers =
      nullptr;  ///< K x K x padded(N): value k of n is numbers[k, 0, n] + sum_j>0 numbers[k, j, n] load_j
  const double* members = nullptr;  ///< K x padded(N): 1 where that is a weight, 0 where it is a slope
};

/// See BernsteinBasis.
struct BernsteinArrays {
  std::ptrdiff_t degree = 0, weights = 0;  ///< D, K >= 2
  const double* binomials = nullptr;       ///< D + 1 columns, n over a at a + n (D + 1)
  double smallest_power = 0;               ///< powers below it are taken as zero
};
/// Doubles of scratch of lanes_bernstein().
constexpr std::ptrdiff_t lane_bernstein_scratch(std::ptrdiff_t degree, std::ptrdiff_t weights) {
  return (weights * (degree + 1) + (degree + 1) * (degree + 2) / 2) * kLanes;
}

/// Boxes about the leaves of a tree, kLanes side by side: panels x 6 x kLanes, lowest x, y, z, highest x, y, z.
struct LeafBoxes {
  const double* places = nullptr;
  const double* velocities = nullptr;  ///< null where nothing moves
  const double* rest = nullptr;        ///< boxes of the places at rest
};
/// Query for leaves near some points. Their boxes are six numbers, as above.
struct LeafQuery {
  double places[6] = {}, velocities[6] = {}, rest[6] = {};
  double radius = 0;             ///< leaves farther away than this are far
  double near = 0, time = 0;     ///< and, of what moves, what is farther away than `near` and the way of both in `time`
  double share = 0, beyond = 0;  ///< and what is no nearer than `share` of how far it is at most at rest, and `beyond`
};
/// Some leaves of kLanes side by side: a bit for each.
struct LeafPanel {
  int panel = 0;
  unsigned lanes = 0;
};

/// kLanes vertices beside planes that stand, by the law of contact_law.h, whose names these are. Lanes that are not in
/// use have no stiffness.
struct alignas(kAlignment) PlaneContactPanel {
  // Constants of a step.
  double rest[3][kLanes] = {};     ///< X, frame of the body [m]
  double normal[3][kLanes] = {};   ///< n_0
  double start[3][kLanes] = {};    ///< x_0 [m]
  double stretch[3][kLanes] = {};  ///< x_0 - anchor, along the plane [m]
  double distance[kLanes] = {};    ///< signed distance of x_0 from the plane [m]
  double stiffness[kLanes] = {};   ///< kappa [N/m]
  double damping[kLanes] = {};     ///< gamma
  double share[kLanes] = {};       ///< 1 / (1 + gamma)
  double friction[kLanes] = {};    ///< mu lambda [N]
  // Results of the last evaluation.
  double arm[3][kLanes] = {};        ///< x - position [m]
  double force[3][kLanes] = {};      ///< on the vertex [N]
  double slip[3][kLanes] = {};       ///< y [m]
  double normal_force[kLanes] = {};  ///< [N]
  double gap[kLanes] = {};           ///< [m]
};
/// Sums of evaluations: force and torque, W, the stiffness of those that touch, and their number.
inline constexpr std::ptrdiff_t kPlaneSums = 9;
inline constexpr std::ptrdiff_t kPlaneFactors = 3 * kLanes;

// All vertices of a mesh. Fields hold four numbers for each of the n vertices that move: x, y, z and 0.
inline constexpr std::ptrdiff_t kMeshLanes = 16;  ///< elements of a panel, of the floats of a wide register

inline constexpr std::ptrdiff_t kMeshGroup = 4;
/// Elements of common/mesh/elements.h, and two symmetric scalar matrices [n x n] on one pattern. kMeshGroup
/// lists stand side by side, number by number, as long as the longest of them: the others end with zeros.
struct MeshArrays {
  std::ptrdiff_t vertices = 0;               ///< n
  std::ptrdiff_t panels = 0;                 ///< panels of kMeshLanes elements; those that pad have no corners
  const int* starts = nullptr;               ///< panels x kMeshLanes / kMeshGroup + 1, into lists, see above
  const int* corners = nullptr;              ///< vertices of each element that move
  const double* gradients = nullptr;         ///< three of each corner [1/m], and one more number at the end
  const float* rounded_gradients = nullptr;  ///< the same
  /// panels x kMeshLanes, V beta mu of smoothed elements: the variance term is that of the tets less this of the rings.
  const double* variance = nullptr;
  const int* rows = nullptr;        ///< n, in an order in which rows of one length are together
  const int* row_starts = nullptr;  ///< n + 1, in that order, into `columns`
  const int* columns = nullptr;
  const int* around_starts = nullptr;               ///< of each kMeshGroup of `rows`, and one more, into lists
  const int* around = nullptr;                      ///< elements that have the vertex as a corner
  const double* gradients_around = nullptr;         ///< three of each, and one more number at the end, as above
  const float* rounded_gradients_around = nullptr;  ///< the same
  const double* mass = nullptr;                     ///< [kg]
  const double* variance_matrix = nullptr;          ///< sum over the tets of V beta mu grad N_i . grad N_j [N/m]
};

/// Fields of a step's potential besides the law: x, a = q - q_a and w = q - q_v, see StepForm.
struct MeshInertia {
  const double *displacement = nullptr, *offset = nullptr, *rate = nullptr;
  double acceleration_factor = 0;  ///< c_a
  double mass_damping = 0;         ///< alpha c_v
  double stiffness_damping = 0;    ///< beta c_v
};
/// Inertia 1/2 c_a a M a, damping 1/2 c_v w D w, elastic energy, that of an elastic example force [J].
inline constexpr std::ptrdiff_t kMeshSums = 4;
inline constexpr std::ptrdiff_t kMeshLine = 16;  ///< numbers of scratch of an element

inline constexpr std::ptrdiff_t kFactorBlock = 4;
/// L L^T of a scalar matrix in blocks of kFactorBlock rows and columns, each by rows; what pads the last one is zero.
struct MeshFactor {
  std::ptrdiff_t blocks = 0;        ///< along the diagonal
  const int* starts = nullptr;      ///< blocks + 1, into `rows`
  const int* rows = nullptr;        ///< of the blocks below each one on the diagonal that are not zero
  const float* values = nullptr;    ///< those blocks
  const float* diagonal = nullptr;  ///< inverse of each block on the diagonal, and its transpose
};

/// Scalar functions of n vertices, columns of a matrix in blocks of kFactorBlock vertices x kFactorBlock functions,
/// each by rows; what pads the last ones is zero. Coefficients: four numbers of each function, of as many as blocks
/// have.
template <class Number>
struct MeshFilter {
  std::ptrdiff_t vertices = 0;     ///< n
  std::ptrdiff_t blocks = 0;       ///< of functions
  const int* starts = nullptr;     ///< blocks + 1, into `rows`
  const int* rows = nullptr;       ///< blocks of vertices where a block of functions is not zero
  const Number* values = nullptr;  ///< those blocks
};

struct Kernels {
  const char* name;

  /// sum_j c_j Psi(H_j), H = B q; q [r].
  double (*energy)(const ElementArrays&, const ElementLaw&, const double* q);
  /// And force [r] = its derivative.
  double (*force)(const ElementArrays&, const ElementLaw&, const double* q, const ElementScratch&, double* force);
  /// And stiffness = its second derivative: lower triangle of r columns, `outer` apart.
  double (*force_and_stiffness)(const ElementArrays&, const ElementLaw&, const double* q, const ElementScratch&,
                                double* force, double* stiffness, std::ptrdiff_t outer);
  /// The same stiffness alone from given weighted tangents: panels x 45 x kLanes.
  void (*stiffness_of_tangents)(const ElementArrays&, const double* tangents, const ElementScratch&, double* stiffness,
                                std::ptrdiff_t outer);
  /// tangents: panels x 45 x kLanes, the weighted ones of the law at H = B q.
  void (*tangents)(const ElementArrays&, const ElementLaw&, const double* q, double* tangents);

  /// product [kLanes blocks] = D y, D symmetric in blocks of kLanes x kLanes: the lower block triangle by block
  /// columns, each block column-major.
  void (*symmetric_product)(const double* D, std::ptrdiff_t blocks, const double* y, double* product);

  /// y [rows] = A x, columns `outer` apart; rows a multiple of kLanes.
  void (*matrix_vector)(const double* A, std::ptrdiff_t rows, std::ptrdiff_t columns, std::ptrdiff_t outer,
                        const double* x, double* y);

  /// y [panels x kLanes] = A x, A in panels of kLanes rows, each by columns.
  void (*panel_product)(const double* A, std::ptrdiff_t panels, std::ptrdiff_t columns, const double* x, double* y);

  // Rotation of one body. Products of the pose: rotation_products(); products of the velocity [3 r] are -A_c v.

  /// Products of the pose q [r], and sums [6] = q . (p1_ab + S_ab q). Where there is a `centre` [r], not null, its
  /// -A_c centre too [padded(3 r)].
  void (*rotation_moments)(const RotationArrays&, const double* q, const double* centre, double* products,
                           double* centre_products, double* sums);
  /// sums [3] of the columns [r x 3] times x [r].
  void (*rotation_dots)(std::ptrdiff_t modes, const double* columns, const double* x, double* sums);
  /// force [r] = sum_ab slopes_ab (p1_ab + 2 S_ab q) - sum_c by_velocity_c A_c v - sum_c by_pose_c A_c q.
  void (*rotation_force)(const RotationArrays&, const double* products, const double* velocity_products,
                         const double* slopes, const double* by_velocity, const double* by_pose, double* force);
  /// As add_rotation_stiffness(), without softening. factors [r x 12] by columns: (D + V)^T, J^-1 times that and times
  /// H^T, and the last times c_v^2; inverse_inertia [9], `rate` c_v.
  void (*rotation_stiffness)(const RotationArrays&, const double* products, const double* velocity_products,
                             double rate, const double* spin, const double* inverse_inertia, double* factors,
                             double* hessian, std::ptrdiff_t outer);
  /// As gyroscopic_product(), of those factors; deformation [r x 3] is H^T; scratch padded(3 r).
  void (*rotation_product)(const RotationArrays&, const double* deformation, const double* factors, double rate,
                           const double* spin, const double* x, double* scratch, double* product);

  /// L L^T = A of the lower triangle, columns `outer` apart in A and padded(n) in L, whose diagonal holds 1 / L_ii.
  /// False where a pivot is not positive and finite.
  bool (*cholesky)(const double* A, std::ptrdiff_t n, std::ptrdiff_t outer, double* L);
  /// x <- A^-1 x, x padded(n) long.
  void (*cholesky_solve)(const double* L, std::ptrdiff_t n, double* x);

  /// C [n x n, row-major] += A^T B, n a multiple of kGemmMultiple; A in panels of 8 columns (n/8 x n x 8), B in panels
  /// of 24 (n/24 x n x 24). The rate of a large one is the limit that a step is compared with.
  void (*gemm)(std::ptrdiff_t n, const double* A, const double* B, double* C);

  /// positions [16 blocks] = rest + basis q in single precision; basis: blocks x r x 16.
  void (*positions)(const float* rest, const float* basis, std::ptrdiff_t blocks, std::ptrdiff_t modes, const float* q,
                    float* positions);

  // Products of vertices, whose three rows have `stride` numbers each, a multiple of kLanes; row 3 v is the first of
  // vertex v.

  /// products [3 count]: the rows of each of `vertices` times x [stride].
  void (*vertex_products)(const double* rows, std::ptrdiff_t stride, const int* vertices, std::ptrdiff_t count,
                          const double* x, double* products);
  /// sums [stride] += those of the rows of each of `vertices` times the three numbers of its vector [3 count].
  void (*add_vertex_loads)(const double* rows, std::ptrdiff_t stride, const int* vertices, std::ptrdiff_t count,
                           const double* vectors, double* sums);
  /// The same sums [stride] one by one, each `outer` after the last.
  void (*vertex_loads)(const double* rows, std::ptrdiff_t stride, const int* vertices, std::ptrdiff_t count,
                       const double* vectors, double* loads, std::ptrdiff_t outer);
  /// Upper triangle, by rows, of squares [stride x stride] += F^T F, F [count x stride] by rows; blocks on the diagonal
  /// are whole.
  void (*add_squares)(const double* factors, std::ptrdiff_t count, std::ptrdiff_t stride, double* squares);

  // Contacts of kLanes vertices beside planes, at a pose [12]: rotation by rows, position. products [3 x kLanes], by
  // vertices: how far each is from rest, frame of the body.

  /// Evaluates the contacts; forces in the body's frame, as the products are, into `turned`. sums [kPlaneSums x kLanes]
  /// += what each adds. Returns a bit for each that has a normal force or friction.
  unsigned (*plane_contacts)(PlaneContactPanel&, const double* pose, const double* products, double* turned,
                             double* sums);
  /// sums [kLanes] += W.
  void (*plane_potential)(const PlaneContactPanel&, const double* pose, const double* products, double* sums);
  /// -df/dx of the last evaluation as a sum of squares, see StiffnessFactors. Of each factor: vectors [3], in the frame
  /// of the body, rigid [6], force and torque, and the lane of its vertex. Returns how many: at most kPlaneFactors.
  std::ptrdiff_t (*plane_factors)(const PlaneContactPanel&, const double* pose, double* vectors, double* rigid,
                                  int* lanes);

  // Distances from kLanes triangles: corners [3 x 3 x kLanes], of each corner its x, y and z.

  /// squared [kLanes]: of the distance of a point [3] from each, or less by the rounding of its terms. Returns a bit
  /// for each that is at most `limit`.
  unsigned (*triangle_distances)(const double* corners, const double* point, double limit, double* squared);
  /// The same with a bit for each that is also below `share` of the square of how far away the nearest point is at
  /// rest, with the triangles at `rest_corners` and the point at `rest_point` [3].
  unsigned (*approached_triangles)(const double* corners, const double* point, const double* rest_corners,
                                   const double* rest_point, double share, double limit, double* squared);
  /// A bit for each, but for those of which a bound without divisions tells that they are nowhere within `limit`, or
  /// nowhere below share D^2 + beyond, by squared distances, D at rest.
  unsigned (*approachable_triangles)(const double* corners, const double* point, const double* rest_corners,
                                     const double* rest_point, double share, double beyond, double limit);
  /// corners as above of the triangles of `vertices` [3 x kLanes] with places `points` [n x 3, by rows], and `box` [6],
  /// numbers kLanes apart, about all of them.
  void (*gather_triangles)(const double* points, const int* vertices, double* corners, double* box);
  /// kept: of some leaves those that are not far, panels without any left out. Returns how many panels; kept has room
  /// for `count`.
  std::ptrdiff_t (*near_leaves)(const LeafBoxes&, const LeafQuery&, const LeafPanel* panels, std::ptrdiff_t count,
                                LeafPanel* kept);

  // Elasticity of kLanes bodies side by side, see above; the law is that of a material, without shifts. Energies
  // [kLanes].
  void (*lanes_energy)(const ElementArrays&, const ElementLaw&, const double* q, double* energy);
  void (*lanes_force)(const ElementArrays&, const ElementLaw&, const double* q, double* energy, double* force);
  void (*lanes_force_and_stiffness)(const ElementArrays&, const ElementLaw&, const double* q, double* energy,
                                    double* force, double* stiffness);
  /// The same but for the rounding of the stiffness to single precision.
  void (*lanes_force_and_mixed_stiffness)(const ElementArrays&, const ElementLaw&, const double* q, double* energy,
                                          double* force, double* stiffness);
  /// Stiffness of that polynomial at q [r]; the same but for the rounding of C and D to single precision.
  void (*lanes_polynomial_stiffness)(const StiffnessPolynomialArrays&, const double* q, double* stiffness);
  void (*lanes_mixed_polynomial_stiffness)(const StiffnessPolynomialArrays&, const double* q, double* stiffness);
  /// A <- L, L L^T = A; L's diagonal holds 1 / L_ii. A lane whose pivot is not positive holds NaN from there on.
  void (*lanes_cholesky)(double* A, std::ptrdiff_t n);
  void (*lanes_cholesky_solve)(const double* L, std::ptrdiff_t n, double* x);
  /// y = A x, A of each body.
  void (*lanes_symmetric_product)(const double* A, std::ptrdiff_t n, const double* x, double* y);
  /// y = A x, the same A [rows x columns] for all, columns `outer` apart.
  void (*lanes_matrix_product)(const double* A, std::ptrdiff_t rows, std::ptrdiff_t columns, std::ptrdiff_t outer,
                               const double* x, double* y);
  /// sum = a . b of vectors [n].
  void (*lanes_dot)(std::ptrdiff_t n, const double* a, const double* b, double* sum);
  /// sum = a + b, n numbers of each body.
  void (*lanes_sum)(std::ptrdiff_t n, const double* a, const double* b, double* sum);
  /// numbers += factor constants; n numbers of each body, the constants the same for all.
  void (*lanes_add_constants)(std::ptrdiff_t n, const double* constants, const double* factor, double* numbers);
  /// to = from, n numbers of each body for which `chosen` is not zero.
  void (*lanes_take)(std::ptrdiff_t n, const double* chosen, const double* from, double* to);
  /// A = (c_a + alpha c_v) I + beta c_v K and its gradient at the start, without example forces; offset = c_v (start -
  /// q_v); trace: the sum of the sizes of K's diagonal.
  void (*lanes_prepare)(const LaneForm&, const double* stiffness, double* offset, double* quadratic, double* linear,
                        double* trace);
  /// offset = x - start, gradient = internal + linear + A offset; sums [kLaneSums].
  void (*lanes_assemble)(const LaneForm&, const double* x, const double* quadratic, const double* linear,
                         const double* internal, double* offset, double* gradient, double* sums);
  /// Begins a step, before the calls below.
  void (*lanes_begin_rotation)(const LaneRotationArrays&);
  /// Moments at x [r], and the spins of those that are active (not zero) with the velocity c_v (x - q_v), by Newton's
  /// method from the last ones: `found` is 1 where there is one and the turn is below a radian, else 0. force [r] as
  /// rotation_force().
  void (*lanes_rotate)(const LaneRotationArrays&, const double* active, const double* x, double* force, double* found);
  /// As add_rotation_stiffness() of the chosen (not zero), of the others anything; of the centrifugal softening
  /// `softening` times.
  void (*lanes_rotation_stiffness)(const LaneRotationArrays&, const double* chosen, const double* softening,
                                   double* hessian);
  /// As gyroscopic_product(), after lanes_rotation_stiffness(); scratch 3 x r.
  void (*lanes_gyroscopic_product)(const LaneRotationArrays&, const double* x, double* scratch, double* product);
  /// weights [K]: of the candidate whose least value is the largest, the first of equals, its weights where they are
  /// positive. load [K], whose first number is zero.
  void (*lanes_weights)(const WeightCandidates&, const double* load, double* weights);
  /// The same of one body.
  void (*choose_weights)(const WeightCandidates&, const double* load, double* weights);
  /// values: all polynomials at weights [K], in order; scratch: lane_bernstein_scratch(D, K).
  void (*lanes_bernstein)(const BernsteinArrays&, const double* weights, double* scratch, double* values);

  // Elasticity of a whole mesh, see above; the law is that of a material, without shifts, times the volumes. lines:
  // scratch, padded elements x kMeshLine.

  /// inertia = c_a M a, force = c_v (alpha M + beta V) w + V x, V the variance matrix; sums [kMeshSums] of these terms.
  void (*mesh_inertia)(const MeshArrays&, const MeshInertia&, double* inertia, double* force, double* sums);
  /// Adds those of the elements to force and sums. `example`: null, or the law of an elastic example force, of the same
  /// kind with one shift and its inverse. frozen: padded elements x 45 in panels of kLanes, their tangents that damping
  /// has, without those of the example; not read where there is no such damping.
  void (*mesh_force)(const MeshArrays&, const ElementLaw&, const ElementLaw* example, const MeshInertia&,
                     const double* frozen, double* lines, double* force, double* sums);
  /// The same, and tangents: panels x 45 x kMeshLanes, those at x and beta c_v times the frozen ones. `freeze`: sets
  /// the frozen ones to those at x first.
  void (*mesh_force_and_tangents)(const MeshArrays&, const ElementLaw&, const ElementLaw* example, const MeshInertia&,
                                  bool freeze, double* frozen, float* tangents, double* lines, double* force,
                                  double* sums);
  /// product = matrix x + sum over the elements of B^T T B x; the matrix on the pattern of the mass.
  void (*mesh_product)(const MeshArrays&, const float* matrix, const float* tangents, const float* x, float* lines,
                       float* product);
  /// x = L^-1 right; returns x . x. Fields of as many vertices as the blocks have rows.
  float (*mesh_solve_lower)(const MeshFactor&, const float* right, float* x);
  /// x <- L^-T x.
  void (*mesh_solve_upper)(const MeshFactor&, float* x);
  /// coefficients = functions^T field; field += factor functions coefficients.
  void (*mesh_coefficients)(const MeshFilter<double>&, const double* field, double* coefficients);
  void (*mesh_rounded_coefficients)(const MeshFilter<float>&, const float* field, float* coefficients);
  void (*mesh_add_functions)(const MeshFilter<double>&, double factor, const double* coefficients, double* field);
  void (*mesh_add_rounded_functions)(const MeshFilter<float>&, float factor, const float* coefficients, float* field);
};

enum class InstructionSet { kPortable, kAvx2, kAvx512 };

/// The fastest that this machine has, or what the environment variable EXMAT_SIMD ("portable", "avx2", "avx512") asks
/// for, if the machine has it. The same for the whole life of the process.
const Kernels& kernels() noexcept;

/// Null where this machine or this build has no such instructions.
const Kernels* kernels_for(InstructionSet set) noexcept;

}  // namespace exmat::runtime
