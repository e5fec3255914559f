#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "exmat/exmat.h"
#include "runtime/scene/scene_loader.h"
#include "runtime/sim/step/vertex_positions.h"

namespace exmat::runtime {

/// A loaded scene and the bundle that more can be read of.
struct Source {
  BundleInput bundle;
  LoadedScene loaded;
};

/// The object of a source at rest and, where asked for, its modal basis. Throws InputError, also where the bundle is no
/// longer the one that was loaded.
ReducedModel read_rest(const Source& source, bool basis);

/// k material points of a body.
struct PointSet {
  VertexPositions positions;
  RowMatrix basis_rows;       ///< 3k x r; 0 x r: for drawing alone
  VertexArray rest;           ///< k x 3, at rest, world [m]
  IndexMatrix corners;        ///< k x 1 or 4, vertices of the object that it goes with
  RowMatrix shares;           ///< likewise; each row adds up to 1
  Eigen::VectorXd distances;  ///< k, to the object at rest [m]
};

// They read of the bundle what the points need. Throw InputError, also where the bundle is no longer the one that was
// loaded, and InvalidArgument: a vertex that is not there.
PointSet read_vertices(const Source& source, std::span<const std::int64_t> ids);
PointSet read_all_vertices(const Source& source);
PointSet read_points_at(const Source& source, const VertexArray& points);
/// The cubature elements: the centroids of tets, the vertices of rings.
PointSet read_elements(const Source& source);

/// Refuses the points of read_all_vertices(), which have no rows of the basis in double precision.
exmat_status require_rows(const char* function, const PointSet& points) noexcept;

/// All of these groups of a source's bundle. Throws as read_rest().
ReducedModel read_groups(const Source& source, const std::vector<std::string>& groups);

/// Throws InputError where `data` is not of the bundle that was loaded.
void require_same_bundle(const Source& source, const ReducedModel& data);

/// Points at shares of vertices of the object: `corners` [k x 4] with `shares` [k x 4], at `rest` [k x 3] at rest.
PointSet embedded_points(const RowMatrix& basis, const VertexArray& rest, const Eigen::Ref<const IndexMatrix>& corners,
                         const Eigen::Ref<const RowMatrix>& shares);

}  // namespace exmat::runtime
