#include "precompute/study/measure/full_space_trajectory.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "common/bundle/bundle.h"
#include "common/bundle/file_schemas.h"
#include "common/core/progress.h"
#include "common/hdf5/xdmf.h"
#include "common/mesh/geometry.h"
#include "runtime/scene/samples.h"

namespace exmat::precompute {
namespace {

// Example forces that act at any time, in the order of the scene: the whole body's, then the regions'.
std::vector<runtime::WeightInfo> acting(const SceneConfig& config, const FullSpaceModel& model) {
  std::vector<runtime::WeightInfo> forces;
  std::size_t i = 0;
  const auto add = [&](const std::string& name, const ExampleForceConfig& force) {
    if (force.stiffness > 0 || force.damping > 0) forces.push_back({i, name, model.examples[i].count()});
    ++i;
  };
  if (config.examples) add("", *config.examples);
  for (const RegionForceConfig& region : config.regions) add(region.name, region.force);
  return forces;
}

SymbolSizes sizes_of(const ReducedModel& data, std::int64_t frames) {
  SymbolSizes sizes;
  sizes.set("F", frames, "the scene");
  sizes.set("n", data.object->mesh.vertex_count(), "the bundle");
  sizes.set("n_t", data.object->mesh.tet_count(), "the bundle");
  return sizes;
}

Hdf5File create_file(const AtomicFile& output, const SceneConfig& config, const ReducedModel& data,
                     const SymbolSizes& sizes, const std::vector<runtime::WeightInfo>& forces, std::int64_t frames) {
  Hdf5File file = Hdf5File::create(output.temporary(), output.target().string());
  write_header(file, trajectory_schema(), generator_name());
  file.write_attribute("/", "asset_name", data.asset_name);
  file.write_attribute("/", "input_sha256", data.input_sha256);
  file.write_attribute("/", "bundle", std::string());
  file.write_attribute("/", "integrator", std::string(name_of(config.integrator)));
  file.write_attribute("/", "time_step", config.time_step);
  file.write_attribute("/", "full_frames", frames);
  runtime::write_body_groups(file, "", sizes, forces);
  return file;
}

}  // namespace

FullSpaceTrajectory::FullSpaceTrajectory(const std::filesystem::path& file, const SceneConfig& config,
                                         const ReducedModel& data, const FullSpaceRun& body, std::int64_t frames)
    : data_(data),
      body_(body),
      output_(file),
      weights_(acting(config, body.model)),
      file_(create_file(output_, config, data, sizes_of(data, frames), weights_, frames)),
      mass_(scalar_mass(data.object->mesh, data.object->materials.density)) {
  const SymbolSizes sizes = sizes_of(data, frames);
  const DatasetSchema& tets = trajectory_schema().dataset("/tets");
  write_dataset(file_, tets, tets.path, sizes.evaluate(tets.dims), data.object->mesh.tets.data());
  datasets_ = std::make_unique<runtime::TrajectoryRows>(file_, "", sizes, weights_);
}

FullSpaceTrajectory::~FullSpaceTrajectory() = default;

void FullSpaceTrajectory::append(double step_seconds) {
  const VertexArray positions = world_positions(body_.model, body_.state);
  const runtime::Energies now = energies(body_.model, body_.scene, body_.state);
  if (times_.empty()) {
    origin_ = origin_near(positions);
    file_.write_attribute("/", "origin", std::vector<double>(origin_.data(), origin_.data() + 3));
  }
  times_.push_back(body_.state.time);
  datasets_->time.append(body_.state.time);
  datasets_->append_drawn(body_.state.time, positions, origin_, datasets_->positions);
  append_motion(positions);
  datasets_->kinetic.append(now.kinetic);
  datasets_->elastic.append(now.elastic);
  datasets_->potential.append(now.potential);
  datasets_->step_time.append(step_seconds);
  for (std::size_t i = 0; i < weights_.size(); ++i)
    datasets_->weights[i].append(runtime::row_of(body_.state.examples[weights_[i].force].weights));
  inverted_.last = inverted_tet_count(data_.object->mesh, positions);
  inverted_.most = std::max(inverted_.most, inverted_.last);
}

// A free body's frame is the one that fits it best; momenta are by the consistent mass.
void FullSpaceTrajectory::append_motion(const VertexArray& positions) {
  const VertexArray momentum = mass_ * world_velocities(body_.model, body_.state);
  const Eigen::VectorXd weights = mass_ * Eigen::VectorXd::Ones(mass_.cols());
  const Eigen::RowVector3d centre = weights.transpose() * positions / weights.sum();
  Eigen::Vector3d linear = Eigen::Vector3d::Zero(), angular = Eigen::Vector3d::Zero(), moved = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < positions.rows(); ++i) {
    linear += momentum.row(i).transpose();
    angular += (positions.row(i) - centre).cross(momentum.row(i)).transpose();
  }
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  if (body_.model.frame) {
    const FittedFrame::Placement placement = body_.model.frame->place(body_.state.q);
    moved = placement.centre - body_.model.frame->centre_at_rest();
    turn = Eigen::Quaterniond(placement.rotation);
  }
  const std::array orientation{turn.w(), turn.x(), turn.y(), turn.z()};
  datasets_->body_position.append(runtime::row_of(moved));
  datasets_->body_orientation.append(std::span<const double>(orientation));
  datasets_->linear_momentum.append(runtime::row_of(linear));
  datasets_->angular_momentum.append(runtime::row_of(angular));
}

void FullSpaceTrajectory::finish() {
  datasets_->finish();
  datasets_.reset();
  file_.close();
  output_.commit();
  const TetMesh& mesh = data_.object->mesh;
  const XdmfCells body{"Tetrahedron", "/tets", "/vertices", 4, mesh.tet_count(), mesh.vertex_count()};
  write_file_atomically(std::filesystem::path(output_.target()).replace_extension(".xdmf"),
                        xdmf_text(output_.target(), {{data_.asset_name, body}}, times_));
}

FullSpaceSummary write_full_space(const SceneConfig& config, const std::filesystem::path& file) {
  const ReducedModel data = read_bundle(config.bundle);
  FullSpaceRun body(config, data);
  FullSpaceSummary summary;
  summary.steps = config.steps;
  summary.frames = 1 + config.steps / config.every;
  FullSpaceTrajectory trajectory(file, config, data, body, summary.frames);
  trajectory.append(0);
  runtime::Samples seconds(config.steps), newton(config.steps);
  Progress progress("full space", config.steps);
  while (body.state.step < config.steps) {
    const FullSpaceReport report = body.sound_step();
    seconds.add(report.seconds);
    newton.add(report.newton_iterations);
    summary.unconverged += (report.status & runtime::kStepUnconverged) != 0;
    if (body.state.step % config.every == 0) trajectory.append(report.seconds);
    progress.advance();
  }
  trajectory.finish();
  summary.step_seconds = seconds.quantile(0.5);
  summary.newton_iterations = newton.mean();
  summary.energies = energies(body.model, body.scene, body.state);
  summary.inverted = trajectory.inverted();
  return summary;
}

}  // namespace exmat::precompute
