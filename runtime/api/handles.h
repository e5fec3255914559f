#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/mesh/assembly.h"
#include "exmat/exmat.h"
#include "runtime/api/applied_forces.h"
#include "runtime/api/contact_record.h"
#include "runtime/api/deformed_box.h"
#include "runtime/api/drawn_surface.h"
#include "runtime/api/point_set.h"
#include "runtime/capacity/load_capacity.h"
#include "runtime/sim/step/reach.h"
#include "runtime/sim/step/stepper.h"

namespace exmat::runtime {

/// Report of no steps, with nothing measured.
inline exmat_report empty_report() noexcept {
  exmat_report report{};
  report.lost_applied = report.lost_contact = -1;
  return report;
}

}  // namespace exmat::runtime

// Structs behind the handles of the C API. NOLINTBEGIN(readability-identifier-naming): their names are the API's.

struct exmat_model {
  std::shared_ptr<const exmat::runtime::Source> source;

  const exmat::runtime::Model& model() const { return *source->loaded.model; }
};

struct exmat_points {
  std::shared_ptr<const exmat::runtime::Source> source;
  exmat::runtime::PointSet set;
};

/// One of the two.
struct exmat_shape {
  std::shared_ptr<const exmat::runtime::RigidMesh> mesh{};
  std::shared_ptr<const exmat::runtime::HeightField> field{};
};

struct exmat_surface {
  exmat_points points;
  exmat::runtime::ModelSurface drawn;
  exmat::runtime::DeformedBox box;  ///< of its points
};

struct exmat_matrix {
  exmat::SparseMatrix entries;
};

struct exmat_capacity {
  std::shared_ptr<const exmat::runtime::Source> source;
  std::shared_ptr<const exmat::runtime::LoadCapacity> capacity;
};

struct exmat_body {
  exmat_body(std::shared_ptr<const exmat::runtime::Source> its_source, exmat::runtime::State its_start);
  ~exmat_body();
  exmat_body(const exmat_body&) = delete;
  exmat_body& operator=(const exmat_body&) = delete;

  const exmat::runtime::Model& model() const { return *source->loaded.model; }
  Eigen::Index modes() const { return state.q.size(); }
  const exmat::runtime::FullModel* full() const { return source->loaded.full.get(); }

  std::shared_ptr<const exmat::runtime::Source> source;
  exmat::runtime::StepScene scene;         ///< the model's, and what was set for this body
  std::vector<std::int64_t> obstacle_ids;  ///< in its world, of scene.obstacles
  exmat::runtime::State start, state;
  exmat::runtime::VertexPositions::Workspace drawing;
  Eigen::VectorXd force;      ///< r
  std::size_t frame_numbers;  ///< count of numbers in the frame's state
  exmat_report report = exmat::runtime::empty_report();
  exmat::runtime::ContactRecord contacts;  ///< contacts of the last call that stepped it
  std::atomic_flag in_use = ATOMIC_FLAG_INIT;
  exmat_world* world = nullptr;                                  ///< that it is in, always one
  std::int64_t id = 0;                                           ///< in that
  std::int64_t next_attachment = 0;                              ///< its id
  std::vector<exmat::runtime::AppliedForces> forces;             ///< empty, or those without an id, then each with one
  std::int64_t next_forces = 0;                                  ///< id of the next
  std::unique_ptr<exmat::runtime::Reach> reach;                  ///< present while it reaches for something
  bool reaches_by_scene = false;                                 ///< for that of its scene
  std::unique_ptr<exmat_world> own;                              ///< the world, where it is the body's own
  std::shared_ptr<const exmat::runtime::LoadCapacity> capacity;  ///< present where reports hold lost work
  Eigen::VectorXd load;                                          ///< 3n applied forces, there alone; the body's frame

  /// Which of the model's example forces is that of a region, of the whole body where it is -1. Throws InvalidArgument.
  std::size_t example_force(std::int64_t region) const;
};

// NOLINTEND(readability-identifier-naming)
