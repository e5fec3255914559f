// Examples on any mesh, from files to descriptors.

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/config/config.h"
#include "common/core/error.h"
#include "precompute/alignment/kd_tree.h"
#include "precompute/examples/example_stage.h"
#include "tests/integration/support.h"
#include "tests/support/posed_bodies.h"

namespace exmat::test {
namespace {

using precompute::AlignmentVerdict;
using precompute::ShapeStage;
using testing::HasSubstr;

const std::array<int, 3> kPoseCells{12, 4, 4};

class ExampleTopology : public testing::Test {
 protected:
  // The asset with this member `alignment`, its examples brought to the object, and nothing more.
  ShapeStage align(const Json& alignment = Json::object()) {
    const auto file = write_bar(folder_, bar_, {{"alignment", alignment}});
    for (const auto& [name, mesh] : meshes_) write_msh(folder_.path(name), mesh);
    const AssetConfig asset = load_asset(file);
    precompute::InputFiles files;
    std::vector<std::string> warnings;
    const auto object = precompute::read_object(asset, files);
    const auto examples = precompute::read_examples(asset, object, files);
    precompute::StageCache no_cache;
    return precompute::build_shape_stage(asset, object, examples, no_cache, warnings);
  }

  // The pose on a mesh of these cells, neither the object's nor, by default, the rest example's.
  void pose_on(const std::array<int, 3>& cells = kPoseCells) {
    TetMesh mesh = box_mesh(cells, bar_.lengths);
    mesh.vertices = twisted(mesh.vertices, bar_);
    meshes_["twist.msh"] = mesh;
  }

  // As the file of an example that stands elsewhere, in other units.
  static TetMesh moved(TetMesh mesh, double scale, const Eigen::Matrix3d& rotation) {
    mesh.vertices = scale * mesh.vertices * rotation.transpose();
    mesh.vertices.rowwise() += scale * Eigen::RowVector3d(5, -2, 7);
    return mesh;
  }

  void write_corner_landmarks(const std::array<int, 3>& pose_cells) {
    const auto object = box_corners(bar_.cells), rest = box_corners(bar_.example_cells), pose = box_corners(pose_cells);
    std::string text = "# object rest twist\n";
    for (std::size_t k = 0; k < object.size(); ++k)
      text +=
          std::to_string(object[k] + 1) + " " + std::to_string(rest[k] + 1) + " " + std::to_string(pose[k] + 1) + "\n";
    folder_.write("marks.txt", text);
  }

  // Difference of the twist's descriptors, relative to what the pose changes.
  static double difference(const ShapeStage& a, const ShapeStage& b) {
    const Eigen::MatrixXd &of_a = a.groups.front().examples.examples[1].descriptor,
                          &of_b = b.groups.front().examples.examples[1].descriptor;
    return (of_a - of_b).norm() / (of_b - Eigen::MatrixXd(b.data.rest_descriptor)).norm();
  }

  TemporaryFolder folder_;
  BarFiles bar_;
  std::map<std::string, TetMesh> meshes_;  // written in place of those of write_bar
  const Eigen::Matrix3d turn_ = Eigen::AngleAxisd(2.1, Eigen::Vector3d(2, -1, 3).normalized()).toRotationMatrix();
};

// Eight regions, an eighth of the body each: the least that tells its ends, sides and edges apart.
TEST_F(ExampleTopology, RegionsCoupleBases) {
  const ShapeStage own = align();
  pose_on();
  const VertexArray at_rest = box_mesh(kPoseCells, bar_.lengths).vertices;
  Json regions = Json::array();
  for (int k = 0; k < 8; ++k) {
    Json low = Json::array(), high = Json::array(), ids = Json::array();
    for (int axis = 0; axis < 3; ++axis) {
      const double half = bar_.lengths[static_cast<std::size_t>(axis)] / 2, from = (k >> axis & 1) * half;
      low.push_back(from - 1e-9);
      high.push_back(from + half + 1e-9);
    }
    for (Eigen::Index v = 0; v < at_rest.rows(); ++v) {
      bool inside = true;
      for (int axis = 0; axis < 3; ++axis)
        inside = inside && at_rest(v, axis) >= low[static_cast<std::size_t>(axis)].get<double>() &&
                 at_rest(v, axis) <= high[static_cast<std::size_t>(axis)].get<double>();
      if (inside) ids.push_back(v);
    }
    const Json box{{"box", {{"min", low}, {"max", high}}}};
    regions.push_back(
        {{"object", box},
         {"examples",
          {{{"example", "rest"}, {"vertices", box}}, {{"example", "twist"}, {"vertices", {{"ids", ids}}}}}}});
  }
  const ShapeStage coupled = align({{"method", "coupled"}, {"regions", regions}});
  EXPECT_EQ(coupled.groups.front().examples.examples[1].method, "coupled");
  // The pose that came over against the pose itself, as the rest example's own mesh brings it.
  const Eigen::MatrixXd change =
      coupled.weights.cwiseInverse().asDiagonal() *
      (coupled.groups.front().examples.examples[1].descriptor - coupled.data.rest_descriptor);
  const VertexArray pose = own.groups.front().fields.col(0).reshaped<Eigen::RowMajor>(own.object.vertices.rows(), 3) /
                           std::cbrt(own.object.volume);
  const auto norm = [&](const VertexArray& field) {
    return std::sqrt((field.transpose() * (own.object.mass * field)).trace());
  };
  const double lost = norm(coupled.object.eigenfunctions * change - pose) / norm(pose);
  EXPECT_LE(lost, 0.5);  // measured 0.42; wrong maps of the benchmark have 0.8 and more
  EXPECT_NEAR(coupled.groups.front().examples.examples[1].shape_space_error, lost, 0.05);  // known without the truth
  EXPECT_EQ(coupled.alignments[1].verdict, AlignmentVerdict::kDoubtful);
}

TEST_F(ExampleTopology, MapsMayHaveGapsForPosesButNotForTheRestExample) {
  const ShapeStage own = align();
  pose_on();
  const auto nearest_lines = [&](const std::array<int, 3>& cells) {
    const precompute::KdTree tree(RowMatrix(box_mesh(cells, bar_.lengths).vertices));
    const IndexVector nearest = tree.nearest(box_mesh(bar_.cells, bar_.lengths).vertices);
    std::string text;
    for (Eigen::Index v = 0; v < nearest.size(); ++v)
      text += v % 3 == 1 ? "-\n" : std::to_string(nearest[v] + 1) + "\n";
    return text;
  };
  folder_.write("twist_map.txt", nearest_lines(kPoseCells));
  folder_.write("rest_map.txt", nearest_lines(bar_.example_cells));
  const Json twist{{"example", "twist"}, {"file", "twist_map.txt"}},
      rest{{"example", "rest"}, {"file", "rest_map.txt"}};
  const ShapeStage mapped = align({{"method", "map"}, {"map", {twist}}});
  EXPECT_EQ(mapped.groups.front().examples.examples[1].method, "map");
  EXPECT_EQ(mapped.alignments[1].verdict, AlignmentVerdict::kGood);
  EXPECT_LE(difference(mapped, own), 0.08);
  try {
    align({{"method", "map"}, {"map", {twist, rest}}});
    ADD_FAILURE() << "no InputError";
  } catch (const InputError& error) {
    EXPECT_EQ(error.complaint().place, "/alignment/map");
    EXPECT_EQ(error.complaint().found, "'-' for vertex 2");
  }
}

// Files in other units, elsewhere. What is computed differs by rounding alone.
TEST_F(ExampleTopology, RestExamplesMayBeMovedAndScaled) {
  const ShapeStage expected = align();
  for (const double scale : {1e-3, 39.37}) {
    for (const auto& [name, pose] : {std::pair{"rest.msh", 0}, {"twist.msh", 1}}) {
      TetMesh mesh = box_mesh(bar_.example_cells, bar_.lengths);
      if (pose == 1) mesh.vertices = twisted(mesh.vertices, bar_);
      meshes_[name] = moved(mesh, scale, Eigen::Matrix3d::Identity());
    }
    const ShapeStage stage = align();
    EXPECT_LE(difference(stage, expected), 1e-9) << scale;
    EXPECT_NEAR(stage.groups.front().examples.examples[1].scale,
                expected.groups.front().examples.examples[1].scale / scale, 1e-9 / scale);
  }
}

// A turned bar could stand in four ways; landmarks say which.
TEST_F(ExampleTopology, RestExamplesMayBeTurnedWhereLandmarksTellHow) {
  const ShapeStage expected = align();
  TetMesh mesh = box_mesh(bar_.example_cells, bar_.lengths);
  meshes_["rest.msh"] = moved(mesh, 2, turn_);
  mesh.vertices = twisted(mesh.vertices, bar_);
  meshes_["twist.msh"] = moved(mesh, 2, turn_);
  const ShapeStage guessed = align();
  EXPECT_EQ(guessed.alignments[0].verdict, AlignmentVerdict::kRefused);
  EXPECT_THAT(guessed.alignments[0].message, HasSubstr("3 other rotations of its symmetric body fit as well"));
  write_corner_landmarks(bar_.example_cells);
  const ShapeStage told = align({{"landmarks", "marks.txt"}});
  EXPECT_EQ(told.alignments[0].verdict, AlignmentVerdict::kGood);
  EXPECT_LE(difference(told, expected), 1e-9);
  EXPECT_LE((told.groups.front().examples.examples[0].rotation - turn_.transpose()).norm(), 1e-9);
}

TEST_F(ExampleTopology, MotionOfAPoseDoesNotMatterWithEightLandmarks) {
  write_corner_landmarks(kPoseCells);
  pose_on();
  const Json alignment{{"method", "landmarks"}, {"landmarks", "marks.txt"}, {"frame", "free"}};
  const ShapeStage expected = align(alignment);
  EXPECT_EQ(expected.alignments[1].verdict, AlignmentVerdict::kGood);
  meshes_["twist.msh"] = moved(meshes_["twist.msh"], 0.01, turn_);
  const ShapeStage stage = align(alignment);
  EXPECT_LE(difference(stage, expected), 1e-6);
}

// The large pairs are in the alignment benchmark.
TEST_F(ExampleTopology, PosesMayBeMuchFinerThanTheObject) {
  const ShapeStage own = align();
  pose_on({26, 8, 7});  // 1,944 vertices, the object has 300
  const ShapeStage finer = align();
  EXPECT_EQ(finer.groups.front().examples.examples[1].method, "registered");
  EXPECT_EQ(finer.alignments[1].verdict, AlignmentVerdict::kGood);
  EXPECT_LE(difference(finer, own), 0.08);
}

}  // namespace
}  // namespace exmat::test
