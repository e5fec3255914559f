#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "common/core/arrays.h"
#include "common/mesh/elements.h"
#include "runtime/kernels/aligned_array.h"
#include "runtime/kernels/kernels.h"

namespace exmat::runtime {

/// Floats at kAlignment, zero at first.
class AlignedFloats {
 public:
  AlignedFloats() = default;
  explicit AlignedFloats(Eigen::Index size) : numbers_((size + 1) / 2), size_(size) {}

  float* data() { return reinterpret_cast<float*>(numbers_.data()); }
  const float* data() const { return reinterpret_cast<const float*>(numbers_.data()); }
  Eigen::Index size() const { return size_; }
  Eigen::Map<Eigen::VectorXf> vector() { return {data(), size_}; }
  Eigen::Map<const Eigen::VectorXf> vector() const { return {data(), size_}; }

 private:
  AlignedArray numbers_;
  Eigen::Index size_ = 0;
};

/// A corner of an element, or an element that has some vertex as a corner: its number and gradient [1/m] there.
struct Corner {
  std::int32_t index = 0;
  std::array<double, 3> gradient{};
};

/// Lists of them as the kernels take them, see MeshArrays.
struct CornerLists {
  CornerLists() = default;
  explicit CornerLists(const std::vector<std::vector<Corner>>& lists);

  std::vector<std::int32_t> starts{0}, indices;
  std::vector<double> gradients;
  std::vector<float> rounded_gradients;
};

/// Functions as the kernels take them, of a matrix [n x m]; immutable.
template <class Number>
class FullFilter {
 public:
  FullFilter() = default;
  explicit FullFilter(const Eigen::MatrixXd& functions);

  MeshFilter<Number> arrays() const noexcept {
    return {vertices_, std::ssize(starts_) - 1, starts_.data(), rows_.data(), values_.data()};
  }
  /// Count of numbers in the coefficients.
  Eigen::Index numbers() const { return 4 * kFactorBlock * (std::ssize(starts_) - 1); }
  bool empty() const { return values_.size() == 0; }

 private:
  Eigen::Index vertices_ = 0;
  std::vector<std::int32_t> starts_{0}, rows_;
  std::conditional_t<std::is_same_v<Number, float>, AlignedFloats, AlignedArray> values_;
};

/// Targets of elastic example forces in the elements, one for each group of examples, as their law takes them; sized
/// once.
struct FullTarget {
  Eigen::Index count = 0;
  AlignedArray shifts;  ///< F* - I, panels x count x 9 x kLanes
  /// F*^-1 and det F* times the element's share, 0 where F* turns it inside out, panels x count x 10 x kLanes.
  AlignedArray inverses;
  AlignedArray factors;  ///< e of each, 0 where it has no such force

  /// Place of a group's numbers of an element among the panels, of `numbers` each.
  Eigen::Index place(Eigen::Index element, Eigen::Index group, Eigen::Index numbers) const noexcept {
    return (element / kLanes * count + group) * numbers * kLanes + element % kLanes;
  }
  void set_none() noexcept { std::fill_n(factors.data(), factors.size(), 0.0); }
};

/// Fixed vertices stay where they were meshed, or go where something else takes them.
enum class FixedVertices { kStay, kDriven };

/// The space of all displacements of a mesh's vertices that are not fixed, and what a step sums over in it. Immutable.
/// n vertices that move, f = 3n unknowns in the order of the vertices, as in runtime::State. Fields are what the
/// kernels take: four numbers a vertex, the vertices in an order of elimination that keeps sparse factors sparse; where
/// the p fixed ones are driven these come last, else they have no place.
class FullSpace {
 public:
  FullSpace() = default;
  /// `filter` [vertices of the mesh x M], none or the functions of example forces: W of the shape filter P = W W^T (x)
  /// I3 of the whole body's.
  FullSpace(const TetMesh& mesh, const TetMaterials& materials, const FlagVector& fixed, const RowMatrix& filter = {},
            FixedVertices fixed_vertices = FixedVertices::kStay);

  Eigen::Index size() const { return 3 * vertices(); }              ///< f
  Eigen::Index vertices() const { return std::ssize(vertex_of_); }  ///< n
  Eigen::Index driven() const { return driven_; }                   ///< p, where they have places in fields
  Eigen::Index places() const { return vertices() + driven_; }
  Eigen::Index field_size() const { return 4 * places(); }
  Eigen::Index functions() const { return functions_.cols(); }  ///< M
  bool is_clamped() const { return clamped_; }                  ///< true if a vertex is fixed
  double edge() const { return edge_; }                         ///< mean length of the edges [m]
  double wave_rate() const { return wave_rate_; }               ///< edges a second that the fastest waves pass [1/s]
  double extent() const { return extent_; }                     ///< largest coordinate at rest [m]
  double stiffness() const { return stiffness_; }               ///< norm of those of the vertices, about [N/m]
  double shear_energy() const { return shear_energy_; }  ///< integral of mu: elastic energies at strains about 1 [J]
  const Eigen::Matrix<double, Eigen::Dynamic, 3>& gravity_load() const { return gravity_load_; }  ///< f x 3 [kg]
  /// Place in fields of a vertex of the mesh, -1 where it has none, and its number among those that move, -1 where it
  /// is fixed.
  std::int32_t place(Eigen::Index vertex) const { return place_of_[static_cast<std::size_t>(vertex)]; }
  std::int32_t number(Eigen::Index vertex) const {
    const std::int32_t own = place(vertex);
    return own < 0 || own >= vertices() ? -1 : number_at(own);
  }
  std::int32_t number_at(Eigen::Index place) const { return vertex_of_[static_cast<std::size_t>(place)]; }
  /// M v [f] of velocities v of the vertices that move, the fixed ones at rest.
  Eigen::VectorXd momentum(const Eigen::VectorXd& v) const;
  /// 1/2 v^T M v; `driven(place)`: the velocity of a driven vertex.
  template <typename Driven>
  double kinetic_energy(const Eigen::VectorXd& v, const Driven& driven) const noexcept;
  Eigen::Index mesh_vertices() const { return std::ssize(place_of_); }

  Eigen::VectorXd to_field(const Eigen::VectorXd& x) const;
  void to_field(const Eigen::VectorXd& x, Eigen::VectorXd& field) const noexcept;
  void from_field(const Eigen::VectorXd& field, Eigen::VectorXd& x) const noexcept;

  /// Scalar matrices [n x n] in the order of fields: mass [kg], and Laplacians of the tets, times the variance factor
  /// and mu [N/m], and times the stiffness that the preconditioner takes for theirs [N/m].
  using Scalar = Eigen::SparseMatrix<double, Eigen::RowMajor>;
  Scalar mass() const { return scalar_matrix(mass_); }
  Eigen::VectorXd masses() const;  ///< row sums of the mass matrix over all places [kg]
  Scalar preconditioning_stiffness() const { return scalar_matrix(laplacian_); }
  Eigen::Index entries() const { return std::ssize(columns_); }
  double mass_value(Eigen::Index k) const { return mass_[static_cast<std::size_t>(k)]; }
  double variance_value(Eigen::Index k) const { return variance_matrix_[static_cast<std::size_t>(k)]; }

  MeshArrays arrays() const noexcept;
  ElementLaw law() const noexcept;
  FullTarget make_target(Eigen::Index groups) const;
  /// `field`: displacements u* of the target from rest, in any frame. `shares` of the elements; empty: all 1.
  void set_target(const double* field, double factor, const Eigen::VectorXd& shares, std::size_t group,
                  FullTarget& target) const noexcept;
  /// Means over the elements of values [n_t] of the tets; `mesh` and `materials` as the constructor had them.
  Eigen::VectorXd element_means(const TetMesh& mesh, const TetMaterials& materials,
                                const Eigen::VectorXd& values) const;
  ElementLaw law(const FullTarget& target) const noexcept;
  MeshFilter<double> filter() const noexcept { return filter_.arrays(); }
  MeshFilter<float> rounded_filter() const noexcept { return rounded_filter_.arrays(); }
  Eigen::Index coefficients() const { return filter_.numbers(); }        ///< numbers of the functions' coefficients
  const Eigen::MatrixXd& function_values() const { return functions_; }  ///< n x M, vertices in the order of fields
  Eigen::Index padded_elements() const { return kMeshGroup * (std::ssize(elements_.starts) - 1); }

  /// [panels x 45 x kMeshLanes] tangents at x as those of Kernels::mesh_force_and_tangents(), their negative
  /// eigenvalues set to zero before the variance is taken off. `example`: null, or the target of an elastic force.
  void projected_tangents(const double* field, const FullTarget* example, double stiffness_damping, bool freeze,
                          double* frozen, float* tangents) const noexcept;

 private:
  Eigen::Matrix3d displacement_gradient(const double* field, Eigen::Index element) const noexcept;
  /// Calls `use(place, (M v)_place)` of all places; `velocity(place)`.
  template <typename Velocity, typename Use>
  void for_momenta(const Velocity& velocity, const Use& use) const {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      Eigen::Vector3d momentum = Eigen::Vector3d::Zero();
      for (auto k = static_cast<std::size_t>(row_starts_[i]); k < static_cast<std::size_t>(row_starts_[i + 1]); ++k)
        momentum += mass_[k] * velocity(columns_[k]);
      use(rows_[i], momentum);
    }
  }

  void order_vertices(const TetMesh& mesh, const FlagVector& fixed, FixedVertices fixed_vertices);
  void add_matrices(const TetMesh& mesh, const TetMaterials& materials);
  void add_elements(const Elements& elements, const TetMaterials& materials);
  void add_filter(const RowMatrix& filter);
  Scalar scalar_matrix(const std::vector<double>& values) const;

  MaterialModel model_ = MaterialModel::kStVenantKirchhoff;
  bool clamped_ = false;
  double edge_ = 0, extent_ = 0, wave_rate_ = 0, stiffness_ = 0, shear_energy_ = 0;
  std::vector<std::int32_t> vertex_of_;  ///< vertex of each place in a field, among those that move
  std::vector<std::int32_t> place_of_;   ///< place of each vertex of the mesh, -1: none
  Eigen::Index driven_ = 0;
  Eigen::Matrix<double, Eigen::Dynamic, 3> gravity_load_;
  std::vector<std::int32_t> element_at_;  ///< of Elements, at each place in the panels
  CornerLists elements_, around_;         ///< corners of each element; elements about the vertex of each row
  AlignedArray mu_, lambda_, variance_;   ///< times the volumes
  std::vector<std::int32_t> rows_, row_starts_{0}, columns_;
  std::vector<double> mass_, variance_matrix_, laplacian_;
  Eigen::MatrixXd functions_;
  FullFilter<double> filter_;
  FullFilter<float> rounded_filter_;
};

template <typename Driven>
double FullSpace::kinetic_energy(const Eigen::VectorXd& v, const Driven& driven) const noexcept {
  const auto velocity = [&](Eigen::Index place) -> Eigen::Vector3d {
    return place < vertices() ? Eigen::Vector3d(v.segment<3>(3 * number_at(place))) : driven(place);
  };
  double sum = 0;
  for_momenta(velocity, [&](Eigen::Index place, const Eigen::Vector3d& own) { sum += own.dot(velocity(place)); });
  return 0.5 * sum;
}

/// (M (c_a + alpha c_v) + (1 + beta c_v) L + W k W^T)^-1, factored once for these numbers, in single precision.
class FullPreconditioner {
 public:
  FullPreconditioner() = default;
  /// `filter_stiffness` [M], k of each function, or none. `with_diagonal`: also inverse_diagonal().
  FullPreconditioner(const FullSpace& space, double mass_factor, double stiffness_factor,
                     const Eigen::VectorXd& filter_stiffness, bool with_diagonal = false);

  /// x = (S (x) I3)^-1 right, fields; coefficients: those of the filter.
  void solve(const Kernels& run, const AlignedFloats& right, AlignedFloats& x,
             AlignedFloats& coefficients) const noexcept {
    begin_solve(run, right, x, coefficients);
    end_solve(run, x, coefficients);
  }
  /// Half of that: returns right . (S (x) I3)^-1 right. end_solve() takes x and coefficients from there to the
  /// solution.
  float begin_solve(const Kernels& run, const AlignedFloats& right, AlignedFloats& x,
                    AlignedFloats& coefficients) const noexcept;
  void end_solve(const Kernels& run, AlignedFloats& x, const AlignedFloats& coefficients) const noexcept;

  /// [n] of S^-1 [m/N], if asked for.
  const Eigen::VectorXd& inverse_diagonal() const { return diagonal_; }

 private:
  void take_blocks(const Eigen::SparseMatrix<double>& L);
  MeshFactor factor() const noexcept {
    return {std::ssize(starts_) - 1, starts_.data(), rows_.data(), values_.data(), diagonal_blocks_.data()};
  }

  Eigen::Index size_ = 0;
  Eigen::VectorXd diagonal_;
  std::vector<std::int32_t> starts_{0}, rows_;
  AlignedFloats values_, diagonal_blocks_;
  FullFilter<float> functions_;  ///< the filter's part, subtracted as a square
};

}  // namespace exmat::runtime
