#include "precompute/mesh_io/msh_writer.h"

#include <gtest/gtest.h>

#include "precompute/mesh_io/mesh_file.h"
#include "tests/precompute/mesh_io/mesh_samples.h"

namespace exmat::precompute {
namespace {

using test::TemporaryFolder;

TEST(WriteMsh, IsReadBackToTheLastBit) {
  const TemporaryFolder folder;
  const TetMesh mesh = test::sample_mesh(3).mesh;
  write_msh(mesh, folder / "a.msh");
  EXPECT_TRUE(test::same_mesh(read_mesh(folder / "a.msh").mesh, mesh));
  EXPECT_EQ(folder.size(), 1);
}

TEST(WriteMsh, IsGmshsFormat) {
  const TemporaryFolder folder;
  const TetMesh mesh{(VertexArray(4, 3) << 0, 0, 0, 0.1, 0, 0, 0, 1, 0, 0, 0, -1e-300).finished(),
                     (TetArray(1, 4) << 0, 2, 1, 3).finished()};
  write_msh(mesh, folder / "a.msh");
  EXPECT_EQ(exmat::test::read_file(folder / "a.msh"), R"($MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
4
1 0 0 0
2 0.10000000000000001 0 0
3 0 1 0
4 0 0 -1e-300
$EndNodes
$Elements
1
1 4 2 0 1 1 3 2 4
$EndElements
)");
}

TEST(WriteMsh, LeavesNothingWhereItCannotWrite) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_msh(test::sample_mesh(1).mesh, folder / "none/a.msh"), WorkError);
  EXPECT_EQ(folder.size(), 0);
}

}  // namespace
}  // namespace exmat::precompute
