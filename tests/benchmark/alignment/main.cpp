// Errors of transferred poses against analytic ones, by method of alignment. Prints the table of docs/alignment.md, and
// renews it where the page is named: alignment_benchmark [PAGE.md]

#include <ctime>
#include <fmt/format.h>
#include <fstream>
#include <iostream>
#include <numbers>
#include <vector>

#include "common/core/error.h"
#include "common/core/timer.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/kd_tree.h"
#include "precompute/cache/stage_cache.h"
#include "precompute/examples/example_alignment.h"
#include "precompute/shape_space/transfer.h"
#include "tests/support/posed_bodies.h"
#include "tests/support/temporary_folder.h"

namespace exmat::benchmarks {
namespace {

using precompute::AlignmentVerdict;
using precompute::ExampleInput;
using precompute::ObjectInput;
using precompute::PoseInput;

constexpr double kLength = 4;
constexpr double kWrong = 0.35;  // above the error of the ideal projection: another pose, not a worse one
const std::string kBegin = "<!-- results: begin -->", kEnd = "<!-- results: end -->";

struct NamedPose {
  std::string name;
  test::Pose pose;
};
const std::vector<NamedPose>& poses() {
  static const std::vector<NamedPose> all{
      {"bend", test::bend(kLength, 1.57)}, {"twist", test::twist(kLength, 1.2)}, {"S", test::s_bend(kLength, 0.8)}};
  return all;
}

// Three tessellations: of the object, of its rest example and of the posed examples, all at rest.
struct Body {
  std::string name;
  TetMesh object, rest, posed;
  std::array<int, 3> object_cells, rest_cells, posed_cells;
};

TetMesh bar(const std::array<int, 3>& cells, double height, std::uint32_t seed) {
  return test::centred(test::shaken_box(cells, {kLength, 1, height}, seed));
}

const std::vector<Body>& bodies() {
  const std::array<int, 3> a{16, 5, 4}, b{14, 4, 4}, c{15, 5, 3}, d{16, 6, 6}, e{13, 5, 5};
  const double radius = 1 / std::sqrt(std::numbers::pi);
  static const std::vector<Body> all{
      {"rectangular bar", bar(a, 0.6, 1), bar(b, 0.6, 2), bar(c, 0.6, 3), a, b, c},
      {"square bar", bar(a, 1, 1), bar(b, 1, 2), bar(c, 1, 3), a, b, c},
      {"cylinder for a square bar", bar(a, 1, 1), test::cylinder_mesh(16, 6, kLength, radius, 2),
       test::cylinder_mesh(13, 5, kLength, radius, 3), a, d, e}};
  return all;
}

// Rectangular bars of other sizes: two large meshes, and meshes of which one is much finer than the other.
const std::vector<Body>& sizes() {
  const auto pair = [](const std::string& name, const std::array<int, 3>& rest, const std::array<int, 3>& posed) {
    return Body{name, bar(rest, 0.6, 1), bar(rest, 0.6, 1), bar(posed, 0.6, 3), rest, rest, posed};
  };
  static const std::vector<Body> all{pair("both large", {42, 12, 8}, {40, 13, 8}),
                                     pair("pose much finer", {20, 6, 3}, {54, 16, 11}),
                                     pair("pose much coarser", {54, 16, 11}, {20, 6, 3})};
  return all;
}

struct Method {
  std::string name;
  AlignmentMethod method = AlignmentMethod::kAuto;
  AlignmentFrame frame = AlignmentFrame::kShared;
  bool same_connectivity = false, landmarks = false, map = false, moved = false;
};
const std::vector<Method>& methods() {
  static const std::vector<Method> all{
      {.name = "same connectivity", .same_connectivity = true},
      {.name = "auto, same frame"},
      {.name = "8 landmarks, unknown frame and scale",
       .method = AlignmentMethod::kLandmarks,
       .frame = AlignmentFrame::kFree,
       .landmarks = true,
       .moved = true},
      {.name = "auto, unknown frame and scale", .frame = AlignmentFrame::kFree, .moved = true},
      {.name = "dense map, same frame", .method = AlignmentMethod::kMap, .map = true},
      {.name = "coupled bases, 8 landmarks, same frame", .method = AlignmentMethod::kCoupled, .landmarks = true}};
  return all;
}

TetMesh moved(TetMesh mesh) {
  const Eigen::AngleAxisd turn(2.0, Eigen::Vector3d(1, 2, 3).normalized());
  mesh.vertices = 37 * mesh.vertices * turn.toRotationMatrix().transpose();
  mesh.vertices.rowwise() += Eigen::RowVector3d(50, -20, 7);
  return mesh;
}

ExampleInput example_input(const Body& body, const Method& method) {
  ExampleInput input;
  input.object_is_rest = false;
  input.rest.name = "rest";
  input.rest.mesh = body.rest;
  input.rest.column = 1;
  const IndexVector nearest = precompute::KdTree(RowMatrix(body.posed.vertices)).nearest(body.object.vertices);
  for (const NamedPose& named : poses()) {
    PoseInput pose;
    pose.name = named.name;
    pose.same_connectivity = method.same_connectivity;
    pose.mesh = test::posed(method.same_connectivity ? body.rest : body.posed, named.pose);
    if (method.moved) pose.mesh = moved(pose.mesh);
    if (method.map) pose.on_object = nearest;
    pose.column = 2 + std::ssize(input.poses);
    input.poses.push_back(std::move(pose));
  }
  if (!method.landmarks) return input;
  const auto object = test::box_corners(body.object_cells), rest = test::box_corners(body.rest_cells),
             posed = test::box_corners(body.posed_cells);
  input.landmarks.resize(8, 5);
  for (Eigen::Index k = 0; k < 8; ++k) {
    const auto at = static_cast<std::size_t>(k);
    input.landmarks.row(k) << object[at], rest[at], posed[at], posed[at], posed[at];
  }
  return input;
}

struct Counts {
  int cases = 0, refused = 0, doubtful = 0, wrong_and_refused = 0, wrong_and_doubtful = 0, silent = 0;
};

struct Errors {
  double ideal = 0, ours = 0;
};

// Relative M-norm against the analytic displacement in the mean axes of the body.
Errors errors(const precompute::LaplaceBasis& basis, const Eigen::MatrixXd& change, const TetMesh& object,
              const test::Pose& pose) {
  const VertexArray posed = precompute::normalised_positions(test::posed(object, pose));
  const auto axes = precompute::procrustes_rotation(basis.vertices.transpose() * (basis.mass * posed));
  const VertexArray exact = posed * axes.transpose() - basis.vertices;
  const VertexArray ideal = basis.eigenfunctions * precompute::coefficients(basis, exact);
  const auto norm = [&](const VertexArray& field) {
    return std::sqrt((field.transpose() * (basis.mass * field)).trace());
  };
  return {norm(ideal - exact) / norm(exact), norm(basis.eigenfunctions * change - exact) / norm(exact)};
}

struct Row {
  std::string ideal, ours;
};

// Registered poses do not depend on m: they are found once and transferred with each.
class Case {
 public:
  Case(const Body& body, const Method& method) : body_(body), method_(method), input_(example_input(body, method)) {
    asset_.name = "benchmark";
    asset_.alignment.method = method.method;
    asset_.alignment.frame = method.frame;
    object_.mesh = body.object;
  }

  Row row(int m, Counts& counts) {
    const auto basis = precompute::laplace_basis(body_.object, m, "object");
    precompute::StageCache no_cache;
    precompute::ExampleAligner aligner(asset_, basis, object_, input_, no_cache);
    const auto rest = aligner.align_rest();
    if (aligned_.empty() || method_.method == AlignmentMethod::kCoupled) {
      aligned_.clear();
      for (const PoseInput& pose : input_.poses) aligned_.push_back(aligner.align_pose(rest, pose));
    }
    Row result;
    for (std::size_t k = 0; k < poses().size(); ++k) add(basis, rest, k, counts, result);
    return result;
  }

 private:
  void add(const precompute::LaplaceBasis& basis, const precompute::AlignedRest& rest, std::size_t k, Counts& counts,
           Row& result) const {
    using precompute::coefficients;
    const auto& pose = aligned_[k];
    const precompute::PoseFrame frame{rest.free_poses, basis.mass};
    const Eigen::MatrixXd at_rest = coefficients(basis, basis.vertices);
    const auto transferred =
        pose.carried ? precompute::transfer_carried(basis, at_rest, rest.carried, *pose.carried, frame)
                     : precompute::transfer_pose(basis, at_rest, rest.map, rest.basis, pose.positions, frame);
    const auto [ideal, ours] = errors(basis, transferred.coefficients - at_rest, body_.object, poses()[k].pose);
    const bool wrong = ours > ideal + kWrong, refused = pose.outcome.verdict == AlignmentVerdict::kRefused,
               doubtful = pose.outcome.verdict == AlignmentVerdict::kDoubtful;
    ++counts.cases;
    counts.refused += refused ? 1 : 0;
    counts.doubtful += doubtful ? 1 : 0;
    counts.wrong_and_refused += wrong && refused ? 1 : 0;
    counts.wrong_and_doubtful += wrong && doubtful ? 1 : 0;
    counts.silent += wrong && pose.outcome.verdict == AlignmentVerdict::kGood ? 1 : 0;
    const char* separator = k == 0 ? "" : " / ";
    result.ideal += fmt::format("{}{:.2f}", separator, ideal);
    result.ours += refused ? fmt::format("{}refused ({:.2f})", separator, ours)
                           : fmt::format("{}{:.2f}{}", separator, ours, doubtful ? "?" : "");
  }

  const Body& body_;
  const Method& method_;
  ExampleInput input_;
  AssetConfig asset_;
  ObjectInput object_;
  std::vector<precompute::AlignedPose> aligned_;
};

std::string table() {
  std::string text = "| body | method | m = 6: bend / twist / S | m = 10 | m = 20 |\n| --- | --- | --- | --- | --- |\n";
  Counts counts;
  for (const Body& body : bodies())
    for (const Method& method : methods()) {
      const Timer timer;
      Case alignment(body, method);
      std::string ideal, ours;
      for (const int m : {6, 10, 20}) {
        const Row result = alignment.row(m, counts);
        ideal += " " + result.ideal + " |";
        ours += " " + result.ours + " |";
      }
      if (&method == &methods().front()) text += fmt::format("| {} | ideal projection |{}\n", body.name, ideal);
      text += fmt::format("| {} | {} |{}\n", body.name, method.name, ours);
      fmt::print(stderr, "{}, {}: {} ({:.1f} s)\n", body.name, method.name, ours, timer.seconds());
    }
  text += fmt::format(
      "\n{} cases: {} refused (of these {} wrong by more than {} over the ideal projection), {} taken with a "
      "warning\n({} wrong), the rest taken as good: {} wrong.\n",
      counts.cases, counts.refused, counts.wrong_and_refused, kWrong, counts.doubtful, counts.wrong_and_doubtful,
      counts.silent);
  return text;
}

std::string sizes_table() {
  std::string text =
      "\n| pair of meshes | vertices: rest example / pose | CPU seconds a pose | m = 20: bend / twist / S | ideal |\n"
      "| --- | --- | --- | --- | --- |\n";
  Counts counts;
  for (const Body& body : sizes()) {
    Case alignment(body, {.name = "auto, same frame"});
    const std::clock_t begin = std::clock();
    const Row row = alignment.row(20, counts);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    text += fmt::format("| {} | {} / {} | {:.1f} | {} | {} |\n", body.name, body.rest.vertex_count(),
                        body.posed.vertex_count(), seconds / static_cast<double>(poses().size()), row.ours, row.ideal);
  }
  return text;
}

int run(int argc, char** argv) {
  const std::string results = table() + sizes_table();
  std::cout << results;
  if (argc < 2) return 0;
  const std::string page = test::read_file(argv[1]);
  const auto begin = page.find(kBegin), end = page.find(kEnd);
  if (begin == std::string::npos || end == std::string::npos)
    throw WorkError(std::string(argv[1]) + ": no place for the results");
  test::write_file(argv[1], page.substr(0, begin + kBegin.size()) + "\n" + results + page.substr(end));
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
