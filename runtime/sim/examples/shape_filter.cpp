#include "runtime/sim/examples/shape_filter.h"

namespace exmat::runtime {
namespace {

constexpr double kSymmetric = 1e-12;  // relative skew part that is rounding

}  // namespace

ShapeFilter::ShapeFilter(const ProjectionData& projection)
    : matrix_(projection.reduced_from_shape * projection.shape_from_reduced),
      symmetric_(0.5 * (matrix_ + matrix_.transpose())),
      skew_(0.5 * (matrix_ - matrix_.transpose())),
      is_symmetric_(skew_.norm() <= kSymmetric * matrix_.norm()) {}

}  // namespace exmat::runtime
