#include "runtime/api/point_set.h"

#include <gtest/gtest.h>
#include <numeric>
#include <random>

#include "common/bundle/bundle.h"
#include "common/config/config.h"
#include "common/core/decompositions.h"
#include "common/mesh/geometry.h"
#include "common/mesh/nearest_point.h"
#include "runtime/api/failures.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::runtime {
namespace {

/// A bundle of a bar and the model loaded from it.
class PointSets : public ::testing::Test {
 protected:
  PointSets() {
    write_bundle(bar_.model, folder_ / "bar.h5");
    source_.bundle = folder_ / "bar.h5";
    source_.loaded = load_run(load_scene(folder_.write("scene.json", R"({"bundle": "bar.h5"})")));
  }
  const TetMesh& mesh() const { return bar_.model.object->mesh; }
  /// [3 x r] of a vertex.
  auto rows_of(Eigen::Index vertex) const { return bar_.model.modal->basis.middleRows<3>(3 * vertex); }

  test::Bar bar_ = test::make_bar();
  test::TemporaryFolder folder_;
  Source source_;
};

TEST_F(PointSets, VerticesHaveTheRowsOfTheBasisInTheOrderAskedFor) {
  // Few are read row by row, many from the whole basis.
  std::vector<std::int64_t> many(static_cast<std::size_t>(mesh().vertex_count()));
  std::iota(many.rbegin(), many.rend(), std::int64_t{0});
  for (const std::vector<std::int64_t>& ids : {std::vector<std::int64_t>{7, 0, 7}, many}) {
    const PointSet points = read_vertices(source_, ids);
    ASSERT_EQ(points.rest.rows(), std::ssize(ids));
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      EXPECT_EQ(points.basis_rows.middleRows<3>(3 * row), rows_of(ids[i]));
      EXPECT_EQ(points.rest.row(row), mesh().vertices.row(ids[i]));
    }
    EXPECT_TRUE(points.distances.isZero(0));
  }
}

TEST_F(PointSets, PointsInATetMoveLinearlyWithIt) {
  VertexArray places(mesh().tet_count(), 3);
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> share(0.1, 1);
  Eigen::MatrixXd shares = Eigen::MatrixXd::NullaryExpr(mesh().tet_count(), 4, [&] { return share(generator); });
  shares.array().colwise() /= shares.rowwise().sum().array().eval();
  for (Eigen::Index t = 0; t < places.rows(); ++t) places.row(t) = shares.row(t) * tet_positions(mesh(), t);
  const PointSet points = read_points_at(source_, places);
  EXPECT_TRUE(points.distances.isZero(0));
  for (Eigen::Index t = 0; t < places.rows(); ++t) {
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(3, bar_.modes());
    for (int corner = 0; corner < 4; ++corner) expected += shares(t, corner) * rows_of(mesh().tets(t, corner));
    // Rounding of coordinates in a tet of good shape.
    EXPECT_LE((points.basis_rows.middleRows<3>(3 * t) - expected).norm(), 1e-12 * expected.norm()) << t;
  }
}

// A field that is linear over the body is continued linearly outside: the nearest tet's coordinates add up to 1.
TEST_F(PointSets, OutsideTheyAreContinuedLinearlyAndTheirDistanceIsTold) {
  const Eigen::RowVector3d high = mesh().vertices.colwise().maxCoeff();
  VertexArray places(2, 3);
  places.row(0) = high + Eigen::RowVector3d(0.3, 0, 0);
  places.row(1) = high + Eigen::RowVector3d(0.3, 0.4, 0);
  const PointSet points = read_points_at(source_, places);
  EXPECT_NEAR(points.distances[0], 0.3, 1e-12);
  EXPECT_NEAR(points.distances[1], 0.5, 1e-12);
  const Eigen::VectorXd positions = mesh().vertices.reshaped<Eigen::RowMajor>();
  const RowMatrix& basis = bar_.model.modal->basis;
  const Eigen::VectorXd q = Eigen::MatrixXd(basis).colPivHouseholderQr().solve(positions);
  const Eigen::VectorXd fitted = basis * q;
  for (Eigen::Index i = 0; i < 2; ++i) {
    const NearestPointSearch search(mesh());
    const NearestPoint hit = search.nearest(places.row(i).transpose());
    const Eigen::Vector4d weights = barycentric(tet_positions(mesh(), hit.tet), places.row(i).transpose());
    Eigen::Vector3d expected = Eigen::Vector3d::Zero();
    for (int corner = 0; corner < 4; ++corner)
      expected += weights[corner] * fitted.segment<3>(3 * mesh().tets(hit.tet, corner));
    EXPECT_LE((points.basis_rows.middleRows<3>(3 * i) * q - expected).norm(), 1e-11 * (1 + expected.norm()));
  }
}

TEST_F(PointSets, AVertexThatIsNotThereIsAnInvalidArgument) {
  for (const std::int64_t id : {std::int64_t{-1}, std::int64_t{mesh().vertex_count()}}) {
    const std::vector<std::int64_t> ids{0, id};
    EXPECT_THROW(read_vertices(source_, ids), InvalidArgument);
  }
}

}  // namespace
}  // namespace exmat::runtime
