#include "runtime/sim/space/full/full_space.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include "common/core/decompositions.h"
#include "common/elastic/materials.h"
#include "common/mesh/geometry.h"
#include "runtime/sim/elasticity/element_potential.h"
#include "runtime/sim/examples/target_elasticity.h"

namespace exmat::runtime {
namespace {

// The scalar Laplacian that stands for the stiffness counts mu and lambda of the material so much. Anything between
// half and 1.4 times as much needs about as many iterations.
constexpr double kShearShare = 1.42, kVolumeShare = 0.5;

// Elements or rows whose loops are of one length stand side by side, within stretches that stay in a cache.
constexpr Eigen::Index kStretch = 256;

template <typename Length>
std::vector<std::int32_t> by_length(Eigen::Index count, const Length& length) {
  std::vector<std::int32_t> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  for (Eigen::Index begin = 0; begin < count; begin += kStretch)
    std::stable_sort(order.begin() + begin, order.begin() + std::min(count, begin + kStretch),
                     [&](std::int32_t a, std::int32_t b) { return length(a) < length(b); });
  return order;
}

using Gradients = Eigen::Matrix<double, 4, 3>;

template <class Number, class Block>
auto join(const std::vector<Block>& blocks) {
  std::conditional_t<std::is_same_v<Number, float>, AlignedFloats, AlignedArray> joined(std::ssize(blocks) *
                                                                                        Block::SizeAtCompileTime);
  for (std::size_t i = 0; i < blocks.size(); ++i)
    std::copy_n(blocks[i].data(), Block::SizeAtCompileTime, joined.data() + i * Block::SizeAtCompileTime);
  return joined;
}

// Diagonal of (L L^T)^-1, from its entries on the pattern of L alone (Takahashi, Fagan and Chen 1973).
Eigen::VectorXd diagonal_of_inverse(const Eigen::SparseMatrix<double>& L) {
  Eigen::SparseMatrix<double> inverse = L;
  Eigen::VectorXd column = Eigen::VectorXd::Zero(L.rows());
  for (Eigen::Index j = L.cols() - 1; j >= 0; --j) {
    const Eigen::Index begin = L.outerIndexPtr()[j], end = L.outerIndexPtr()[j + 1];
    const double pivot = L.valuePtr()[begin];
    for (Eigen::Index k = begin + 1; k < end; ++k) column[L.innerIndexPtr()[k]] = 0;
    // column = Z L_j below the diagonal, Z the symmetric inverse so far: both of its triangles count.
    for (Eigen::Index k = begin + 1; k < end; ++k) {
      const Eigen::Index row = L.innerIndexPtr()[k];
      const double factor = L.valuePtr()[k];
      Eigen::Index at = begin + 1;
      for (Eigen::SparseMatrix<double>::InnerIterator entry(inverse, row); entry; ++entry) {
        while (at < end && L.innerIndexPtr()[at] < entry.index()) ++at;
        if (at == end) break;
        if (L.innerIndexPtr()[at] != entry.index()) continue;
        column[entry.index()] += factor * entry.value();
        if (entry.index() != row) column[row] += L.valuePtr()[at] * entry.value();
      }
    }
    double sum = 1 / pivot;
    for (Eigen::Index k = begin + 1; k < end; ++k) {
      const double value = -column[L.innerIndexPtr()[k]] / pivot;
      inverse.valuePtr()[k] = value;
      sum -= L.valuePtr()[k] * value;
    }
    inverse.valuePtr()[begin] = sum / pivot;
  }
  return inverse.diagonal();
}

}  // namespace

template <class Number>
FullFilter<Number>::FullFilter(const Eigen::MatrixXd& functions) : vertices_(functions.rows()) {
  using Block = Eigen::Matrix<Number, kFactorBlock, kFactorBlock, Eigen::RowMajor>;
  std::vector<Block> blocks;
  for (Eigen::Index column = 0; column < functions.cols(); column += kFactorBlock) {
    const Eigen::Index width = std::min(kFactorBlock, functions.cols() - column);
    for (Eigen::Index row = 0; row < functions.rows(); row += kFactorBlock) {
      const auto own = functions.block(row, column, std::min(kFactorBlock, functions.rows() - row), width);
      if (own.isZero(0)) continue;
      blocks.push_back(Block::Zero());
      blocks.back().topLeftCorner(own.rows(), width) = own.template cast<Number>();
      rows_.push_back(static_cast<std::int32_t>(row / kFactorBlock));
    }
    starts_.push_back(static_cast<std::int32_t>(rows_.size()));
  }
  values_ = join<Number>(blocks);
}

template class FullFilter<double>;
template class FullFilter<float>;

FullSpace::FullSpace(const TetMesh& mesh, const TetMaterials& materials, const FlagVector& fixed,
                     const RowMatrix& filter, FixedVertices fixed_vertices)
    : model_(materials.model), clamped_(fixed.any()) {
  order_vertices(mesh, fixed, fixed_vertices);
  add_matrices(mesh, materials);
  add_elements(elements_of(mesh, materials), materials);
  add_filter(filter);
}

void FullSpace::order_vertices(const TetMesh& mesh, const FlagVector& fixed, FixedVertices fixed_vertices) {
  std::vector<std::int32_t> moving(static_cast<std::size_t>(mesh.vertex_count()), -1);
  std::int32_t count = 0;
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    if (fixed[v] == 0) moving[static_cast<std::size_t>(v)] = count++;
  std::vector<Eigen::Triplet<double>> entries;
  double length = 0, edges = 0;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const std::int32_t a = mesh.tets(t, i), b = mesh.tets(t, j);
        if (i < j) {
          length += (mesh.vertices.row(a) - mesh.vertices.row(b)).norm();
          ++edges;
        }
        if (fixed[a] == 0 && fixed[b] == 0)
          entries.emplace_back(moving[static_cast<std::size_t>(a)], moving[static_cast<std::size_t>(b)], 1.0);
      }
  edge_ = length / edges;
  extent_ = mesh.vertices.cwiseAbs().maxCoeff();
  Eigen::SparseMatrix<double> pattern(count, count);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern, order);
  // Blocks of the factor are of vertices that this order has side by side; in the order of their own graph they fill in
  // less. The last one may have fewer.
  const Eigen::VectorXi place_of_moving =
      Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int>(order.inverse()).indices();
  const Eigen::Index blocks = (count + kFactorBlock - 1) / kFactorBlock;
  for (Eigen::Triplet<double>& entry : entries)
    entry = {static_cast<int>(place_of_moving[entry.row()] / kFactorBlock),
             static_cast<int>(place_of_moving[entry.col()] / kFactorBlock), 1.0};
  Eigen::SparseMatrix<double> coarse(blocks, blocks);
  coarse.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> block_order;
  Eigen::AMDOrdering<int>()(coarse, block_order);
  std::vector<int> in_order(block_order.indices().data(), block_order.indices().data() + blocks);
  std::stable_partition(in_order.begin(), in_order.end(), [&](int block) { return block < count / kFactorBlock; });
  for (const int block : in_order)
    for (Eigen::Index k = kFactorBlock * block; k < std::min<Eigen::Index>(count, kFactorBlock * (block + 1)); ++k)
      vertex_of_.push_back(order.indices()[k]);
  std::vector<std::int32_t> place(static_cast<std::size_t>(count));
  for (std::int32_t k = 0; k < count; ++k) place[static_cast<std::size_t>(vertex_of_[static_cast<std::size_t>(k)])] = k;
  place_of_ = moving;
  for (std::int32_t& at : place_of_) {
    if (at >= 0)
      at = place[static_cast<std::size_t>(at)];
    else if (fixed_vertices == FixedVertices::kDriven)
      at = count + static_cast<std::int32_t>(driven_++);
  }
}

void FullSpace::add_matrices(const TetMesh& mesh, const TetMaterials& materials) {
  const Eigen::Index n = places();
  std::vector<std::set<std::int32_t>> neighbours(static_cast<std::size_t>(n));
  const auto for_pairs = [&](Eigen::Index t, auto&& work) {
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const std::int32_t row = place_of_[static_cast<std::size_t>(mesh.tets(t, i))],
                           column = place_of_[static_cast<std::size_t>(mesh.tets(t, j))];
        if (row >= 0 && column >= 0) work(static_cast<std::size_t>(row), column, i, j);
      }
  };
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    for_pairs(t, [&](std::size_t row, std::int32_t column, int, int) { neighbours[row].insert(column); });
  rows_ = by_length(n, [&](std::int32_t row) { return neighbours[static_cast<std::size_t>(row)].size(); });
  std::vector<std::int32_t> start_of(static_cast<std::size_t>(n));
  for (const std::int32_t row : rows_) {
    const auto& own = neighbours[static_cast<std::size_t>(row)];
    start_of[static_cast<std::size_t>(row)] = row_starts_.back();
    columns_.insert(columns_.end(), own.begin(), own.end());
    row_starts_.push_back(static_cast<std::int32_t>(columns_.size()));
  }
  mass_.assign(columns_.size(), 0);
  variance_matrix_ = laplacian_ = mass_;
  gravity_load_.setZero(size(), 3);
  const Eigen::VectorXd volumes = tet_volumes(mesh);
  const double beta = materials.formulation == Formulation::kSmoothed ? materials.variance_factor : 0;
  Eigen::VectorXd stiffness = Eigen::VectorXd::Zero(n);
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    const Gradients gradients = shape_gradients(tet_positions(mesh, t));
    const LameParameters lame = lame_parameters(materials.youngs_modulus[t], materials.poisson_ratio[t]);
    const double mass = materials.density[t] * volumes[t];
    wave_rate_ = std::max(wave_rate_, std::sqrt((lame.lambda + 2 * lame.mu) / materials.density[t]) / edge_);
    for_pairs(t, [&](std::size_t row, std::int32_t column, int i, int j) {
      const auto begin = columns_.begin() + start_of[row];
      const auto k = static_cast<std::size_t>(
          std::lower_bound(begin, begin + static_cast<std::ptrdiff_t>(neighbours[row].size()), column) -
          columns_.begin());
      const double laplacian = volumes[t] * gradients.row(i).dot(gradients.row(j));
      mass_[k] += mass * (i == j ? 0.1 : 0.05);
      variance_matrix_[k] += beta * lame.mu * laplacian;
      const double share = (kShearShare * lame.mu + kVolumeShare * lame.lambda) * laplacian;
      laplacian_[k] += share;
      if (i == j) stiffness[static_cast<Eigen::Index>(row)] += share;
    });
    shear_energy_ += volumes[t] * lame.mu;
    for (int i = 0; i < 4; ++i)
      if (const std::int32_t own = number(mesh.tets(t, i)); own >= 0)
        gravity_load_.middleRows<3>(3 * own).diagonal().array() += mass / 4;
  }
  stiffness_ = stiffness.norm();
}

void FullSpace::add_elements(const Elements& elements, const TetMaterials& materials) {
  std::vector<std::int32_t> order(static_cast<std::size_t>(elements.count()));
  std::iota(order.begin(), order.end(), 0);
  const auto first_place = [&](std::int32_t element) {
    std::int32_t least = static_cast<std::int32_t>(vertices());
    for (const std::int32_t vertex : elements.vertices_of(element))
      if (const std::int32_t place = place_of_[static_cast<std::size_t>(vertex)]; place >= 0)
        least = std::min(least, place);
    return least;
  };
  std::ranges::stable_sort(order, {}, first_place);
  const auto moving = [&](std::int32_t element) {
    return std::ranges::count_if(elements.vertices_of(element),
                                 [&](std::int32_t vertex) { return place_of_[static_cast<std::size_t>(vertex)] >= 0; });
  };
  const std::vector<std::int32_t> within =
      by_length(elements.count(), [&](std::int32_t i) { return moving(order[static_cast<std::size_t>(i)]); });
  const Eigen::Index padded_count = (elements.count() + kMeshLanes - 1) / kMeshLanes * kMeshLanes;
  mu_ = lambda_ = variance_ = AlignedArray(padded_count);
  std::vector<std::vector<Corner>> lists(static_cast<std::size_t>(padded_count));
  for (Eigen::Index at = 0; at < elements.count(); ++at) {
    const std::int32_t element = order[static_cast<std::size_t>(within[static_cast<std::size_t>(at)])];
    element_at_.push_back(element);
    const auto gradients = elements.gradients_of(element);
    Eigen::Index row = 0;
    for (const std::int32_t vertex : elements.vertices_of(element)) {
      const std::int32_t place = place_of_[static_cast<std::size_t>(vertex)];
      if (place >= 0)
        lists[static_cast<std::size_t>(at)].push_back(
            {place, {gradients(row, 0), gradients(row, 1), gradients(row, 2)}});
      ++row;
    }
    const LameParameters lame = elements.lame(element);
    mu_[at] = elements.volumes[element] * lame.mu;
    lambda_[at] = elements.volumes[element] * lame.lambda;
    variance_[at] = elements.smoothed() ? materials.variance_factor * mu_[at] : 0;
  }
  std::vector<std::vector<Corner>> around(static_cast<std::size_t>(places()));
  for (std::size_t e = 0; e < lists.size(); ++e)
    for (const Corner& corner : lists[e])
      around[static_cast<std::size_t>(corner.index)].push_back({static_cast<std::int32_t>(e), corner.gradient});
  std::vector<std::vector<Corner>> of_rows;
  for (const std::int32_t row : rows_) of_rows.push_back(around[static_cast<std::size_t>(row)]);
  elements_ = CornerLists(lists);
  around_ = CornerLists(of_rows);
}

CornerLists::CornerLists(const std::vector<std::vector<Corner>>& lists) {
  for (std::size_t first = 0; first < lists.size(); first += kMeshGroup) {
    const auto own = std::span(lists).subspan(first, std::min<std::size_t>(kMeshGroup, lists.size() - first));
    const std::size_t length = std::ranges::max(own, {}, &std::vector<Corner>::size).size();
    for (std::size_t k = 0; k < length; ++k)
      for (std::size_t i = 0; i < kMeshGroup; ++i) {
        const Corner corner = i < own.size() && k < own[i].size() ? own[i][k] : Corner{};
        indices.push_back(corner.index);
        gradients.insert(gradients.end(), corner.gradient.begin(), corner.gradient.end());
      }
    starts.push_back(starts.back() + static_cast<std::int32_t>(length));
  }
  gradients.push_back(0);
  rounded_gradients.assign(gradients.begin(), gradients.end());
}

void FullSpace::add_filter(const RowMatrix& filter) {
  functions_.setZero(vertices(), filter.cols());
  for (Eigen::Index v = 0; v < filter.rows(); ++v)
    if (number(v) >= 0) functions_.row(place(v)) = filter.row(v);
  // A translation of a free body is no deformation: W' = W - (M 1) (1^T W) / m.
  if (!clamped_ && functions() > 0) {
    const Eigen::VectorXd shares = masses();
    functions_ -= shares / shares.sum() * functions_.colwise().sum().eval();
  }
  filter_ = FullFilter<double>(functions_);
  rounded_filter_ = FullFilter<float>(functions_);
}

FullSpace::Scalar FullSpace::scalar_matrix(const std::vector<double>& values) const {
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t i = 0; i < rows_.size(); ++i)
    for (auto k = static_cast<std::size_t>(row_starts_[i]); k < static_cast<std::size_t>(row_starts_[i + 1]); ++k)
      if (std::max(rows_[i], columns_[k]) < vertices()) entries.emplace_back(rows_[i], columns_[k], values[k]);
  Scalar matrix(vertices(), vertices());
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

void FullSpace::to_field(const Eigen::VectorXd& x, Eigen::VectorXd& field) const noexcept {
  for (std::size_t k = 0; k < vertex_of_.size(); ++k) {
    const auto place = static_cast<Eigen::Index>(4 * k);
    field.segment<3>(place) = x.segment<3>(3 * vertex_of_[k]);
    field[place + 3] = 0;
  }
}

Eigen::VectorXd FullSpace::to_field(const Eigen::VectorXd& x) const {
  Eigen::VectorXd field(field_size());
  to_field(x, field);
  return field;
}

void FullSpace::from_field(const Eigen::VectorXd& field, Eigen::VectorXd& x) const noexcept {
  for (std::size_t k = 0; k < vertex_of_.size(); ++k)
    x.segment<3>(3 * vertex_of_[k]) = field.segment<3>(static_cast<Eigen::Index>(4 * k));
}

Eigen::VectorXd FullSpace::masses() const {
  Eigen::VectorXd all(places());
  const auto all_move = [](Eigen::Index) { return Eigen::Vector3d(1, 0, 0); };
  for_momenta(all_move, [&](Eigen::Index place, const Eigen::Vector3d& own) { all[place] = own[0]; });
  return all;
}

Eigen::VectorXd FullSpace::momentum(const Eigen::VectorXd& v) const {
  Eigen::VectorXd all(v.size());
  const auto velocity = [&](Eigen::Index place) -> Eigen::Vector3d {
    return place < vertices() ? Eigen::Vector3d(v.segment<3>(3 * number_at(place))) : Eigen::Vector3d::Zero();
  };
  for_momenta(velocity, [&](Eigen::Index place, const Eigen::Vector3d& own) {
    if (place < vertices()) all.segment<3>(3 * number_at(place)) = own;
  });
  return all;
}

MeshArrays FullSpace::arrays() const noexcept {
  MeshArrays mesh;
  mesh.vertices = places();
  mesh.panels = padded_elements() / kMeshLanes;
  mesh.starts = elements_.starts.data();
  mesh.corners = elements_.indices.data();
  mesh.gradients = elements_.gradients.data();
  mesh.rounded_gradients = elements_.rounded_gradients.data();
  mesh.around_starts = around_.starts.data();
  mesh.around = around_.indices.data();
  mesh.gradients_around = around_.gradients.data();
  mesh.rounded_gradients_around = around_.rounded_gradients.data();
  mesh.variance = variance_.data();
  mesh.rows = rows_.data();
  mesh.row_starts = row_starts_.data();
  mesh.columns = columns_.data();
  mesh.mass = mass_.data();
  mesh.variance_matrix = variance_matrix_.data();
  return mesh;
}

ElementLaw FullSpace::law() const noexcept {
  ElementLaw law;
  law.kind = law_kind(model_);
  law.mu = mu_.data();
  law.lambda = lambda_.data();
  return law;
}

FullTarget FullSpace::make_target(Eigen::Index groups) const {
  return {groups, AlignedArray(padded_elements() * groups * 9),
          AlignedArray(padded_elements() * groups * kInverseNumbers), AlignedArray(groups)};
}

void FullSpace::set_target(const double* field, double factor, const Eigen::VectorXd& shares, std::size_t group,
                           FullTarget& target) const noexcept {
  const auto own = static_cast<Eigen::Index>(group);
  for (Eigen::Index e = 0; e < padded_elements(); ++e) {
    const Eigen::Matrix3d H = displacement_gradient(field, e);
    double* const shift = target.shifts.data() + target.place(e, own, 9);
    double* const inverse = target.inverses.data() + target.place(e, own, kInverseNumbers);
    for (Eigen::Index i = 0; i < 9; ++i) shift[i * kLanes] = H(i / 3, i % 3);
    invert_target(shift, inverse);
    if (shares.size() > 0) inverse[9 * kLanes] *= shares[e];
  }
  target.factors[own] = factor;
}

Eigen::VectorXd FullSpace::element_means(const TetMesh& mesh, const TetMaterials& materials,
                                         const Eigen::VectorXd& values) const {
  const Eigen::VectorXd means = mean_over_elements(mesh, elements_of(mesh, materials), values);
  Eigen::VectorXd own = Eigen::VectorXd::Zero(padded_elements());
  own.head(std::ssize(element_at_)) = means(element_at_);
  return own;
}

ElementLaw FullSpace::law(const FullTarget& target) const noexcept {
  ElementLaw own = law();
  own.shift_count = target.count;
  own.shifts = target.shifts.data();
  own.inverses = target.inverses.data();
  own.shift_weights = target.factors.data();
  return own;
}

Eigen::Matrix3d FullSpace::displacement_gradient(const double* field, Eigen::Index element) const noexcept {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  const auto list = static_cast<std::size_t>(element / kMeshGroup);
  for (Eigen::Index k = elements_.starts[list]; k < elements_.starts[list + 1]; ++k) {
    const auto at = static_cast<std::size_t>(k * kMeshGroup + element % kMeshGroup);
    H += Eigen::Map<const Eigen::Vector3d>(field + 4 * elements_.indices[at]) *
         Eigen::Map<const Eigen::RowVector3d>(&elements_.gradients[3 * at]);
  }
  return H;
}

void FullSpace::projected_tangents(const double* field, const FullTarget* example, double stiffness_damping,
                                   bool freeze, double* frozen, float* tangents) const noexcept {
  with_material(model_, [&](auto material) {
    using Own = decltype(material);
    // Tangent of e v Psi((I + H) A): A times each block of rows and columns of an axis, times A^T.
    const auto example_tangent = [&](Eigen::Index e, Eigen::Index group, const Eigen::Matrix3d& H) -> Matrix9 {
      const double* const numbers = example->inverses.data() + example->place(e, group, kInverseNumbers);
      Eigen::Matrix3d A;
      for (Eigen::Index i = 0; i < 9; ++i) A(i / 3, i % 3) = numbers[i * kLanes];
      const double weight = example->factors[group] * numbers[9 * kLanes];
      const Eigen::Matrix3d own = (Eigen::Matrix3d::Identity() + H) * A - Eigen::Matrix3d::Identity();
      Matrix9 D = projected_tangent<Own>(own, {weight * mu_[e], weight * lambda_[e]});
      for (Eigen::Index a = 0; a < 9; a += 3)
        for (Eigen::Index b = 0; b < 9; b += 3) D.block<3, 3>(a, b) = (A * D.block<3, 3>(a, b) * A.transpose()).eval();
      return D;
    };
    for (Eigen::Index e = 0; e < padded_elements(); ++e) {
      const Eigen::Matrix3d H = displacement_gradient(field, e);
      Matrix9 D = projected_tangent<Own>(H, {mu_[e], lambda_[e]});
      D.diagonal().array() -= variance_[e];
      Matrix9 pulled = Matrix9::Zero();
      for (Eigen::Index group = 0; example != nullptr && group < example->count; ++group)
        if (example->factors[group] > 0) pulled += example_tangent(e, group, H);
      double* const own_frozen = frozen + e / kLanes * kLanes * kTangentNumbers + e % kLanes;
      float* const own = tangents + e / kMeshLanes * kMeshLanes * kTangentNumbers + e % kMeshLanes;
      for (Eigen::Index i = 0, entry = 0; i < 9; ++i)
        for (Eigen::Index j = i; j < 9; ++j, ++entry) {
          double value = D(i, j);
          if (stiffness_damping > 0) {
            if (freeze) own_frozen[entry * kLanes] = value;
            value += stiffness_damping * own_frozen[entry * kLanes];
          }
          own[entry * kMeshLanes] = static_cast<float>(value + pulled(i, j));
        }
    }
  });
}

FullPreconditioner::FullPreconditioner(const FullSpace& space, double mass_factor, double stiffness_factor,
                                       const Eigen::VectorXd& filter_stiffness, bool with_diagonal)
    : size_(space.vertices()) {
  const Eigen::SparseMatrix<double> matrix =
      mass_factor * space.mass() + stiffness_factor * space.preconditioning_stiffness();
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>> factor(matrix);
  const Eigen::SparseMatrix<double> L = factor.matrixL();
  take_blocks(L);

  if (with_diagonal) diagonal_ = diagonal_of_inverse(L);

  // Woodbury: S^-1 - Z (1 + V^T Z)^-1 Z^T with V = W k^1/2, Z = S^-1 V, as the square of Z times a root of the inverse.
  if (filter_stiffness.size() == 0 || filter_stiffness.isZero(0)) return;
  const Eigen::MatrixXd V = space.function_values() * filter_stiffness.cwiseSqrt().asDiagonal();
  const Eigen::MatrixXd Z = factor.solve(V);
  Eigen::MatrixXd small = V.transpose() * Z;
  small.diagonal().array() += 1;
  const Eigen::MatrixXd root =
      small.llt().matrixU().solve(Eigen::MatrixXd(Eigen::MatrixXd::Identity(V.cols(), V.cols())));
  functions_ = FullFilter<float>(Z * root);
  if (with_diagonal) diagonal_ -= (Z * root).rowwise().squaredNorm();
}

void FullPreconditioner::take_blocks(const Eigen::SparseMatrix<double>& L) {
  using Block = Eigen::Matrix<float, kFactorBlock, kFactorBlock, Eigen::RowMajor>;
  const Eigen::Index blocks = (size_ + kFactorBlock - 1) / kFactorBlock;
  std::vector<Block> values, diagonal;
  std::vector<Eigen::Matrix4d> column(static_cast<std::size_t>(blocks), Eigen::Matrix4d::Zero());
  for (Eigen::Index own = 0; own < blocks; ++own) {
    const Eigen::Index begin = kFactorBlock * own, width = std::min(kFactorBlock, size_ - begin);
    std::set<std::int32_t> found;
    for (Eigen::Index k = 0; k < width; ++k)
      for (Eigen::SparseMatrix<double>::InnerIterator entry(L, begin + k); entry; ++entry) {
        column[static_cast<std::size_t>(entry.index() / kFactorBlock)](entry.index() % kFactorBlock, k) = entry.value();
        found.insert(static_cast<std::int32_t>(entry.index() / kFactorBlock));
      }
    for (const std::int32_t row : found) {
      Eigen::Matrix4d& block = column[static_cast<std::size_t>(row)];
      if (row == own) {
        Eigen::Matrix4d inverse = Eigen::Matrix4d::Zero();
        inverse.topLeftCorner(width, width) = block.topLeftCorner(width, width).inverse();
        diagonal.push_back(inverse.cast<float>());
        diagonal.push_back(inverse.transpose().cast<float>());
      } else {
        rows_.push_back(row);
        values.push_back(block.cast<float>());
      }
      block.setZero();
    }
    starts_.push_back(static_cast<std::int32_t>(rows_.size()));
  }
  values_ = join<float>(values);
  diagonal_blocks_ = join<float>(diagonal);
}

float FullPreconditioner::begin_solve(const Kernels& run, const AlignedFloats& right, AlignedFloats& x,
                                      AlignedFloats& coefficients) const noexcept {
  float square = run.mesh_solve_lower(factor(), right.data(), x.data());
  if (functions_.empty()) return square;
  run.mesh_rounded_coefficients(functions_.arrays(), right.data(), coefficients.data());
  return square - coefficients.vector().squaredNorm();
}

void FullPreconditioner::end_solve(const Kernels& run, AlignedFloats& x,
                                   const AlignedFloats& coefficients) const noexcept {
  run.mesh_solve_upper(factor(), x.data());
  if (!functions_.empty()) run.mesh_add_rounded_functions(functions_.arrays(), -1, coefficients.data(), x.data());
}

}  // namespace exmat::runtime
