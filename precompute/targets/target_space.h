#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "common/model/reduced_model.h"
#include "precompute/fem/elastic_system.h"
#include "precompute/targets/mesh_target.h"

namespace exmat::precompute {

struct TargetSpaceOptions {
  EnergyReference energy_reference = EnergyReference::kExample;
  double tolerance = 1e-4;          ///< loss of the targets by the space and the table, as TargetTableData has it
  double element_tolerance = 1e-3;  ///< loss by the elements, beside that
  bool table = true;                ///< make one, where K >= 2
  std::uint64_t seed = 1;           ///< seed of the poses that the elements are chosen by
  /// That energies are summed over at every step. Targets of more begin with a sample of their elements, and a table of
  /// them with the elements.
  Eigen::Index most_elements = 20'000;
  Eigen::Index sample = 8192;
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, TargetSpaceOptions& value) {
  pass_all(archive, value.energy_reference, value.tolerance, value.element_tolerance, value.table, value.seed,
           value.most_elements, value.sample);
}

/// The targets of a set of examples, minimised over all elements of the mesh in all poses that descriptors stand for:
/// independent of any modal basis. docs/method.md, "Table of targets".
struct TargetSpace {
  PoseCoordinates coordinates;           ///< few displacements that hold all targets, and the examples in them
  CubatureData elements;                 ///< that stand for all in the energies of targets, in these coordinates
  double error = 0;                      ///< largest found of what the coordinates lose of a target
  std::int64_t left_out = 0;             ///< elements that an example turns inside out
  std::optional<TargetTableData> table;  ///< control points [P c x d]
  EnergyReference energy_reference = EnergyReference::kExample;
  std::string table_message;  ///< result in words, or why there is none
};

/// Members that the stage cache keeps.
template <typename Archive>
void pass_members(Archive& archive, TargetSpace& value) {
  pass_all(archive, value.coordinates, value.elements, value.error, value.left_out, value.table, value.energy_reference,
           value.table_message);
}

/// `range` holds all poses, from pose_range(). Targets are solved there at weights all over the simplex; their
/// principal components, the examples themselves among them, are the space, as many as the tolerance asks for at
/// further weights. The same in every run and for every number of threads.
TargetSpace build_target_space(const ObjectData& object, const ElasticSystem& system, const PoseCoordinates& range,
                               const TargetSpaceOptions& options);

/// Puts the targets into a model of the basis U: `pull` [r x d] is U^T P B, what each displacement of the space pulls
/// the modes with, P the filter of the example force. The table only where there is one.
void finish_targets(const TargetSpace& space, const Eigen::MatrixXd& pull, std::optional<TargetSpaceData>& data,
                    std::optional<TargetTableData>& table);

}  // namespace exmat::precompute
