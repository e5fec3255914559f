#include "precompute/inputs/object_materials.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/precompute/mesh_io/mesh_samples.h"
#include "tests/support/box_mesh.h"

namespace exmat::precompute {
namespace {

using exmat::precompute::test::complaint_of;
using testing::HasSubstr;

class ObjectMaterials : public testing::Test {
 protected:
  ObjectMaterials() {
    asset_.file = "a.json";
    asset_.object_mesh = "bar.veg";
    asset_.material = {MaterialModel::kStVenantKirchhoff, 1e5, 0.3, 1000};
    for (std::int32_t t = 0; t < mesh_.tet_count(); ++t) kept_.push_back(t);
  }
  TetMaterials materials(const std::optional<TetMaterials>& in_file = std::nullopt) {
    return object_materials(asset_, mesh_, sets_, in_file, kept_, files_);
  }
  Complaint complaint() {
    return complaint_of([this] { materials(); });
  }

  TetMesh mesh_ = exmat::test::box_mesh({2, 1, 1}, {2, 1, 1});  // tets 0 to 5, then 6 to 11 beyond x = 1
  TetSets sets_{{"left", {0, 1, 2}}, {"right", {9, 10}}};
  AssetConfig asset_;
  std::vector<std::int32_t> kept_;
  InputFiles files_;
};

TEST_F(ObjectMaterials, LaterPartsWinAndTheRestIsTheBase) {
  asset_.material.model = MaterialModel::kCorotational;
  asset_.material_regions = {{BoxSelection{{1, 0, 0}, {2, 1, 1}}, 2e5, std::nullopt, 500},
                             {IdSelection{{0, 11}}, 3e5, 0.4, std::nullopt}};
  const TetMaterials found = materials();
  EXPECT_EQ(found.model, MaterialModel::kCorotational);
  for (Eigen::Index t = 0; t < 12; ++t) {
    const bool second = t == 0 || t == 11;
    EXPECT_EQ(found.youngs_modulus[t], second ? 3e5 : t < 6 ? 1e5 : 2e5) << t;
    EXPECT_EQ(found.poisson_ratio[t], second ? 0.4 : 0.3) << t;
    EXPECT_EQ(found.density[t], t < 6 ? 1000 : 500) << t;
  }
}

TEST_F(ObjectMaterials, NumbersOfTheMeshFileServeWhereTheAssetHasNone) {
  asset_.material = {MaterialModel::kStableNeoHookean, std::nullopt, 0.3, std::nullopt};
  asset_.material_regions = {{IdSelection{{3}}, 9.0, std::nullopt, std::nullopt}};
  const TetMaterials in_file{Eigen::VectorXd::LinSpaced(12, 1, 12), Eigen::VectorXd::LinSpaced(12, 10, 21),
                             Eigen::VectorXd::Constant(12, 0.1)};
  const TetMaterials found = materials(in_file);
  EXPECT_EQ(found.density, in_file.density);
  EXPECT_EQ(found.poisson_ratio, Eigen::VectorXd::Constant(12, 0.3));
  for (Eigen::Index t = 0; t < 12; ++t) EXPECT_EQ(found.youngs_modulus[t], t == 3 ? 9 : in_file.youngs_modulus[t]);
}

// Ids are the file's, also where tets were dropped.
TEST_F(ObjectMaterials, DroppedTetsKeepTheIdsOfTheOthers) {
  kept_ = {2, 7, 11};
  asset_.material_regions = {{IdSelection{{7}}, 2e5, std::nullopt, std::nullopt}};
  EXPECT_EQ(materials().youngs_modulus, Eigen::Vector3d(1e5, 2e5, 1e5));
}

TEST_F(ObjectMaterials, SetsOfTheMeshFileAreParts) {
  asset_.material_regions = {{SetSelection{"left"}, 2e5, std::nullopt, 500},
                             {SetSelection{"right"}, std::nullopt, 0.1, std::nullopt}};
  const TetMaterials found = materials();
  for (Eigen::Index t = 0; t < 12; ++t) {
    EXPECT_EQ(found.youngs_modulus[t], t < 3 ? 2e5 : 1e5) << t;
    EXPECT_EQ(found.density[t], t < 3 ? 500 : 1000) << t;
    EXPECT_EQ(found.poisson_ratio[t], t == 9 || t == 10 ? 0.1 : 0.3) << t;
  }
  kept_ = {1, 9};
  EXPECT_EQ(materials().youngs_modulus, Eigen::Vector2d(2e5, 1e5))
      << "the file's numbers, also where tets were dropped";
}

// From the files of each format, as the pipeline reads them.
TEST_F(ObjectMaterials, SetsOfEveryFormatReachTheMaterials) {
  const exmat::test::TemporaryFolder folder;
  const MeshFile sample = test::sample_mesh(2);
  const auto& soft = sample.tet_sets.at("soft part");
  const auto expect_soft = [&](const std::filesystem::path& file, const std::string& set) {
    asset_.object_mesh = file;
    asset_.material_regions = {{SetSelection{set}, 2e4, std::nullopt, std::nullopt}};
    const Eigen::VectorXd found = read_object(asset_, files_).materials.youngs_modulus;
    Eigen::VectorXd expected = Eigen::VectorXd::Constant(sample.mesh.tet_count(), 1e5);
    expected(soft).setConstant(2e4);
    EXPECT_EQ(found, expected) << file;
  };
  for (const test::Flavour& flavour : test::flavours())
    for (const auto& [name, tets] : flavour.sets(sample))
      if (tets == soft) expect_soft(folder.write(flavour.name + flavour.extension, flavour.write(sample)), name);
  std::string nodes = fmt::format("{} 3 0 0\n", sample.mesh.vertex_count());
  std::string elements = fmt::format("{} 4 1\n", sample.mesh.tet_count());
  for (Eigen::Index v = 0; v < sample.mesh.vertex_count(); ++v)
    nodes += fmt::format("{} {} {} {}\n", v, sample.mesh.vertices(v, 0), sample.mesh.vertices(v, 1),
                         sample.mesh.vertices(v, 2));
  for (Eigen::Index t = 0; t < sample.mesh.tet_count(); ++t)
    elements += fmt::format("{} {} {}\n", t, fmt::join(sample.mesh.tets.row(t), " "), t < std::ssize(soft) ? 5 : 6);
  folder.write("body.node", nodes);
  expect_soft(folder.write("body.ele", elements), "5");
}

TEST_F(ObjectMaterials, ASetThatTheMeshFileDoesNotHaveIsNamedWithThoseThatItHas) {
  asset_.material_regions = {{SetSelection{"rigth"}, 2e5, std::nullopt, std::nullopt}};
  EXPECT_EQ(complaint().found, "\"rigth\"");
  EXPECT_EQ(complaint().advice, "the file has \"left\", \"right\"");
  sets_.clear();
  EXPECT_EQ(complaint().advice, "the file has none");
}

TEST_F(ObjectMaterials, FilesOfTetsAreInputs) {
  const exmat::test::TemporaryFolder folder;
  const auto file = folder.write("stiff.txt", "1 2");
  asset_.material_regions = {{FileSelection{file}, 2e5, std::nullopt, std::nullopt}};
  EXPECT_EQ(materials().youngs_modulus[1], 2e5);
  EXPECT_THAT(files_, testing::ElementsAre(file));
}

TEST_F(ObjectMaterials, ANumberThatIsNowhereIsNamed) {
  asset_.material.density.reset();
  EXPECT_EQ(complaint().place, "/object/material/density");
}

TEST_F(ObjectMaterials, APoissonRatioBeyondTheModelIsNamedWithItsTet) {
  asset_.material_regions = {{IdSelection{{4}}, std::nullopt, -0.85, std::nullopt}};
  for (const auto model : {MaterialModel::kStVenantKirchhoff, MaterialModel::kCorotational}) {
    asset_.material.model = model;
    EXPECT_NO_THROW(materials());
  }
  asset_.material.model = MaterialModel::kStableNeoHookean;
  EXPECT_EQ(complaint().expected, "Poisson ratios above -0.8 and at most 0.49999 for stable_neo_hookean");
  EXPECT_EQ(complaint().found, "-0.85 in tet 4");
}

TEST_F(ObjectMaterials, APoissonRatioWithoutDigitsIsNamedWithItsTet) {
  for (const double ratio : {-0.9999999999999999, 0.49999999999, 0.4999999999999999}) {
    asset_.material_regions = {{IdSelection{{4}}, std::nullopt, ratio, std::nullopt}};
    EXPECT_EQ(complaint().place, "/object/material/poisson_ratio");
    EXPECT_EQ(complaint().expected, "Poisson ratios of at least -0.999 and at most 0.49999 for stvk");
  }
}

}  // namespace
}  // namespace exmat::precompute
