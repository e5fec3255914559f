// A pose of the shape space that turns some tets inside out, from the asset to the motion.

#include <gtest/gtest.h>

#include "common/bundle/bundle.h"
#include "tests/integration/support.h"

namespace exmat::test {
namespace {

// Share of the tets that an example's displacement turns inside out, and whether it does so to an element of the
// internal force.
struct Inverted {
  double share = 0;
  bool element = false;
};

Inverted inverted(const ReducedModel& model) {
  const TetMesh& mesh = model.object->mesh;
  const Eigen::VectorXd moved =
      mesh.vertices.reshaped<Eigen::RowMajor>() + model.modal->basis * model.examples->examples[1].pose;
  const auto volume = [&](Eigen::Index t) {
    Eigen::Matrix3d edges;
    for (int i = 0; i < 3; ++i)
      edges.col(i) = moved.segment<3>(3 * mesh.tets(t, i + 1)) - moved.segment<3>(3 * mesh.tets(t, 0));
    return edges.determinant();
  };
  Inverted found;
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) found.share += volume(t) <= 0;
  found.share /= static_cast<double>(mesh.tet_count());
  if (model.cubature)
    for (const std::int32_t t : model.cubature->elements) found.element = found.element || volume(t) <= 0;
  return found;
}

// An element of the internal force is among these tets, in both bundles: neither target nor force minds.
TEST(InvertedPose, GivesABundleThatRuns) {
  const TemporaryFolder folder;
  for (const char* force : {"cubature", "polynomial"}) {
    const auto asset = write_bar(folder, {.cells = {8, 3, 3}, .example_cells = {8, 3, 3}, .twist = 4.5},
                                 {{"internal_force", force},
                                  {"object", {{"formulation", "linear"}}},  // an element is a tet
                                  {"shape_space", {{"eigenfunctions", 10}}},
                                  {"basis", {{"size", 16}, {"linear_modes", 10}}},
                                  {"cubature", {{"elements", 40}}}});
    const Outcome made = exmat_precompute({"bundle", asset, "-o", folder.path("bundle.h5")});
    ASSERT_EQ(made.status, 0) << force << ": " << made.errors;
    const Inverted found = inverted(read_bundle(folder.path("bundle.h5")));
    EXPECT_GT(found.share, 0.05) << force;
    EXPECT_TRUE(found.element) << force;
    for (const char* target : {"table", "solve"}) {
      const auto scene = write_scene(
          folder, {{"steps", 20}, {"internal_force", force}, {"examples", {{"stiffness", 2}, {"target", target}}}});
      const Outcome ran = exmat_runtime({"run", scene});
      EXPECT_EQ(ran.status, 0) << force << ", " << target << ": " << ran.errors;
    }
  }
}

}  // namespace
}  // namespace exmat::test
