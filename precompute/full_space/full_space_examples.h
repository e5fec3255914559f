#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/shape_space/filter_functions.h"
#include "precompute/shape_space/region_view.h"
#include "precompute/targets/mesh_target.h"
#include "runtime/sim/examples/example_weights.h"
#include "runtime/sim/examples/target.h"

namespace exmat::precompute {

/// The examples of the whole body or of a region, from what a bundle holds.
struct ExamplePoses {
  const ExampleSet* examples = nullptr;  ///< examples of the bundle
  std::optional<RegionView> view;        ///< present for a region
  Eigen::MatrixXd fields;  ///< [f x 3m], displacements that changes of descriptor stand for; of a free body without
                           ///< their rigid part
  std::optional<PoseCoordinates> coordinates{};  ///< that hold all targets; absent: targets are sought in all fields
};

/// Poses by whole_body_poses(). Throws InputError where the model has no examples.
ExamplePoses whole_body_example_poses(const ReducedModel& model, const ElasticSystem& system);

/// Poses by RegionPoses, of each of the regions named. Throws InputError where the model has none of that name.
std::vector<ExamplePoses> region_example_poses(const ReducedModel& model, const ElasticSystem& system,
                                               const std::vector<std::string>& regions);

/// Poses of a region or, where its name is empty, of the whole body, in displacements that hold all targets.
ExamplePoses known_example_poses(const ReducedModel& model, const std::string& region, PoseCoordinates coordinates);

/// Example forces without a modal basis, of which those of docs/step_in_detail.md, "Target", are the Galerkin
/// projection: with the m eigenfunctions Phi of the shape space, T u = Lambda Phi^T (M_s/V) u / V^(1/3), and the filter
/// P = W W^T (FilterFunctions), U^T P U = P_s, and of a region D''^T P D''. f free degrees of freedom, K examples.
/// All elements take part in the energies of the target.
class FullSpaceExamples {
 public:
  /// Keeps no more of `poses` than the view. Elements that an example turns inside out are left out of the energies
  /// of the examples where these start from the examples.
  FullSpaceExamples(const ReducedModel& model, const ElasticSystem& system, const ExamplePoses& poses,
                    EnergyReference reference);

  Eigen::Index count() const { return weights_.examples(); }
  Eigen::Index left_out_elements() const { return left_out_; }

  /// [n_t] shares of the tets in an elastic force; none of the whole body, where all have 1.
  const std::optional<Eigen::VectorXd>& tet_shares() const { return tet_shares_; }

  /// [K] weights of the deformation u [f], before the bias.
  Eigen::VectorXd weights(const Eigen::VectorXd& u) const;

  /// P u [f].
  Eigen::VectorXd filter(const Eigen::VectorXd& u) const;
  /// [n x m] W of P = W W^T (x) I3, of a region times its window, and [n] what it has of a band (RegionView::band()).
  struct Root {
    RowMatrix filter;
    Eigen::VectorXd band;
  };
  Root root() const;
  /// [3m] W^T u of what is seen of u [f], row 3i + axis.
  Eigen::VectorXd root_coefficients(const Eigen::VectorXd& u) const;

  /// [f x d] mass-orthonormal basis of the poses that descriptors stand for, and [d] the examples in it.
  const Eigen::MatrixXd& pose_basis() const { return coordinates_.basis; }
  Eigen::VectorXd pose(Eigen::Index k) const { return coordinates_.poses.col(k); }

  /// Minimises the energies of the examples over the elements, in coordinates y [d]: the displacement is [f x d] fields
  /// y.
  const runtime::TargetSolver& target() const { return target_; }
  const Eigen::MatrixXd& target_fields() const { return target_fields_; }

 private:
  void set_filter(const ReducedModel& model, const ExampleSet& set);
  void set_target(const ReducedModel& model, const ElasticSystem& system, const ExamplePoses& poses,
                  EnergyReference reference);
  Eigen::MatrixXd coefficients(const RowMatrix& functions, const Eigen::VectorXd& u) const;
  Eigen::VectorXd force(const RowMatrix& functions, const Eigen::MatrixXd& coefficients) const;

  std::optional<RegionView> view_;
  std::optional<Eigen::VectorXd> tet_shares_;
  std::vector<std::int32_t> free_dofs_;
  Eigen::Index vertices_ = 0;        // of the mesh
  FilterFunctions filter_;           // of free vertices, of a region all
  runtime::ExampleWeights weights_;  // of Phi^T (M_s/V) u [3m]
  PoseCoordinates coordinates_;
  Eigen::MatrixXd target_fields_;
  runtime::TargetSolver target_;
  Eigen::Index left_out_ = 0;
};

}  // namespace exmat::precompute
