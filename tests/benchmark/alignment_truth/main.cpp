// Alignments of articulated bodies whose true poses are known. Prints the table of docs/alignment.md, and renews it
// where the page is named: alignment_truth [--seed N] [--every N] [--list FILE.csv] [--page PAGE.md]

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <ctime>
#include <fmt/format.h>
#include <fstream>
#include <iostream>
#include <map>
#include <optional>

#include "common/core/error.h"
#include "common/mesh/farthest_points.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/kd_tree.h"
#include "precompute/cache/stage_cache.h"
#include "precompute/examples/example_alignment.h"
#include "precompute/shape_space/transfer.h"
#include "tests/support/articulated_bodies.h"
#include "tests/support/temporary_folder.h"

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
const std::string kBegin = "<!-- truth: begin -->", kEnd = "<!-- truth: end -->";

// How object, rest example and pose are meshed, and what is told beside them.
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
  bool refused() const { return verdict == AlignmentVerdict::kRefused; }
  double ratio() const { return ours / ideal; }
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

  // Of the object and the pose: points of the object far from each other, and where they are in the pose.
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

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

struct Counts {
  int cases = 0, good = 0, doubtful = 0, refused = 0, right_refused = 0, wrong = 0, wrong_doubtful = 0, silent = 0;
  std::vector<double> ratios, seconds;

  void add(const Outcome& outcome) {
    ++cases;
    const bool doubts = outcome.verdict == AlignmentVerdict::kDoubtful, refuses = outcome.refused();
    good += !doubts && !refuses ? 1 : 0;
    doubtful += doubts ? 1 : 0;
    refused += refuses ? 1 : 0;
    wrong += outcome.wrong() ? 1 : 0;
    right_refused += refuses && !outcome.wrong() ? 1 : 0;
    wrong_doubtful += doubts && outcome.wrong() ? 1 : 0;
    silent += !doubts && !refuses && outcome.wrong() ? 1 : 0;
    if (!refuses) ratios.push_back(outcome.ratio());
    seconds.push_back(outcome.seconds);
  }

  std::string row(const std::string& name) const {
    return fmt::format("| {} | {} | {} | {} ({} wrong) | {} | {} | {:.2f} | {:.1f} |\n", name, cases, good, doubtful,
                       wrong_doubtful, refused, right_refused, median(ratios), median(seconds));
  }
};

// Share of wrong ones by classes of doubt.
std::string classes(const std::vector<Outcome>& outcomes) {
  std::string text = "\n| doubt | cases | wrong |\n| --- | --- | --- |\n";
  const std::vector<double> limits{0, 0.25, 0.5, 0.8, 1.2, 1e9};
  for (std::size_t k = 0; k + 1 < limits.size(); ++k) {
    int cases = 0, wrong = 0;
    for (const Outcome& outcome : outcomes)
      if (outcome.doubt >= limits[k] && outcome.doubt < limits[k + 1]) {
        ++cases;
        wrong += outcome.wrong() ? 1 : 0;
      }
    const std::string name =
        k + 2 < limits.size() ? fmt::format("{} to {}", limits[k], limits[k + 1]) : fmt::format("above {}", limits[k]);
    text += fmt::format("| {} | {} | {} ({:.0f} %) |\n", name, cases, wrong, cases > 0 ? 100.0 * wrong / cases : 0.0);
  }
  double ordered = 0, pairs = 0;
  for (const Outcome& a : outcomes)
    for (const Outcome& b : outcomes)
      if (a.ours - a.ideal > b.ours - b.ideal + 0.1) {
        ++pairs;
        ordered += a.doubt > b.doubt ? 1 : 0;
      }
  return text +
         fmt::format("\nOf two cases whose errors differ by more than 0.1, doubt puts {:.0f} % in their order.\n",
                     pairs > 0 ? 100 * ordered / pairs : 0.0);
}

std::string report(const std::vector<Outcome>& outcomes) {
  std::string text =
      "| meshes | cases | taken as good | with a warning | refused | refused though right | median error | CPU s, "
      "median |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- |\n";
  Counts all;
  std::map<std::string, Counts> by_body;
  for (const Kind& kind : kinds()) {
    Counts counts;
    for (const Outcome& outcome : outcomes)
      if (outcome.kind == kind.name) counts.add(outcome);
    if (counts.cases > 0) text += counts.row(kind.name);
  }
  for (const Outcome& outcome : outcomes) {
    all.add(outcome);
    by_body[outcome.body].add(outcome);
  }
  for (const auto& [body, counts] : by_body) text += counts.row("all of: " + body);
  text += all.row("all");
  text += fmt::format(
      "\n{} cases, {} wrong. Silently wrong: {}. Refused though right: {} ({:.1f} %). Median error {:.2f}.\n",
      all.cases, all.wrong, all.silent, all.right_refused, 100.0 * all.right_refused / std::max(1, all.cases),
      median(all.ratios));
  return text + classes(outcomes);
}

std::string listed(const Outcome& o) {
  std::string message = o.message;
  std::ranges::replace(message, '"', '\'');
  return fmt::format("\"{}\",{},{},{},{:.4f},{:.4f},{:.3f},{:.3f},{:.2f},{},\"{}\"\n", o.kind.substr(0, 60), o.body,
                     o.pose, name_of(o.verdict), o.doubt, o.residual, o.ideal, o.ours, o.seconds,
                     o.wrong() ? "wrong" : "right", message);
}

void renew(const std::string& file, const std::string& results) {
  const std::string page = test::read_file(file);
  const auto begin = page.find(kBegin), end = page.find(kEnd);
  if (begin == std::string::npos || end == std::string::npos) throw WorkError(file + ": no place for the results");
  test::write_file(file, page.substr(0, begin + kBegin.size()) + "\n" + results + page.substr(end));
}

int run(int argc, char** argv) {
  std::uint32_t seed = 0;
  int every = 1, only = -1;
  std::string page, list;
  CLI::App app("Alignments of articulated bodies whose true poses are known");
  app.add_option("--seed", seed, "of meshes and of the strength of poses");
  app.add_option("--every", every, "every Nth case alone");
  app.add_option("--kind", only, "index of one kind alone");
  app.add_option("--page", page, "a page whose table is renewed");
  app.add_option("--list", list, "a file for a line of each case");
  CLI11_PARSE(app, argc, argv);
  std::vector<Outcome> outcomes;
  std::ofstream lines;
  if (!list.empty()) lines.open(list);
  int number = 0;
  for (const Kind& kind : kinds()) {
    if (only >= 0 && &kind != &kinds()[static_cast<std::size_t>(only)]) continue;
    for (std::size_t b = 0; b < kBodies.size(); ++b) {
      // Strong poses and weaker ones by turns.
      const double strength = ((&kind - kinds().data()) + b + seed) % 2 == 0 ? 1.0 : 0.6;
      std::optional<Case> alignment;
      const std::size_t poses = kBodies[b]({}, 1).poses.size();
      for (std::size_t k = 0; k < poses; ++k) {
        if (number++ % every != 0) continue;
        if (!alignment) alignment.emplace(kBodies[b], kind, strength, seed);
        outcomes.push_back(alignment->run(k));
        if (lines) lines << listed(outcomes.back()) << std::flush;
      }
    }
  }
  const std::string results = report(outcomes);
  std::cout << results;
  if (!page.empty()) renew(page, results);
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
