#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "common/core/arrays.h"
#include "common/mesh/tet_mesh.h"
#include "common/model/choices.h"

namespace exmat {

// The contract between the two stages: what precompute builds, the bundle holds and the run time steps.
// Symbols: n vertices, n_t tets, n_f surface triangles, m eigenfunctions, K examples, r modes, s cubature elements.

/// Group /object: the rest mesh as given, in the world frame, and its material.
struct ObjectData {
  TetMesh mesh;
  TriangleArray surface;       ///< n_f x 3, outward
  FlagVector fixed;            ///< n, 1 where the vertex is clamped
  TetMaterials materials;      ///< n_t each
  double stiffness_ratio = 0;  ///< stiffness of the elements over quadratic tets on the same mesh; 0 where not compared
  double worst_stiffness = 0;  ///< largest of its parts
  double thin_share = 0;       ///< share of the volume where the mesh is one tet thick
  /// Parts and colours of the surface that the mesh was made about, packed (common/model/vertex_marks.h); empty
  /// without one.
  FlagVector part_names;  ///< UTF-8, a zero byte after each of the p names
  Eigen::Matrix<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>
      part_sets;             ///< g x p, 1 where the vertices of a set are of the part
  IndexVector vertex_parts;  ///< n, the set of each vertex
  VertexArray colours;       ///< n x 3, red, green and blue of the surface there, 0 to 1
};

/// Group /shape_space: Laplace-Beltrami eigenpairs of the object at centroid 0 and volume 1, the constant one dropped.
struct ShapeSpaceData {
  Eigen::VectorXd eigenvalues;                         ///< m, ascending, > 0
  RowMatrix eigenfunctions;                            ///< n x m, phi^T (M_s/V) phi = I
  RowMatrix rest_descriptor;                           ///< m x 3
  double volume = 0;                                   ///< volume of the object [m^3]
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  ///< centroid of the object [m]
  Weighting weighting = Weighting::kEigenvalue;
  std::int64_t splits_cluster = 0;  ///< 1 where the m-th and the next eigenvalue are (nearly) equal
};

/// One group /examples/NAME: an example in the object's frame and basis. docs/method.md, "Shape space".
struct ExampleData {
  std::string name;
  std::int64_t index = 0;  ///< 0 is the rest pose
  bool is_rest = false;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< from the example's frame to the object's
  double scale = 1;                 ///< object's length unit over the example's: (V_object / V_example)^(1/3)
  std::string source;               ///< the morph target that it is of, as the asset names it, or its file's name
  std::string method;               ///< method that mapped it to the object
  double alignment_residual = 0;    ///< relative
  double doubt = 0;                 ///< J of docs/alignment.md; 0 is certain, above 1.2 refused
  double inverted_fraction = 0;     ///< share of the volume that the pose turns inside out
  std::int64_t competing_maps = 0;  ///< other poses that fit the example about as well
  double surface_rms = 0, surface_farthest = 0;  ///< distances of a pose by a surface from it, over its diagonal
  std::int64_t surface_iterations = 0;           ///< that this pose took
  double shape_space_error = 0;  ///< share of its displacement that the m functions lose, relative M-norm
  double basis_error = 0;        ///< share of its transferred displacement that U loses, relative M-norm
  double best_error = 0;         ///< error of the body settled under an example force of any strength, relative M-norm
  double settled_error = 0;      ///< likewise under the force of the scene that the bundle is of; else best_error
  double settled_distance = 0;   ///< largest of a vertex then [m]
  std::int64_t settled_vertex = 0;  ///< which
  RowMatrix descriptor;             ///< m x 3
  Eigen::VectorXd reduced;          ///< r, T^+ (e_k - e_0)
  Eigen::VectorXd pose;             ///< r, p_k: the same with the fixed vertices of a clamped body put back
};

/// Group /examples and the weights problem min 1/2 w^T G w - (h0 + hq q)^T w on the simplex. docs/step_in_detail.md,
/// "Weights".
struct ExampleSet {
  std::vector<ExampleData> examples;  ///< K, in index order, the rest pose first
  RowMatrix gram;                     ///< K x K, G = E^T E
  Eigen::VectorXd h0;                 ///< K, E^T c_rest
  RowMatrix hq;                       ///< K x r, E^T T
};

/// Group /modal.
struct ModalData {
  RowMatrix basis;              ///< 3n x r (dataset n 3 r), mass-orthonormal, zero on fixed vertices
  Eigen::VectorXd frequencies;  ///< frequencies of the linear modes, ascending [Hz]
  RowMatrix gravity_load;       ///< 3 x r, row a = U^T M 1_a: generalised force per unit acceleration along axis a
};

/// Group /cubature.
struct CubatureData {
  IndexVector elements;            ///< s, distinct elements of the object (Elements), ascending
  Eigen::VectorXd weights;         ///< s, >= 0
  Eigen::VectorXd volumes;         ///< s [m^3]
  RowMatrix gradient;              ///< 9s x r (dataset s 9 r): B_j, row 3a + b of element j is dF_ab/dq
  Eigen::VectorXd youngs_modulus;  ///< s [Pa]
  Eigen::VectorXd poisson_ratio;   ///< s
  RowMatrix variance;              ///< r x r, the constant part of the stiffness, of all elements; none: zero
  RowMatrix heldout_poses;         ///< N x r reduced poses that the held-out errors are measured on
  ForceMethod internal_force = ForceMethod::kCubature;  ///< choice for `auto`, never `auto` itself
  std::string internal_force_reason;                    ///< why
  CubatureMethod method = CubatureMethod::kGreedySwap;
  double training_error = 0;           ///< relative, force, as heldout_error
  double heldout_error = 0;            ///< relative, force in the norm of the inverse rest stiffness
  double heldout_energy_error = 0;     ///< relative
  double heldout_stiffness_error = 0;  ///< relative, Frobenius norm
};

/// Group /polynomial: derivatives at rest of the reduced energy of St.Venant-Kirchhoff over all tets, which is an exact
/// quartic polynomial: E(q) = 1/2 K_ij q_i q_j + 1/6 C_ijk q_i q_j q_k + 1/24 D_ijkl q_i q_j q_k q_l, C and D fully
/// symmetric. Barbic and James 2005. A pair (i, j), i >= j, is row i (i + 1) / 2 + j of r (r + 1) / 2 = R.
struct PolynomialData {
  RowMatrix stiffness;      ///< r x r, K
  RowMatrix cubic;          ///< R x r, C_(ij)k
  Eigen::VectorXd quartic;  ///< R (R + 1) / 2, D_(ij)(kl), lower triangle by rows
};

/// Group /targets: p*(w) on the simplex as one polynomial of degree D in Bernstein form,
/// p*(w) = sum_a D!/(a_1! ... a_K!) w_1^a_1 ... w_K^a_K P_a, c = (D + K - 1)! / (D! (K - 1)!) control points; or, for
/// K = 2, as P such polynomials, each of the weights (1 - s, s) of the ends of its piece t_i <= t <= t_i+1, where t is
/// the weight of the second example and s = (t - t_i) / (t_i+1 - t_i).
struct TargetTableData {
  std::int64_t degree = 0;
  /// c x K, a, each row adds up to D; lexicographic, descending. Of terms of one and two examples (is_of_pairs()) the
  /// first row is zero; then come those of each term, which add up to its own degree, at most D.
  IndexMatrix exponents;
  RowMatrix control_points;  ///< P c x r (dataset P c r), P_a in reduced coordinates, pieces in order
  Eigen::VectorXd knots = Eigen::Vector2d(0, 1);  ///< P + 1, t_i: 0, ..., 1, each above the one before it
  double error = 0;  ///< largest found, in the energy norm at rest, relative to the largest example
  EnergyReference energy_reference = EnergyReference::kExample;
  /// Control points are of the pull g(w) = U^T P p*(w), p* minimised over all tets and P the filter of the example
  /// force; before format 7 of p*(w) minimised in the modal basis.
  bool is_pull = false;
  /// The body settles in its examples' poses where kappa [1/s^2] and gravity [m/s^2] are these; 0: not looked after.
  double compensated_stiffness = 0;
  Eigen::Vector3d compensated_gravity = Eigen::Vector3d::Zero();
};

/// True of the exponents of a table that is the sum of terms of one and two examples.
inline bool is_of_pairs(const IndexMatrix& exponents) {
  return exponents.rows() > 0 && (exponents.row(0).array() == 0).all();
}

/// Group /target_space: the same targets to be solved for, in d displacements of their own that hold them all.
struct TargetSpaceData {
  EnergyReference energy_reference = EnergyReference::kExample;  ///< that the space and its elements are made for
  double error = 0;                ///< largest found of what the space loses of a target, as in TargetTableData
  double element_error = 0;        ///< largest found of what the elements lose of it
  RowMatrix poses;                 ///< K x d, the examples
  RowMatrix pull;                  ///< r x d, U^T P Y, Y [3n x d] the displacements
  IndexVector elements;            ///< s, distinct elements of the object
  Eigen::VectorXd weights;         ///< s, >= 0
  Eigen::VectorXd volumes;         ///< s [m^3]
  RowMatrix gradient;              ///< 9s x d (dataset s 9 d): row 3a + b of element j is dF_ab/dy
  Eigen::VectorXd youngs_modulus;  ///< s [Pa]
  Eigen::VectorXd poisson_ratio;   ///< s
};

/// Group /target_elasticity: what the elastic example force takes beside the targets. Its elements are its own, chosen
/// for that force; the target Y y has the deformation gradient I + G_j y in element j, Y [3n x d] the displacements of
/// /target_space. docs/method.md, "Force".
struct TargetElasticityData {
  double heldout_error = 0;        ///< relative, of the force by these elements, as in CubatureData
  IndexVector elements;            ///< s, distinct elements of the object, ascending
  Eigen::VectorXd weights;         ///< s, >= 0; of a region times the element's share in it
  Eigen::VectorXd volumes;         ///< s [m^3]
  RowMatrix gradient;              ///< 9s x r (dataset s 9 r): B_j, row 3a + b of element j is dF_ab/dq
  RowMatrix target_gradient;       ///< 9s x d (dataset s 9 d): G_j, likewise dF*_ab/dy
  Eigen::VectorXd youngs_modulus;  ///< s [Pa]
  Eigen::VectorXd poisson_ratio;   ///< s
  RowMatrix control_points;        ///< P c x d, those of /targets in coordinates y; without a table K x d, the examples
};

/// Group /projection. docs/method.md, "Direct projection".
struct ProjectionData {
  RowMatrix shape_from_reduced;  ///< 3m x r, T, row 3i + axis
  RowMatrix reduced_from_shape;  ///< r x 3m, T^+
  Eigen::VectorXd filter_scale;  ///< [m] of a body of several densities, else empty: W^T u = s (x) I3 times T u
  RowMatrix target_basis;        ///< r x d, orthonormal basis of the poses that descriptors stand for, d <= min(r, 3m)
};

/// Group /full_space, of a region too: what steps in all vertices take of examples, in the coefficients W^T u of the
/// whole body, W^T D'' u of a region. The filter of the example force is P = W W^T (x) I3; row 3i + axis of a
/// coefficient. docs/method.md, "Force".
struct FullSpaceData {
  RowMatrix filter;          ///< n x m, W; of a region D W
  RowMatrix slopes;          ///< K x 3m: h = h0 + slopes W^T u of the weights problem
  RowMatrix control_points;  ///< P c x 3m, W^T of those of /targets; without a table of the examples
  RowMatrix from_target;     ///< d x 3m, W^T Y, Y [3n x d] the displacements of /target_space
  RowMatrix shapes;          ///< 3n x d (dataset n 3 d), Y, which an elastic example force takes; else empty
  RowMatrix shifts;          ///< K x 3m, W^T of SkeletonData::shifts, fixed vertices with them; or empty
};

/// One group /regions/NAME: examples that act on some of the vertices alone, with weights, projection and targets of
/// their own, in the groups' form above. docs/method.md, "Regions".
struct RegionData {
  std::string name;
  std::int64_t index = 0;  ///< place in the asset
  IndexVector vertices;    ///< n_r, of the object, ascending
  ExampleSet examples;     ///< K of its own; descriptors of the displacement inside the region, zero outside
  Eigen::VectorXd window;  ///< n_r, from 0 at the region's border to 1: how much its example force sees of a vertex
  Eigen::VectorXd band;    ///< n_r, shares of the vertices that the region is seen from; 0 where it is seen as it moves
  ProjectionData projection;
  std::optional<TargetTableData> targets;
  std::optional<TargetSpaceData> target_space;
  std::optional<TargetElasticityData> target_elasticity;
  std::optional<FullSpaceData> full_space;
};

/// FidelityData::loads of a bundle whose basis has learned from a scene.
inline constexpr const char* kLoadsOfScene = "the loads of the scene";

/// Group /fidelity: how far the reduced body is from the full space, or one of many modes in its place, in runs that
/// its basis has not learned from. Errors are relative, docs/error_metrics.md, and those of the runs under the kind of
/// load whose shape error is largest. Of no use to a step.
struct FidelityData {
  std::string loads;               ///< whose loads the runs are of
  std::string reference;           ///< space that ran them: "full_space", "modes"
  std::string basis;               ///< "trained", "modal": which of the two was better and is taken
  std::string advice;              ///< remedy, the kind of load, what was tried and what was not
  std::int64_t training_runs = 0;  ///< that the basis has learned from
  std::int64_t heldout_runs = 0;   ///< that it has not, under all kinds of loads
  double position_error = 0;       ///< mean
  double shape_error = 0;          ///< mean, without the rigid motion; of a clamped body as the position
  double end_error = 0;            ///< position (a free body: shape) in the last frame of each run
  double settled_error = 0;        ///< likewise, over the last tenth of each run
  double all_elements_error = 0;   ///< shape, with the basis and all elements: no share of cubature
  double modal_error = 0;          ///< likewise, of the basis of modes and their derivatives, under its own worst kind
  double captured_energy = 0;      ///< share of |u|_M^2 of the full motion that the basis can hold
  double target_error = 0;         ///< largest of a table or space of targets
  std::int64_t worst_vertex = 0;   ///< whose distance is largest
  double worst_distance = 0;       ///< its distance, over the diagonal of the object's bounding box
};

/// Group /rigid: moments about the centre of mass, X centred there, of a free body or of one whose fixed part is
/// carried. docs/step_in_detail.md, "Free bodies".
struct RigidData {
  double mass = 0;                 ///< [kg]
  Eigen::Vector3d centre_of_mass;  ///< at rest, world [m]
  RowMatrix3 inertia;              ///< J_0 at rest [kg m^2]
  RowMatrix3 second_moments;       ///< P0_ab = sum m X_a X_b [kg m^2]
  RowMatrix linear_moments;        ///< 9 x r (dataset 3 3 r): p1_ab, row 3a + b
  RowMatrix basis_moments;         ///< 9r x r (dataset 3 3 r r): S_ab = U_a^T M_s' U_b, block 3a + b
  RowMatrix spin_load;             ///< 3 x r, sum m X x U: 0 but for rounding where the body is free
};

/// Group /contact: the surface vertices that may touch obstacles, none of them fixed. docs/method.md, "Contact".
struct ContactData {
  IndexVector vertices;   ///< k, distinct vertices of the object, ascending
  VertexArray positions;  ///< k x 3, at rest, world [m]
  Eigen::VectorXd areas;  ///< k, share of the surface, > 0 [m^2]
  RowMatrix basis;        ///< 3k x r (dataset k 3 r), their rows of the modal basis
};

/// Group /render: a surface that moves with the body, to be drawn. Vertex k is at the sum of barycentric(k, c) times
/// the place of corner c of tets[k], wherever these are; the rows add up to 1.
struct RenderData {
  VertexArray vertices;      ///< v x 3, at rest, as in the file [m]
  IndexVector tets;          ///< v
  RowMatrix barycentric;     ///< v x 4, negative where the vertex is outside its tet
  TriangleArray triangles;   ///< f x 3, of the vertices
  std::int64_t outside = 0;  ///< vertices that are not on the body
  double farthest = 0;       ///< distance of the farthest vertex from the body [m]
  /// The look of a surface that came from glTF, in metres: a .glb by itself, its nodes each with a mesh of its own, its
  /// meshes of p primitives together. Empty where there is none to keep.
  FlagVector look;
  IndexVector look_vertices;  ///< p, which vertex is the first of each primitive; the others follow it
  /// 3p x 3 (dataset p 3 3), from displacements in the primitive's mesh to those here.
  RowMatrix look_frames = RowMatrix(0, 3);
  /// v x h, bones of the skeleton that each vertex hangs on, as its file or its tet has it, and by how much; h is 0
  /// without bones.
  IndexMatrix bones;
  RowMatrix bone_weights;
};

/// Group /skeleton: the bones that a body hangs on. docs/characters.md.
struct SkeletonData {
  std::vector<std::string> bones;       ///< b names, parents first
  std::vector<std::string> animations;  ///< names
  IndexVector parents;                  ///< b, -1 of a root
  RowMatrix bind;                       ///< 3b x 4 (dataset b 3 4), bone to world where the mesh is at rest [1], [m]
  RowMatrix weights;                    ///< n x b, >= 0, rows add up to 1
  IndexVector first_frames;             ///< start of each animation, then the end of the last
  Eigen::VectorXd times;                ///< F, of the frames, ascending from 0 in each animation [s]
  RowMatrix poses;  ///< F b x 7 (dataset F b 7), joint [m] and turn from the bind pose, a quaternion, w first
  /// K n x 3 (dataset K n 3), where each example moves the vertices before the bones do, by its weight [m]; or empty.
  RowMatrix shifts = RowMatrix(0, 3);

  /// True if it is that of a clamp which follows examples, and has no bones beside.
  bool is_clamp() const { return shifts.rows() > 0 && bones.size() == 1; }
};

/// Everything a scene may need of one asset. Absent groups were left out (docs/overview.md).
struct ReducedModel {
  std::string asset_name;
  std::string generator;
  std::string input_sha256;
  std::optional<ObjectData> object;
  std::optional<ShapeSpaceData> shape_space;
  std::optional<ExampleSet> examples;
  std::optional<ModalData> modal;
  std::optional<CubatureData> cubature;
  std::optional<PolynomialData> polynomial;
  std::optional<ProjectionData> projection;
  std::optional<TargetTableData> targets;
  std::optional<TargetSpaceData> target_space;
  std::optional<TargetElasticityData> target_elasticity;
  std::optional<FullSpaceData> full_space;
  std::optional<FidelityData> fidelity;
  std::optional<SkeletonData> skeleton;
  std::vector<RegionData> regions;  ///< in index order; none: no such group
  std::optional<RigidData> rigid;
  std::optional<ContactData> contact;
  std::optional<RenderData> render;
};

}  // namespace exmat
