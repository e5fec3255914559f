#include "runtime/sim/space/full/full_model.h"

#include <string>
#include <utility>

namespace exmat::runtime {
namespace {

FullExamples full_examples(const FullSpaceData& data, const ReducedModel& reduced, const ExampleModel& examples) {
  FullExamples made;
  made.weights = ExampleWeights(reduced.examples->gram, reduced.examples->h0, data.slopes);
  if (examples.table) {
    TargetTableData table = *reduced.targets;
    table.control_points = data.control_points;
    made.table.emplace(table);
  } else {
    made.from_target = data.from_target.transpose() * examples.target->basis();
  }
  return made;
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

void FullModel::set_frame_of_examples() {
  if (!rigid && !carried) return;
  const MeshFilter<double> filter = space.filter();
  const Eigen::Map<const RowMatrix> all(filter.functions, filter.vertices, filter.stride);
  const auto W = all.leftCols(space.functions());
  const Eigen::Matrix4Xd& from_origin = rigid ? rigid->rest() : carried->rest();
  examples->rest = W.transpose() * from_origin.topLeftCorner(3, filter.vertices).transpose();
  examples->ones = W.colwise().sum();
}

void FullModel::set_shapes(const RowMatrix& all, const ExampleModel& reduced) {
  const RowMatrix own = moving_rows(space, all);
  examples->shapes = reduced.table ? Eigen::MatrixXd(own) : Eigen::MatrixXd(own * reduced.target->basis());
  is_elastic = true;
}

FullModelResult build_full_model(const ReducedModel& reduced, const Model& model) {
  if (model.region_count() > 0)
    return {nullptr, {"", "/regions", "no local example forces of a body in full space", "some", "take space reduced"}};
  const bool forced = model.has_whole_body_examples();
  if (forced && !reduced.full_space)
    return {nullptr,
            {"", "/full_space", "this group, since the scene asks for steps in full space", "none",
             "precompute the bundle again with this scene (--scene)"}};
  if (reduced.skeleton && model.frame->is_driven())
    return {nullptr, {"", "/skeleton", "no motion that carries the body", "one", "its bones carry it"}};
  const ObjectData& object = *reduced.object;
  const bool is_carried = model.frame->is_driven();
  auto full = std::make_unique<FullModel>(
      FullSpace(object.mesh, object.materials, object.fixed, forced ? reduced.full_space->filter : RowMatrix(),
                is_carried || reduced.skeleton ? FixedVertices::kDriven : FixedVertices::kStay));
  full->rest = object.mesh.vertices;
  if (is_carried) full->carried.emplace(full->space, object.mesh.vertices);
  if (reduced.skeleton) full->skin.emplace(full->space, object.mesh.vertices, *reduced.skeleton);
  if (!full->space.is_clamped()) full->rigid.emplace(full->space, object.mesh.vertices);
  if (model.contact) full->contacts.emplace(*model.contact, full->space, model.frame->origin());
  if (forced) {
    full->examples = full_examples(*reduced.full_space, reduced, model.examples.front());
    full->set_frame_of_examples();
    if (const RowMatrix& shapes = reduced.full_space->shapes; model.examples.front().elasticity && shapes.size() > 0) {
      if (shapes.rows() != 3 * object.mesh.vertex_count())
        return {nullptr,
                {"", "/full_space/shapes", "the vertices of the object", std::to_string(shapes.rows() / 3),
                 "precompute the bundle again"}};
      full->set_shapes(shapes, model.examples.front());
    }
  }
  full->basis = moving_rows(full->space, reduced.modal->basis);
  full->projection.resize(full->basis.rows(), full->basis.cols());
  for (Eigen::Index i = 0; i < model.modes(); ++i) full->projection.col(i) = full->space.momentum(full->basis.col(i));
  return {std::move(full), {}};
}

}  // namespace exmat::runtime
