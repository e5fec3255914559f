#include "runtime/sim/space/full/full_model.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"

namespace exmat::runtime {
namespace {

/// What a bundle holds of the whole body's examples, or of a region's.
struct GroupData {
  std::string place;  ///< of the group in the bundle, empty: the whole body
  const ExampleSet* set = nullptr;
  const std::optional<TargetTableData>* targets = nullptr;
  const std::optional<FullSpaceData>* full = nullptr;
  const RegionData* region = nullptr;  ///< null: the whole body
};

GroupData group_data(const ReducedModel& reduced, const std::string& name) {
  if (name.empty()) return {"", &*reduced.examples, &reduced.targets, &reduced.full_space, nullptr};
  const auto region = std::ranges::find(reduced.regions, name, &RegionData::name);
  return {"/regions/" + name, &region->examples, &region->targets, &region->full_space, &*region};
}

/// Values [n] at all vertices, of those [n_r] at a region's; none of the whole body.
Eigen::VectorXd at_all(const RegionData* region, const Eigen::VectorXd RegionData::*values, Eigen::Index vertices) {
  if (region == nullptr) return {};
  Eigen::VectorXd all = Eigen::VectorXd::Zero(vertices);
  all(region->vertices) = region->*values;
  return all;
}

/// [3m x 3(m + kBandFunctions)] of FullExamples: c = W^T D (u - R G^+ R_b^T u), R [3n x 6] rigid motions about the
/// band's centre, R_b by the band's shares, G = R_b^T R. `arms` [n x 3] from there, over `length`.
Eigen::MatrixXd seen_from_band(const RowMatrix& filter, const Eigen::VectorXd& shares, const Eigen::MatrixX3d& arms,
                               double length) {
  const Eigen::Index m = filter.cols();
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  const auto motions_of = [](const Eigen::Vector3d& arm) {
    Eigen::Matrix<double, 3, 6> motions;
    motions << Eigen::Matrix3d::Identity(), Eigen::Vector3d::UnitX().cross(arm), Eigen::Vector3d::UnitY().cross(arm),
        Eigen::Vector3d::UnitZ().cross(arm);
    return motions;
  };
  Matrix6 G = Matrix6::Zero();
  for (Eigen::Index v = 0; v < shares.size(); ++v)
    if (shares[v] > 0) G += shares[v] * motions_of(arms.row(v)).transpose() * motions_of(arms.row(v));
  Eigen::Matrix<double, 6, 3 * kBandFunctions> amounts = decltype(amounts)::Zero();
  for (Eigen::Index a = 0; a < 3; ++a) {
    const Eigen::Index b = (a + 1) % 3, c = (a + 2) % 3;
    amounts(a, a) = 1;
    amounts(3 + a, 3 * (1 + b) + c) = length;
    amounts(3 + a, 3 * (1 + c) + b) = -length;
  }
  const Eigen::MatrixX3d seen_arms = filter.transpose() * arms;
  const Eigen::VectorXd ones = filter.colwise().sum();
  Eigen::MatrixXd moved(3 * m, 6);
  for (Eigen::Index k = 0; k < m; ++k) {
    moved.middleRows<3>(3 * k) = motions_of(seen_arms.row(k));
    moved.block<3, 3>(3 * k, 0) *= ones[k];
  }
  Eigen::MatrixXd seen(3 * m, 3 * (m + kBandFunctions));
  const Eigen::MatrixXd inverse = Eigen::MatrixXd(G).completeOrthogonalDecomposition().pseudoInverse();
  seen << Eigen::MatrixXd::Identity(3 * m, 3 * m), Eigen::MatrixXd(-moved * inverse * amounts);
  return seen;
}

/// Rows [f] of the vertices that move, of those [3n] of all.
RowMatrix moving_rows(const FullSpace& space, const RowMatrix& all) {
  RowMatrix own(space.size(), all.cols());
  for (Eigen::Index v = 0; v < space.mesh_vertices(); ++v)
    if (const std::int32_t number = space.number(v); number >= 0)
      own.middleRows<3>(3 * number) = all.middleRows<3>(3 * v);
  return own;
}

}  // namespace

void append_functions(const RowMatrix& filter, const Eigen::VectorXd& band, const VertexArray& rest,
                      FullExamples& examples, RowMatrix& functions) {
  examples.first = functions.cols();
  examples.functions = filter.cols();
  const bool is_banded = band.size() > 0 && !band.isZero(0);
  RowMatrix own(filter.rows(), filter.cols() + (is_banded ? kBandFunctions : 0));
  own.leftCols(filter.cols()) = filter;
  if (is_banded) {
    const Eigen::VectorXd shares = band / band.sum();
    const Eigen::RowVector3d centre = shares.transpose() * rest;
    Eigen::MatrixX3d arms = rest.rowwise() - centre;
    const double length = std::sqrt(shares.dot(arms.rowwise().squaredNorm()));
    examples.seen = seen_from_band(filter, shares, arms, length);
    own.col(filter.cols()) = shares;
    own.rightCols<3>() = shares.asDiagonal() * arms / length;
  }
  RowMatrix all(filter.rows(), functions.cols() + own.cols());
  if (functions.cols() > 0) all.leftCols(functions.cols()) = functions;
  all.rightCols(own.cols()) = own;
  functions = std::move(all);
}

void FullModel::set_frame_of_functions() {
  if (!rigid && !carried) return;
  const Eigen::MatrixXd& F = space.function_values();
  const Eigen::Matrix4Xd& from_origin = rigid ? rigid->rest() : carried->rest();
  functions.rest = F.transpose() * from_origin.topLeftCorner(3, F.rows()).transpose();
  functions.ones = F.colwise().sum();
}

FullModelResult build_full_model(const ReducedModel& reduced, const Model& model) {
  const ObjectData& object = *reduced.object;
  const Eigen::Index vertices = object.mesh.vertex_count();
  std::vector<FullExamples> groups;
  RowMatrix functions(vertices, 0);
  for (const ExampleModel& examples : model.examples) {
    const GroupData data = group_data(reduced, examples.region);
    if (!*data.full)
      return {nullptr,
              {"", data.place + "/full_space", "this group, since the scene asks for steps in full space", "none",
               "precompute the bundle again with this scene (--scene)"}};
    const FullSpaceData& full = **data.full;
    FullExamples& own = groups.emplace_back();
    append_functions(full.filter, at_all(data.region, &RegionData::band, vertices), object.mesh.vertices, own,
                     functions);
    own.weights = ExampleWeights(data.set->gram, data.set->h0, full.slopes);
    own.shifts = full.shifts.transpose();
    if (examples.table) {
      TargetTableData table = **data.targets;
      table.control_points = full.control_points;
      own.table.emplace(table);
    } else {
      own.from_target = full.from_target.transpose() * examples.target->basis();
    }
  }
  if (reduced.skeleton && model.frame->is_driven())
    return {nullptr, {"", "/skeleton", "no motion that carries the body", "one", "its bones carry it"}};
  const bool is_carried = model.frame->is_driven();
  auto full = std::make_unique<FullModel>(
      FullSpace(object.mesh, object.materials, object.fixed, functions,
                is_carried || reduced.skeleton ? FixedVertices::kDriven : FixedVertices::kStay));
  full->rest = object.mesh.vertices;
  if (is_carried) full->carried.emplace(full->space, object.mesh.vertices);
  if (reduced.skeleton) full->skin.emplace(full->space, object.mesh.vertices, *reduced.skeleton);
  if (!full->space.is_clamped()) full->rigid.emplace(full->space, object.mesh.vertices);
  if (model.contact) full->contacts.emplace(*model.contact, full->space, model.frame->origin());
  full->examples = std::move(groups);
  full->set_frame_of_functions();
  for (std::size_t i = 0; i < model.examples.size(); ++i) {
    const ExampleModel& examples = model.examples[i];
    const GroupData data = group_data(reduced, examples.region);
    const RowMatrix& shapes = (*data.full)->shapes;
    if (!examples.elasticity || shapes.size() == 0) continue;
    if (shapes.rows() != 3 * vertices)
      return {nullptr,
              {"", data.place + "/full_space/shapes", "the vertices of the object", std::to_string(shapes.rows() / 3),
               "precompute the bundle again"}};
    const RowMatrix own = moving_rows(full->space, shapes);
    full->examples[i].shapes = examples.table ? Eigen::MatrixXd(own) : Eigen::MatrixXd(own * examples.target->basis());
    full->examples[i].is_elastic = true;
    if (data.region == nullptr) continue;
    FlagVector inside = FlagVector::Zero(vertices);
    inside(data.region->vertices).setOnes();
    full->examples[i].shares = full->space.element_means(
        object.mesh, object.materials,
        region_tet_shares(object.mesh, inside, at_all(data.region, &RegionData::window, vertices)));
  }
  full->basis = moving_rows(full->space, reduced.modal->basis);
  const Eigen::Index columns = padded(model.modes());
  full->projection = AlignedArray(full->basis.rows() * columns);
  Eigen::Map<RowMatrix> projection(full->projection.data(), full->basis.rows(), columns);
  for (Eigen::Index i = 0; i < model.modes(); ++i) projection.col(i) = full->space.momentum(full->basis.col(i));
  return {std::move(full), {}};
}

}  // namespace exmat::runtime
