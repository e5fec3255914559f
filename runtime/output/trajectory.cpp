#include "runtime/output/trajectory.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <optional>
#include <span>
#include <utility>

#include "common/bundle/file_schemas.h"
#include "common/core/error.h"
#include "common/hdf5/xdmf.h"
#include "common/mesh/geometry.h"
#include "runtime/output/momentum.h"
#include "runtime/sim/frame/world_vertices.h"

namespace exmat::runtime {
namespace {

SymbolSizes sizes_of(const ReducedModel& model, const TrajectoryInfo& info) {
  SymbolSizes sizes;
  sizes.set("F", info.frames, "the scene");
  sizes.set("n", model.object->mesh.vertex_count(), "the bundle");
  sizes.set("n_t", model.object->mesh.tet_count(), "the bundle");
  sizes.set("r", model.modal->basis.cols(), "the bundle");
  if (info.attachments > 0) sizes.set("a", info.attachments, "the scene");
  if (model.skeleton) sizes.set("b", std::ssize(model.skeleton->bones), "the bundle");
  if (!model.render) return sizes;
  sizes.set("v", model.render->tets.size(), "the bundle");
  sizes.set("f", model.render->triangles.rows(), "the bundle");
  return sizes;
}

void write_run(Hdf5File& file, const std::string& group, const ReducedModel& model, const TrajectoryInfo& info) {
  file.write_attribute(group, "asset_name", model.asset_name);
  file.write_attribute(group, "input_sha256", model.input_sha256);
  file.write_attribute(group, "bundle", info.bundle);
  file.write_attribute(group, "integrator", info.integrator);
  file.write_attribute(group, "time_step", info.time_step);
}

Hdf5File create_file(const AtomicFile& output) {
  Hdf5File file = Hdf5File::create(output.temporary(), output.target().string());
  write_header(file, trajectory_schema(), generator_name());
  return file;
}

const GroupSchema& group_schema(std::string_view path) {
  return *std::ranges::find(trajectory_schema().groups, path, &GroupSchema::path);
}

}  // namespace

BodyFrames::BodyFrames(Hdf5File& file, std::string group, const NamedBody& body, std::optional<Eigen::Vector3d>& origin)
    : model_(body.model),
      frame_(body.frame),
      full_(body.full),
      info_(body.info),
      file_(file),
      origin_(origin),
      group_(std::move(group)),
      tets_(group_ + "/tets"),
      vertices_(group_ + "/vertices"),
      render_triangles_(group_ + "/render/triangles"),
      render_vertices_(group_ + "/render/vertices"),
      rest_masses_(tet_volumes(model_.object->mesh).cwiseProduct(model_.object->materials.density)),
      displacements_(model_.object->mesh.vertex_count(), 3),
      velocities_(model_.object->mesh.vertex_count(), 3) {
  write_run(file, owner(), model_, info_);
  const SymbolSizes sizes = sizes_of(model_, info_);
  write_body_groups(file, group_, sizes, info_.weights);
  const auto write = [&](const char* name, const auto& array) {
    const DatasetSchema& schema = trajectory_schema().dataset(name);
    write_dataset(file, schema, group_ + schema.path, sizes.evaluate(schema.dims), array.data());
  };
  write("/tets", model_.object->mesh.tets);
  if (model_.render) write("/render/triangles", model_.render->triangles);
  datasets_ = std::make_unique<TrajectoryRows>(file, group_, sizes, info_.weights);
}

BodyFrames::~BodyFrames() = default;

void BodyFrames::append(const State& state, const Energies& energies, double step_seconds) {
  const FrameMotion motion = frame_.motion(state.frame);
  const Eigen::Quaterniond& turn = motion.orientation;
  const std::array orientation{turn.w(), turn.x(), turn.y(), turn.z()};
  times_.push_back(state.time);
  if (state.full) ++full_frames_;
  datasets_->time.append(state.time);
  append_positions(state);
  datasets_->reduced->append(row_of(state.q));
  datasets_->reduced_velocity->append(row_of(state.v));
  datasets_->body_position.append(row_of(motion.position));
  datasets_->body_orientation.append(std::span<const double>(orientation));
  datasets_->kinetic.append(energies.kinetic);
  datasets_->elastic.append(energies.elastic);
  datasets_->potential.append(energies.potential);
  datasets_->step_time.append(step_seconds);
  for (std::size_t i = 0; i < info_.weights.size(); ++i)
    datasets_->weights[i].append(row_of(state.examples[info_.weights[i].force].weights));
  if (datasets_->bones) {
    Eigen::Matrix<double, 7, Eigen::Dynamic> bones(7, std::ssize(state.full->skeleton->bones));
    for (Eigen::Index b = 0; b < bones.cols(); ++b) {
      const BonePose& bone = state.full->skeleton->bones[static_cast<std::size_t>(b)];
      bones.col(b) << bone.joint, bone.turn.w(), bone.turn.vec();
    }
    datasets_->bones->append(row_of(bones));
  }
  if (info_.attachments == 0) return;
  Eigen::Matrix3Xd forces(3, info_.attachments), torques = forces;
  for (Eigen::Index i = 0; i < forces.cols(); ++i) {
    const Attachment& attachment = state.attachments[static_cast<std::size_t>(i)];
    forces.col(i) = attachment.force;
    torques.col(i) = attachment.torque;
  }
  datasets_->attachment_forces->append(row_of(forces));
  datasets_->attachment_torques->append(row_of(torques));
}

/// World positions and velocities, and displacements in the body's frame.
void BodyFrames::set_positions(const State& state, VertexArray& positions) {
  const VertexArray& rest = model_.object->mesh.vertices;
  const Placement placement = frame_.placement(state.frame);
  if (state.full) {
    const FrameVelocity velocity = frame_.velocity(state.frame);
    for (Eigen::Index v = 0; v < rest.rows(); ++v) {
      positions.row(v) = rest.row(v) + full_displacement(*full_, placement, *state.full, v).transpose();
      velocities_.row(v) = full_velocity(*full_, placement, velocity, *state.full, v);
    }
    displacements_ = ((positions.rowwise() - placement.position.transpose()) * placement.rotation).rowwise() +
                     placement.origin.transpose();
    displacements_ -= rest;
    return;
  }
  const RowMatrix& basis = model_.modal->basis;
  displacements_.reshaped<Eigen::RowMajor>().noalias() = basis * state.q;
  velocities_.reshaped<Eigen::RowMajor>().noalias() = basis * state.v;
  positions = rest + displacements_;
  if (frame_.moves()) to_world(placement, frame_.velocity(state.frame), positions, velocities_);
}

void BodyFrames::append_positions(const State& state) {
  VertexArray positions(displacements_.rows(), 3);
  set_positions(state, positions);
  if (!origin_) origin_ = origin_near(positions);
  if (times_.size() == 1)
    file_.write_attribute(owner(), "origin", std::vector<double>(origin_->data(), origin_->data() + 3));
  datasets_->append_drawn(times_.back(), positions, *origin_, datasets_->positions);
  if (model_.render) append_render_mesh(positions);
  largest_displacement_ = std::max(largest_displacement_, displacements_.rowwise().norm().maxCoeff());
  const std::optional<FrameMomenta> own = frame_.momenta(state.frame);
  const FrameMomenta now = own ? *own : momenta(model_.object->mesh.tets, rest_masses_, positions, velocities_);
  datasets_->linear_momentum.append(row_of(now.linear));
  datasets_->angular_momentum.append(row_of(now.angular));
}

/// From the positions of the tets' vertices, which the trajectory holds in any case: 12 products a vertex, where rows
/// of the basis of its own would take 3 r and as much memory. Weights add up to 1, so that the world frame serves.
void BodyFrames::append_render_mesh(const VertexArray& positions) {
  const RenderData& render = *model_.render;
  VertexArray drawn(render.tets.size(), 3);
  for (Eigen::Index k = 0; k < drawn.rows(); ++k) {
    const auto corners = model_.object->mesh.tets.row(render.tets[k]);
    drawn.row(k) = render.barycentric(k, 0) * positions.row(corners[0]);
    for (int c = 1; c < 4; ++c) drawn.row(k) += render.barycentric(k, c) * positions.row(corners[c]);
  }
  datasets_->append_drawn(times_.back(), drawn, *origin_, *datasets_->render);
}

void BodyFrames::finish() {
  file_.write_attribute(owner(), "full_frames", full_frames_);
  datasets_->finish();
  datasets_.reset();
}

XdmfCells BodyFrames::cells() const {
  const TetMesh& mesh = model_.object->mesh;
  return {"Tetrahedron", tets_, vertices_, 4, mesh.tet_count(), mesh.vertex_count()};
}

std::optional<XdmfCells> BodyFrames::render_cells() const {
  if (!model_.render) return std::nullopt;
  return XdmfCells{
      "Triangle", render_triangles_, render_vertices_, 3, model_.render->triangles.rows(), model_.render->tets.size()};
}

TrajectoryWriter::TrajectoryWriter(const std::filesystem::path& path, const std::vector<NamedBody>& bodies)
    : output_(path), file_(create_file(output_)) {
  const NamedBody& first = bodies.front();
  if (!first.name.empty()) {
    for (const char* name : {"asset_name", "input_sha256", "bundle"}) file_.write_attribute("/", name, std::string());
    file_.write_attribute("/", "integrator", first.info.integrator);
    file_.write_attribute("/", "time_step", first.info.time_step);
    file_.write_attribute("/", "origin", std::vector<double>(3));
    file_.write_attribute("/", "full_frames", std::int64_t{0});
    write_group(file_, group_schema("/bodies"), "/bodies");
  }
  for (const NamedBody& body : bodies) {
    const std::string group = body.name.empty() ? "" : fill_name("/bodies/{body}", kBodyPlaceholder, body.name);
    if (!group.empty()) write_group(file_, group_schema("/bodies/{body}"), group);
    frames_.push_back(std::make_unique<BodyFrames>(file_, group, body, origin_));
    names_.push_back(body.name.empty() ? body.model.asset_name : body.name);
  }
}

void TrajectoryWriter::finish() {
  for (const auto& frames : frames_) frames->finish();
  file_.close();
  output_.commit();
  const std::filesystem::path& target = output_.target();
  std::vector<XdmfPart> parts, drawn;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    parts.push_back({names_[i], frames_[i]->cells()});
    if (const std::optional<XdmfCells> cells = frames_[i]->render_cells()) drawn.push_back({names_[i], *cells});
  }
  const std::vector<double>& times = frames_.front()->times();
  write_file_atomically(std::filesystem::path(target).replace_extension(".xdmf"), xdmf_text(target, parts, times));
  if (drawn.empty()) return;
  write_file_atomically(target.parent_path() / (target.stem().string() + "_render.xdmf"),
                        xdmf_text(target, drawn, times));
}

double TrajectoryWriter::largest_displacement() const {
  double largest = 0;
  for (const auto& frames : frames_) largest = std::max(largest, frames->largest_displacement());
  return largest;
}

}  // namespace exmat::runtime
