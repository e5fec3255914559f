#include "precompute/targets/element_parts.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <random>

#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

Elements elements(const TetMesh& mesh, Formulation formulation) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.tet_count());
  return elements_of(mesh, {ones, ones, 0.3 * ones, MaterialModel::kStVenantKirchhoff, formulation, 0.2});
}

std::vector<Eigen::Index> every_third(Eigen::Index count) {
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index e = 1; e < count; e += 3) chosen.push_back(e);
  return chosen;
}

class ElementPartsOf : public testing::TestWithParam<Formulation> {};

TEST_P(ElementPartsOf, HoldEachElementOnceWithItsVertices) {
  const TetMesh mesh = test::box_mesh({7, 5, 4}, {1, 1, 1});
  const Elements all = elements(mesh, GetParam());
  const std::vector<Eigen::Index> chosen = every_third(all.count());
  std::vector<Eigen::Index> found;
  for (const ElementPart& part : element_parts(mesh.vertices, all, chosen, 20)) {
    EXPECT_LE(part.elements.size(), 20U);
    EXPECT_TRUE(std::ranges::is_sorted(part.elements));
    EXPECT_TRUE(std::ranges::is_sorted(part.vertices));
    EXPECT_EQ(std::ranges::adjacent_find(part.vertices), part.vertices.end());
    ASSERT_EQ(part.places.size(), part.elements.size());
    for (std::size_t i = 0; i < part.elements.size(); ++i) {
      const auto vertices = all.vertices_of(part.elements[i]);
      ASSERT_EQ(part.places[i].size(), vertices.size());
      for (std::size_t j = 0; j < vertices.size(); ++j)
        EXPECT_EQ(part.vertices.at(static_cast<std::size_t>(part.places[i][j])), vertices[j]);
    }
    found.insert(found.end(), part.elements.begin(), part.elements.end());
  }
  std::ranges::sort(found);
  EXPECT_EQ(found, chosen);
}

INSTANTIATE_TEST_SUITE_P(All, ElementPartsOf, testing::Values(Formulation::kLinear, Formulation::kSmoothed));

// In whatever order a mesh has its tets: a cube of 8^3 cells has 1.4 vertices a cell, tets at random some hundreds.
TEST(ElementParts, ShareVerticesWhateverTheOrderOfTheTets) {
  TetMesh mesh = test::cube_grid(16);
  std::vector<Eigen::Index> order, all;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) order.push_back(t);
  all = order;
  std::ranges::shuffle(order, std::mt19937(1));
  mesh.tets = TetArray(mesh.tets(order, Eigen::all));
  for (const ElementPart& part : element_parts(mesh.vertices, elements(mesh, Formulation::kLinear), all, 6 * 512))
    EXPECT_LE(static_cast<double>(part.vertices.size()), 1.7 * static_cast<double>(part.elements.size()) / 6);
}

TEST(ElementParts, OfNothingAreNone) {
  const TetMesh mesh = test::cube_grid(1);
  EXPECT_TRUE(element_parts(mesh.vertices, elements(mesh, Formulation::kLinear), {}, 4).empty());
}

}  // namespace
}  // namespace exmat::precompute
