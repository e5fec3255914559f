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
  const double* by_element = nullptr;  ///< padded(s) x 9 x stride: stiffness
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
  double* product = nullptr;    ///< 9 kLanes x stride
  double* stiffness = nullptr;  ///< stride x stride
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
/// Where the entry of row i and column j <= i is, of the first lane.
constexpr std::ptrdiff_t lane_entry(std::ptrdiff_t i, std::ptrdiff_t j) {
  const std::ptrdiff_t row = i / kLaneBlock, column = j / kLaneBlock;
  return ((row * (row + 1) / 2 + column) * kLaneBlock * kLaneBlock + i % kLaneBlock * kLaneBlock + j % kLaneBlock) *
         kLanes;
}
/// Doubles of scratch of lanes_force_and_stiffness().
constexpr std::ptrdiff_t lane_scratch(std::ptrdiff_t modes) { return 2 * 9 * lane_rows(modes) * kLanes; }

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

  // Of vertices, whose three rows have `stride` numbers each, a multiple of kLanes; row 3 v is the first of vertex v.

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

  // Of kLanes bodies side by side, see above; the law is that of a material, without shifts. Energies [kLanes].
  void (*lanes_energy)(const ElementArrays&, const ElementLaw&, const double* q, double* energy);
  void (*lanes_force)(const ElementArrays&, const ElementLaw&, const double* q, double* energy, double* force);
  /// scratch: lane_scratch(r).
  void (*lanes_force_and_stiffness)(const ElementArrays&, const ElementLaw&, const double* q, double* scratch,
                                    double* energy, double* force, double* stiffness);
  /// L L^T = A; L's diagonal holds 1 / L_ii. A lane whose pivot is not positive holds NaN from there on.
  void (*lanes_cholesky)(const double* A, std::ptrdiff_t n, double* L);
  void (*lanes_cholesky_solve)(const double* L, std::ptrdiff_t n, double* x);
  /// y = A x, A of each body.
  void (*lanes_symmetric_product)(const double* A, std::ptrdiff_t n, const double* x, double* y);
  /// y = A x, the same A [rows x columns] for all, rows `outer` apart.
  void (*lanes_matrix_product)(const double* A, std::ptrdiff_t rows, std::ptrdiff_t columns, std::ptrdiff_t outer,
                               const double* x, double* y);
};

enum class InstructionSet { kPortable, kAvx2, kAvx512 };

/// The fastest that this machine has, or what the environment variable EXMAT_SIMD ("portable", "avx2", "avx512") asks
/// for, if the machine has it. The same for the whole life of the process.
const Kernels& kernels() noexcept;

/// Null where this machine or this build has no such instructions.
const Kernels* kernels_for(InstructionSet set) noexcept;

}  // namespace exmat::runtime
