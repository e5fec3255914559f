#include "precompute/contact/contact_vertices.h"

#include <gtest/gtest.h>

#include "common/mesh/farthest_points.h"
#include "common/mesh/geometry.h"
#include "tests/support/box_mesh.h"
#include "tests/support/random.h"

namespace exmat::precompute {
namespace {

// 2 x 1 x 1 with a clamp at x = 0: 4 x 10 surface area.
ObjectData box() {
  ObjectData object;
  object.mesh = test::box_mesh({8, 4, 4}, {2, 1, 1});
  object.surface = surface_triangles(object.mesh.tets);
  object.fixed = (object.mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  return object;
}

FlagVector all(const ObjectData& object) { return FlagVector::Ones(object.mesh.vertex_count()); }

bool is_inside(const Eigen::RowVector3d& x) {
  return x[0] > 0.01 && x[0] < 1.99 && x[1] > 0.01 && x[1] < 0.99 && x[2] > 0.01 && x[2] < 0.99;
}

TEST(ContactVertices, ShareTheSurface) {
  const ObjectData object = box();
  const Eigen::VectorXd areas = vertex_areas(object);
  EXPECT_NEAR(areas.sum(), 10, 1e-12);
  for (Eigen::Index v = 0; v < areas.size(); ++v) EXPECT_EQ(areas[v] == 0, is_inside(object.mesh.vertices.row(v))) << v;
}

TEST(ContactVertices, AreThoseOfTheSurfaceThatAreFree) {
  const ObjectData object = box();
  const RowMatrix basis = test::random_matrix(3 * object.mesh.vertex_count(), 4, 1);
  const Eigen::VectorXd areas = vertex_areas(object);
  const ContactData contact = contact_data(object, basis, all(object), std::nullopt);
  EXPECT_EQ(contact.vertices.size(), (areas.array() > 0 && object.fixed.array() == 0).count());
  for (Eigen::Index i = 0; i < contact.vertices.size(); ++i) {
    const Eigen::Index vertex = contact.vertices[i];
    EXPECT_EQ(contact.positions.row(i), object.mesh.vertices.row(vertex));
    EXPECT_EQ(contact.areas[i], areas[vertex]);
    EXPECT_EQ(contact.basis.middleRows(3 * i, 3), basis.middleRows(3 * vertex, 3));
    EXPECT_LT(i > 0 ? contact.vertices[i - 1] : -1, vertex);
  }
}

TEST(ContactVertices, AreThoseThatMayTouch) {
  const ObjectData object = box();
  const RowMatrix basis = RowMatrix::Zero(3 * object.mesh.vertex_count(), 1);
  FlagVector bottom = FlagVector::Zero(object.mesh.vertex_count());
  bottom = (object.mesh.vertices.col(1).array() < 0.3).cast<std::uint8_t>();  // two layers
  const ContactData contact = contact_data(object, basis, bottom, std::nullopt);
  EXPECT_GT(contact.vertices.size(), 40);
  EXPECT_LT(contact.positions.col(1).maxCoeff(), 0.3);
  EXPECT_EQ(contact_data(object, basis, object.fixed, std::nullopt).vertices.size(), 0);
}

TEST(ContactVertices, OfASampleAreSpreadEvenlyAndShareAllTheArea) {
  const ObjectData object = box();
  const RowMatrix basis = RowMatrix::Zero(3 * object.mesh.vertex_count(), 1);
  const ContactData everything = contact_data(object, basis, all(object), std::nullopt);
  const ContactData contact = contact_data(object, basis, all(object), 40);
  ASSERT_EQ(contact.vertices.size(), 40);
  EXPECT_NEAR(contact.areas.sum(), everything.areas.sum(), 1e-12);
  EXPECT_GT(contact.areas.minCoeff(), 0);
  // No vertex is far from the sample, no two of the sample are near: 40 discs cover 10 m^2.
  double covering = 0, packing = 10;
  for (const auto& point : everything.positions.rowwise())
    covering = std::max(covering, (contact.positions.rowwise() - point).rowwise().norm().minCoeff());
  for (Eigen::Index i = 0; i < 40; ++i)
    for (Eigen::Index j = 0; j < i; ++j)
      packing = std::min(packing, (contact.positions.row(i) - contact.positions.row(j)).norm());
  EXPECT_LT(covering, 0.5);
  EXPECT_GE(packing, 0.7 * covering);
  EXPECT_EQ(contact_data(object, basis, all(object), 100000).vertices, everything.vertices);
}

// 20 x 16 x 16 cells: 1794 vertices on the surface, of which 289 are fixed.
TEST(ContactVertices, OfALargeSurfaceAreASampleUnlessAllAreAskedFor) {
  ObjectData object = box();
  object.mesh = test::box_mesh({20, 16, 16}, {2, 1, 1});
  object.surface = surface_triangles(object.mesh.tets);
  object.fixed = (object.mesh.vertices.col(0).array() < 1e-9).cast<std::uint8_t>();
  const RowMatrix basis = RowMatrix::Zero(3 * object.mesh.vertex_count(), 1);
  const ContactData sample = contact_data(object, basis, all(object), std::nullopt);
  const ContactData everything = contact_data(object, basis, all(object), 1505);
  EXPECT_EQ(sample.vertices.size(), 1000);
  EXPECT_EQ(everything.vertices.size(), 1505);
  EXPECT_NEAR(sample.areas.sum(), everything.areas.sum(), 1e-12);
  EXPECT_EQ(contact_summary(object, all(object), sample),
            "contact: a sample of 1000 of 1505 surface vertices; \"contact\": { \"count\": 1505 } takes all");
  EXPECT_EQ(contact_summary(object, all(object), everything), "contact: all 1505 surface vertices");
}

TEST(FarthestPoints, StartAtTheEndsOfALine) {
  VertexArray points = VertexArray::Zero(9, 3);
  points.col(0) = Eigen::VectorXd::LinSpaced(9, 0, 8);
  const std::vector<Eigen::Index> chosen = farthest_points(points, 3);
  EXPECT_EQ(chosen, (std::vector<Eigen::Index>{0, 8, 4}));
}

}  // namespace
}  // namespace exmat::precompute
