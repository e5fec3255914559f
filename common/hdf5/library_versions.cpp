#include "common/hdf5/library_versions.h"

#include <Eigen/Core>
#include <fmt/format.h>
#include <hdf5.h>

namespace exmat {

std::string library_versions() {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  return fmt::format("HDF5 {}.{}.{}, Eigen {}.{}.{}", major, minor, release, EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
                     EIGEN_MINOR_VERSION);
}

}  // namespace exmat
