#pragma once

#include <memory>
#include <string>
#include <vector>

#include "precompute/examples/example_stage.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/pose_map.h"
#include "precompute/solvers/semidefinite_solver.h"
#include "precompute/targets/target_space.h"

namespace exmat::precompute {

/// Puts copies of the shape space and of the example sets, as far as they do without a basis, into a model.
void preview_examples(const ShapeStage& stage, ReducedModel& model);

/// Makes the poses of a shape stage fit for the body, and brings them into its modal basis.
class PoseFitter {
 public:
  /// `solver` is that of the system's stiffness, asked only for regions and gone before another matrix is factorised;
  /// `highest` [1/s^2] the squared frequency of the highest linear mode: the basis resolves nothing finer. The others
  /// are kept by reference.
  PoseFitter(const AssetConfig& asset, const ObjectInput& object, const ElasticSystem& system,
             std::unique_ptr<SemidefiniteSolver> solver, double highest, const ShapeStage& stage);

  /// [f x k] displacements of all poses, groups in order: what the basis is to hold. Where the asset has a tolerance of
  /// poses, those of the whole body are as they were given, with what the m functions lose of them: the force of the
  /// others moves the body along them.
  Eigen::MatrixXd fields() const;

  Eigen::Index groups() const { return std::ssize(poses_); }
  /// Empty: that of the whole body.
  const std::string& region(Eigen::Index group) const { return stage_.groups[static_cast<std::size_t>(group)].region; }
  /// Null: the whole body's.
  const RegionView* view(Eigen::Index group) const {
    const auto& view = stage_.groups[static_cast<std::size_t>(group)].view;
    return view ? &*view : nullptr;
  }

  /// All poses that descriptors of a group stand for; of a free body without their rigid part.
  PoseCoordinates range(Eigen::Index group) const;

  /// [n_t] shares of the tets in an elastic force of a group: 1 of the whole body.
  Eigen::VectorXd tet_shares(Eigen::Index group) const;

  /// Puts shape space, projections, examples and their targets, one for each group, into a model that has its modal
  /// basis.
  void put(const std::vector<TargetSpace>& targets, ReducedModel& model) const;

  /// A pose of a group, k > 0, as its stages leave it: displacements [3n] of the object, as a region sees them.
  struct PoseFields {
    Eigen::VectorXd given;    ///< as it came, about the mean of the fixed vertices; as it stands where these follow
    Eigen::VectorXd carried;  ///< the part that the m functions hold
    Eigen::VectorXd clamped;  ///< and with the fixed vertices put back
  };
  PoseFields pose_fields(Eigen::Index group, Eigen::Index k) const;
  /// Displacements [3n x k] as a group sees them.
  RowMatrix seen(Eigen::Index group, const RowMatrix& displacements) const;

  /// Logs what of each example of a model is lost, and records what is worth a warning.
  void log_losses(const ReducedModel& model, std::vector<std::string>& warnings) const;

 private:
  struct Finished {
    ExampleSet examples;
    ProjectionData projection;
  };
  Finished finish_group(std::size_t group, const ReducedModel& model) const;
  Eigen::MatrixXd pull(std::size_t group, const ProjectionData& projection, const TargetSpace& targets) const;

  const AssetConfig& asset_;
  const ObjectInput& object_;
  const ElasticSystem& system_;
  const ShapeStage& stage_;
  std::vector<Eigen::MatrixXd> poses_;   // f x 3m of unit changes of descriptor, of the groups
  std::vector<Eigen::MatrixXd> fields_;  // f x (K-1), of the groups
  std::vector<Eigen::MatrixXd> held_;    // likewise, what the basis is to hold of them
};

}  // namespace exmat::precompute
