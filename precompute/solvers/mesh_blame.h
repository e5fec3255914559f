#pragma once

#include <string>

#include "precompute/fem/flat_tets.h"
#include "precompute/solvers/semidefinite_solver.h"

namespace exmat::precompute {

/// Does `work` on matrices of the mesh. What their conditioning makes fail becomes an InputError that names the
/// flattest tet, where it is flat, else a WorkError. `name` is that of the mesh, for the message.
template <typename Work>
auto with_mesh_blamed(const TetMesh& mesh, const std::string& name, Work work) {
  try {
    return work();
  } catch (const IllConditioned& error) {
    const FlatTet flattest = flattest_tet(mesh);
    if (flattest.height < kFlat)
      throw InputError({"", "mesh of " + name, "tets that are not flat",
                        to_string(mesh, flattest) + "; " + error.what(), "remesh the object there"});
    throw;
  }
}

}  // namespace exmat::precompute
