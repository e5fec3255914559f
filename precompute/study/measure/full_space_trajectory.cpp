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

// An example force whose weights are written, by its place among the body's.
struct Force {
  std::size_t place = 0;
  std::string region;  // empty: the whole body
  std::int64_t count = 0;
};

// Those that act, in the order of the scene: the whole body's, then the regions'.
std::vector<Force> acting(const SceneConfig& config, const FullSpaceRun& body) {
  std::vector<std::string> names;
  if (config.examples) names.emplace_back();
  for (const RegionForceConfig& region : config.regions) names.push_back(region.name);
  std::vector<Force> forces;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (runtime::acts(body.scene.examples[i])) forces.push_back({i, names[i], body.model.examples[i].count()});
  return forces;
}

void write_groups(Hdf5File& file, const std::vector<Force>& forces) {
  for (const GroupSchema& group : trajectory_schema().groups) {
    const bool regional = group.group == "regions";
    const auto belongs = [&](const Force& force) { return force.region.empty() != regional; };
    if (group.group == "render") continue;
    if ((regional || group.group == "examples") && std::ranges::none_of(forces, belongs)) continue;
    if (is_single(group.path)) {
      write_group(file, group, group.path);
      continue;
    }
    for (const Force& force : forces)
      if (belongs(force)) write_group(file, group, fill_name(group.path, kRegionPlaceholder, force.region));
  }
}

Hdf5File create_file(const AtomicFile& output, const SceneConfig& config, const ReducedModel& data,
                     const std::vector<Force>& forces) {
  Hdf5File file = Hdf5File::create(output.temporary(), output.target().string());
  write_header(file, trajectory_schema(), generator_name());
  file.write_attribute("/", "asset_name", data.asset_name);
  file.write_attribute("/", "input_sha256", data.input_sha256);
  file.write_attribute("/", "bundle", std::string());
  file.write_attribute("/", "integrator", std::string(name_of(config.integrator)));
  file.write_attribute("/", "time_step", config.time_step);
  write_groups(file, forces);
  return file;
}

SymbolSizes sizes_of(const ReducedModel& data, std::int64_t frames) {
  SymbolSizes sizes;
  sizes.set("F", frames, "the scene");
  sizes.set("n", data.object->mesh.vertex_count(), "the bundle");
  sizes.set("n_t", data.object->mesh.tet_count(), "the bundle");
  return sizes;
}

std::span<const double> row_of(const Eigen::Vector3d& vector) { return {vector.data(), 3}; }

}  // namespace

struct FullSpaceTrajectory::Weights {
  Force force;
  RowWriter rows;
};

/// Open datasets, in the order of the format.
struct FullSpaceTrajectory::Datasets {
  Datasets(Hdf5File& opened, const SymbolSizes& known, const std::vector<Force>& forces) : file(opened), sizes(known) {
    for (const Force& force : forces) {
      DatasetSchema schema =
          trajectory_schema().dataset(force.region.empty() ? "/examples/weights" : "/regions/{region}/weights");
      schema.path = fill_name(schema.path, kRegionPlaceholder, force.region);
      SymbolSizes own = sizes;
      own.set("K", force.count, "the bundle");
      weights.push_back({force, RowWriter(file, schema, own)});
    }
  }
  RowWriter rows(const char* path) const { return {file, trajectory_schema().dataset(path), sizes}; }

  void finish() {
    for (RowWriter* dataset : {&time, &positions, &body_position, &body_orientation, &linear_momentum,
                               &angular_momentum, &kinetic, &elastic, &potential, &step_time})
      dataset->finish();
    for (Weights& force : weights) force.rows.finish();
  }

  Hdf5File& file;
  const SymbolSizes& sizes;
  RowWriter time = rows("/time");
  RowWriter positions = rows("/vertices");
  RowWriter body_position = rows("/body/position");
  RowWriter body_orientation = rows("/body/orientation");
  RowWriter linear_momentum = rows("/linear_momentum");
  RowWriter angular_momentum = rows("/angular_momentum");
  RowWriter kinetic = rows("/energy/kinetic");
  RowWriter elastic = rows("/energy/elastic");
  RowWriter potential = rows("/energy/potential");
  RowWriter step_time = rows("/step_time");
  std::vector<Weights> weights;
};

FullSpaceTrajectory::FullSpaceTrajectory(const std::filesystem::path& file, const SceneConfig& config,
                                         const ReducedModel& data, const FullSpaceRun& body, std::int64_t frames)
    : data_(data),
      body_(body),
      output_(file),
      file_(create_file(output_, config, data, acting(config, body))),
      mass_(scalar_mass(data.object->mesh, data.object->materials.density)) {
  const SymbolSizes sizes = sizes_of(data, frames);
  const DatasetSchema& tets = trajectory_schema().dataset("/tets");
  write_dataset(file_, tets, tets.path, sizes.evaluate(tets.dims), data.object->mesh.tets.data());
  datasets_ = std::make_unique<Datasets>(file_, sizes, acting(config, body));
}

FullSpaceTrajectory::~FullSpaceTrajectory() = default;

void FullSpaceTrajectory::append(double step_seconds) {
  const VertexArray positions = world_positions(body_.model, body_.state);
  const runtime::Energies now = energies(body_.model, body_.scene, body_.state);
  if (times_.empty()) {
    origin_ = origin_near(positions);
    file_.write_attribute("/", "origin", std::vector<double>(origin_.data(), origin_.data() + 3));
  }
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> drawn =
      (positions.rowwise() - origin_.transpose()).cast<float>();
  times_.push_back(body_.state.time);
  datasets_->time.append(body_.state.time);
  datasets_->positions.append(std::span<const float>(drawn.data(), static_cast<std::size_t>(drawn.size())));
  append_motion(positions);
  datasets_->kinetic.append(now.kinetic);
  datasets_->elastic.append(now.elastic);
  datasets_->potential.append(now.potential);
  datasets_->step_time.append(step_seconds);
  for (Weights& force : datasets_->weights) {
    const Eigen::VectorXd& weights = body_.state.examples[force.force.place].weights;
    force.rows.append(std::span<const double>(weights.data(), static_cast<std::size_t>(weights.size())));
  }
  inverted_.last = inverted_tet_count(data_.object->mesh, positions);
  inverted_.most = std::max(inverted_.most, inverted_.last);
}

// Of a free body the frame that fits it best; momenta by the consistent mass.
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
  datasets_->body_position.append(row_of(moved));
  datasets_->body_orientation.append(std::span<const double>(orientation));
  datasets_->linear_momentum.append(row_of(linear));
  datasets_->angular_momentum.append(row_of(angular));
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
