#pragma once

#include <compare>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "common/model/reduced_model.h"
#include "precompute/study/stability/body_scale.h"
#include "runtime/sim/space/full/full_model.h"

namespace exmat::precompute {

/// Examples of a body of the stability suite.
enum class BodyExamples {
  kNone,
  kBendAndTwist,    ///< rest, a bend of 69 degrees, a twist of 57 degrees
  kNearDuplicates,  ///< rest, a twist and the same one turned by 1e-7 rad more
  kDuplicates,      ///< rest and one twist twice
  kRestAlone,       ///< one example: the rest pose
};

/// A bar of 1 x 0.25 x 0.2 m along x, clamped at x = 0, carried there or free, in 160 tets: five to a cell.
struct BodySpec {
  MaterialModel material = MaterialModel::kStVenantKirchhoff;
  double youngs_modulus = 1e6;  ///< [Pa]
  double poisson_ratio = 0.4;
  double density = 1000;  ///< [kg/m^3]
  bool free = false;
  bool slivers = false;  ///< its middle layer of cells is flattened until dihedral angles are one degree
  BodyExamples examples = BodyExamples::kNone;
  bool target_table = false;  ///< targets from a table, else solved for
  bool polynomial = false;    ///< internal force by the exact polynomial, of stvk alone
  bool carried = false;       ///< clamped, and a motion may carry it
  bool region = false;        ///< the examples are those of its outer half alone
  bool elastic = false;       ///< data for an elastic example force
  EnergyReference energy_reference = EnergyReference::kExample;

  auto operator<=>(const BodySpec&) const = default;
};

/// A body as the offline stage makes it, ready to step. r = 12 modes, s = 24 elements.
struct StudyBody : BodyScale {
  ReducedModel reduced;
  std::unique_ptr<const runtime::Model> model;
  std::unique_ptr<const runtime::FullModel> full;  ///< null where it has none
  double least_dihedral = 0;                       ///< least of all tets [rad]
  double lowest_frequency = 0;                     ///< [rad/s]
  double mass_reach = 0;                           ///< largest |U_v q| over |q| [kg^-1/2]
  double highest_frequency = 0;                    ///< highest by rest_stiffness [rad/s]

  const RowMatrix& basis() const { return reduced.modal->basis; }
};

/// The bar's mesh.
TetMesh stability_mesh(bool slivers);

/// Smallest angle between two faces of a tet [rad].
double least_dihedral(const TetMesh& mesh);

/// Bodies by their specification, each built once, from files through the whole offline stage. Not thread-safe: the
/// offline stage is not.
class BodyStore {
 public:
  BodyStore();
  ~BodyStore();
  BodyStore(const BodyStore&) = delete;
  BodyStore& operator=(const BodyStore&) = delete;

  /// Builds what is missing. Throws as build_reduced_model.
  const StudyBody& get(const BodySpec& spec);

  /// A body that has been built.
  const StudyBody& at(const BodySpec& spec) const { return *bodies_.at(spec); }

 private:
  std::filesystem::path folder_;  // of mesh files, removed in the end
  std::map<BodySpec, std::unique_ptr<StudyBody>> bodies_;
};

}  // namespace exmat::precompute
