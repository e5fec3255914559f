// Alignments of articulated bodies whose true poses are known: a line of each case, of comma-separated values.
// report.py makes the table of docs/alignment.md of them.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <ctime>
#include <fmt/format.h>
#include <iostream>
#include <optional>

#include "common/mesh/farthest_points.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/kd_tree.h"
#include "precompute/cache/stage_cache.h"
#include "precompute/examples/example_alignment.h"
#include "precompute/shape_space/transfer.h"
#include "tests/support/articulated_bodies.h"

namespace exmat::benchmarks {
namespace {

using precompute::AlignmentVerdict;
using test::BodyPose;
using test::Meshing;
using test::PosableBody;
using test::Proportions;
using test::TetKind;

constexpr double kWrong = 0.35;  // above the error of the ideal projection: another pose, not a worse one
constexpr int kFunctions = 20;

// Meshing of object, rest example and pose, and what is told beside them.
struct Kind {
  std::string name;
  Meshing object{}, rest{}, pose{};  // cells relative to the body's
  bool own_rest = false;             // the object is the rest example
  Proportions rest_proportions{};
  int landmarks = 0;
  bool bad_landmark = false, turned = false;
};

const std::vector<Kind>& kinds() {
  const Meshing smooth{.cell = 1}, finer{.cell = 0.75}, stairs{.cell = 1, .staircase = true},
      fine_stairs{.cell = 0.7, .staircase = true}, bcc{.kind = TetKind::kBodyCentred, .cell = 1},
      noisy{.cell = 1, .noise = 0.15}, bitten{.cell = 0.9, .holes = 3};
  static const std::vector<Kind> all{
      {.name = "smooth surfaces, six tets a cube", .object = smooth, .rest = smooth, .pose = smooth},
      {.name = "body-centred lattice", .object = bcc, .rest = smooth, .pose = bcc},
      {.name = "pose finer", .object = smooth, .rest = smooth, .pose = finer},
      {.name = "staircases, the object is the rest example", .object = stairs, .pose = stairs, .own_rest = true},
      {.name = "staircases of three grids", .object = stairs, .rest = stairs, .pose = stairs},
      {.name = "fine staircases", .object = fine_stairs, .pose = fine_stairs, .own_rest = true},
      {.name = "noise of 15 % of a cell", .object = smooth, .rest = smooth, .pose = noisy},
      {.name = "three bites out of the surface", .object = smooth, .rest = smooth, .pose = bitten},
      {.name = "another body of the kind",
       .object = smooth,
       .rest = smooth,
       .pose = smooth,
       .rest_proportions = {0.93, 1.08}},
      {.name = "staircases, 8 landmarks", .object = stairs, .pose = stairs, .own_rest = true, .landmarks = 8},
      {.name = "one of 8 landmarks elsewhere",
       .object = smooth,
       .rest = smooth,
       .pose = smooth,
       .landmarks = 8,
       .bad_landmark = true},
      {.name = "turned in space, 8 landmarks",
       .object = smooth,
       .rest = smooth,
       .pose = bcc,
       .landmarks = 8,
       .turned = true}};
  return all;
}

using MakeBody = PosableBody (*)(const Proportions&, double);
constexpr std::array<MakeBody, 5> kBodies{test::figure_body, test::animal_body, test::letter_c_body,
                                          test::letter_d_body, test::armed_bar_body};

struct Outcome {
  std::string kind, body, pose, message;
  AlignmentVerdict verdict = AlignmentVerdict::kGood;
  double doubt = 0, residual = 0, ideal = 0, ours = 0, seconds = 0;
  double half_cell = 0;  // over the mean displacement

  // An error below half a cell is the mesh's.
  bool wrong() const { return ours > ideal + kWrong && ours > half_cell; }
};

double mean_length(const precompute::LaplaceBasis& basis, const VertexArray& field) {
  return (basis.mass * Eigen::VectorXd::Ones(basis.mass.cols())).dot(field.rowwise().norm());
}

// Meshes of one body at rest serve all its poses.
class Case {
 public:
  Case(MakeBody make, const Kind& kind, double strength, std::uint32_t seed)
      : kind_(kind), seed_(seed), body_(make({}, strength)), rest_body_(make(kind.rest_proportions, strength)) {
    asset_.name = "truth";
    asset_.alignment.method = AlignmentMethod::kAuto;
    if (kind.turned) asset_.alignment.frame = AlignmentFrame::kFree;
    const auto still = [](const Eigen::Vector3d& x) { return x; };
    object_.mesh = test::meshed(body_, still, scaled(kind.object, body_.cell, 1));
    input_.object_is_rest = kind.own_rest;
    input_.rest.name = "rest";
    input_.rest.mesh = kind.own_rest ? object_.mesh : test::meshed(rest_body_, still, scaled(kind.rest, body_.cell, 2));
    input_.rest.column = kind.own_rest ? -1 : 1;
    basis_ = precompute::laplace_basis(object_.mesh, kFunctions, "object");
  }

  std::size_t poses() const { return body_.poses.size(); }

  Outcome run(std::size_t index) {
    const BodyPose &pose = rest_body_.poses[index], &truth = body_.poses[index];
    const auto seed = static_cast<std::uint32_t>(10 + index);
    precompute::PoseInput input{pose.name, "pose",
                                test::meshed(rest_body_, pose.pose, scaled(kind_.pose, body_.cell, seed)), false};
    input.column = kind_.own_rest ? 1 : 2;
    if (kind_.landmarks > 0) set_landmarks(pose.pose, seed, input.mesh);
    if (kind_.turned) {
      const Eigen::AngleAxisd turn(2.0, Eigen::Vector3d(1, 2, 3).normalized());
      input.mesh.vertices *= turn.toRotationMatrix().transpose();
    }
    input_.poses = {input};
    Outcome outcome{kind_.name, body_.name, pose.name, ""};
    const std::clock_t begin = std::clock();
    precompute::StageCache no_cache;
    precompute::ExampleAligner aligner(asset_, basis_, object_, input_, no_cache);
    const auto rest = aligner.align_rest();
    const auto aligned = aligner.align_pose(rest, input);
    outcome.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    outcome.message = aligned.outcome.message;
    outcome.verdict = std::max(aligned.outcome.verdict, rest.outcome.verdict);
    if (rest.outcome.verdict != AlignmentVerdict::kGood) outcome.message += " [rest: " + rest.outcome.message + "]";
    outcome.doubt = aligned.outcome.doubt;
    outcome.residual = aligned.outcome.residual;
    const Eigen::MatrixXd at_rest = precompute::coefficients(basis_, basis_.vertices);
    const auto transferred = precompute::transfer_pose(basis_, at_rest, rest.map, rest.basis, aligned.positions,
                                                       {rest.free_poses, basis_.mass});
    measure(truth.pose, transferred.coefficients - at_rest, outcome);
    return outcome;
  }

 private:
  Meshing scaled(Meshing meshing, double cell, std::uint32_t seed) const {
    meshing.cell *= cell;
    meshing.seed = 1000 * seed_ + seed;
    return meshing;
  }

  // Sets landmarks: points of the object far from each other, and where they are in the pose.
  void set_landmarks(const test::Pose& pose, std::uint32_t seed, const TetMesh& posed) {
    std::vector<std::int32_t> places;
    for (const auto v : farthest_points(object_.mesh.vertices, kind_.landmarks))
      places.push_back(static_cast<std::int32_t>(v));
    const VertexArray on_object = object_.mesh.vertices(places, Eigen::all);
    const IndexVector on_pose = precompute::KdTree(RowMatrix(posed.vertices)).nearest(test::posed(on_object, pose));
    input_.landmarks.resize(std::ssize(places), kind_.own_rest ? 2 : 3);
    input_.landmarks.setConstant(-1);
    for (Eigen::Index k = 0; k < input_.landmarks.rows(); ++k) {
      input_.landmarks(k, 0) = places[static_cast<std::size_t>(k)];
      input_.landmarks(k, input_.landmarks.cols() - 1) = on_pose[k];
    }
    if (kind_.bad_landmark) input_.landmarks(seed % 8, input_.landmarks.cols() - 1) = on_pose[(seed + 3) % 8];
  }

  void measure(const test::Pose& pose, const Eigen::MatrixXd& change, Outcome& outcome) const {
    VertexArray x = test::posed(object_.mesh, pose).vertices / std::cbrt(basis_.volume);
    const Eigen::RowVector3d centre = (basis_.mass * x).colwise().sum();
    x.rowwise() -= centre;
    const auto axes = precompute::procrustes_rotation(basis_.vertices.transpose() * (basis_.mass * x));
    const VertexArray exact = x * axes.transpose() - basis_.vertices;
    const VertexArray ideal = basis_.eigenfunctions * precompute::coefficients(basis_, exact);
    const double size = mean_length(basis_, exact);
    outcome.half_cell = 0.5 * kind_.pose.cell * body_.cell / std::cbrt(basis_.volume) / size;
    outcome.ideal = mean_length(basis_, ideal - exact) / size;
    outcome.ours = mean_length(basis_, basis_.eigenfunctions * change - exact) / size;
  }

  const Kind& kind_;
  std::uint32_t seed_;
  PosableBody body_, rest_body_;
  AssetConfig asset_;
  precompute::ObjectInput object_;
  precompute::ExampleInput input_;
  precompute::LaplaceBasis basis_;
};

std::string line(const Outcome& o) {
  std::string message = o.message;
  std::ranges::replace(message, '"', '\'');
  return fmt::format("\"{}\",{},{},{},{:.4f},{:.4f},{:.3f},{:.3f},{:.2f},{},\"{}\"\n", o.kind, o.body, o.pose,
                     name_of(o.verdict), o.doubt, o.residual, o.ideal, o.ours, o.seconds, o.wrong() ? "wrong" : "right",
                     message);
}

int run(int argc, char** argv) {
  std::uint32_t seed = 0;
  int every = 1, only = -1;
  CLI::App app("Alignments of articulated bodies whose true poses are known");
  app.add_option("--seed", seed, "of meshes and of the strength of poses");
  app.add_option("--every", every, "every Nth case alone");
  app.add_option("--kind", only, "index of one kind alone");
  CLI11_PARSE(app, argc, argv);
  int number = 0;
  for (const Kind& kind : kinds())
    for (std::size_t b = 0; b < kBodies.size(); ++b) {
      const auto index = &kind - kinds().data();
      // Strong poses and weaker ones by turns.
      const double strength = (index + static_cast<std::int64_t>(b) + seed) % 2 == 0 ? 1.0 : 0.6;
      std::optional<Case> alignment;
      const std::size_t poses = kBodies.at(b)({}, 1).poses.size();
      for (std::size_t k = 0; k < poses; ++k) {
        if ((only >= 0 && index != only) || number++ % every != 0) continue;
        if (!alignment) alignment.emplace(kBodies.at(b), kind, strength, seed);
        std::cout << line(alignment->run(k)) << std::flush;
      }
    }
  return 0;
}

}  // namespace
}  // namespace exmat::benchmarks

int main(int argc, char** argv) {
  try {
    return exmat::benchmarks::run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
