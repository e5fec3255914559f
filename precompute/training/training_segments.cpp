#include "precompute/training/training_segments.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace exmat::precompute {
namespace {

constexpr double kAtRest = 0.6;        // share of the segments that begin at rest
constexpr double kCeased = 0.3;        // share in which a force that ends has done so
constexpr double kPatchRadius = 0.12;  // of L
constexpr double kOwnDurations = 3;    // durations of a segment that the very loads are run for, at most
constexpr double kGap = 0.01;          // of L, between a thrown body and its obstacle
constexpr double kAttitude = 0.25;     // [rad] about each axis, of throws near the attitude given

class SegmentDrawer {
 public:
  SegmentDrawer(const TrainingLoads& loads, const SegmentBody& body, const SegmentOptions& options)
      : loads_(loads), body_(body), options_(options), generator_(options.seed) {}

  std::vector<Chain> chains();

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(generator_); }
  Eigen::Vector3d normal() {
    Eigen::Vector3d v;
    for (double& entry : v) entry = normal_(generator_);
    return v;
  }
  Eigen::Vector3d vary(const Eigen::Vector3d& vector, double low, double high, double spread, bool anywhere) {
    const double size = vector.norm();
    const Eigen::Vector3d along = anywhere ? size * normal().normalized() : vector;
    return uniform(low, high) * along + spread * size * normal();
  }
  Eigen::Quaterniond turn(double angle) {
    const Eigen::Vector3d axis = angle * normal();
    return Eigen::Quaterniond(Eigen::AngleAxisd(axis.norm(), axis.normalized()));
  }
  Segment segment();
  Segment own_segment(double begin, double end) const;
  Chain own_chain();
  void add_patch(Segment& segment);
  enum class Throw { kOwn, kLikeIt, kAnyAttitude };
  bool is_thrown() const { return loads_.obstacle && loads_.velocity.norm() > 0; }
  void throw_at_obstacle(Throw how, Segment& segment);

  const TrainingLoads& loads_;
  const SegmentBody& body_;
  const SegmentOptions& options_;
  std::mt19937_64 generator_;
  std::normal_distribution<double> normal_;
};

void SegmentDrawer::add_patch(Segment& segment) {
  if (body_.surface.empty()) return;
  const Eigen::Index centre =
      body_.surface[std::uniform_int_distribution<std::size_t>(0, body_.surface.size() - 1)(generator_)];
  VertexForceConfig patch;
  for (const Eigen::Index v : body_.surface)
    if ((body_.vertices.row(v) - body_.vertices.row(centre)).norm() <= kPatchRadius * body_.size)
      patch.vertices.push_back(v);
  patch.force = body_.patch_force * uniform(0.3, 1.5) / static_cast<double>(patch.vertices.size()) * normal();
  segment.forces.push_back(std::move(patch));
}

// A plane beside the body, across its way.
void SegmentDrawer::throw_at_obstacle(Throw how, Segment& segment) {
  const double speed = loads_.velocity.norm();
  const Eigen::Vector3d along = loads_.velocity / speed;
  runtime::FrameMotion& motion = segment.motion;
  motion.orientation = loads_.orientation;
  motion.linear_velocity = loads_.velocity;
  motion.angular_velocity = loads_.spin;
  if (how == Throw::kLikeIt) motion.orientation = loads_.orientation * turn(kAttitude);
  if (how == Throw::kAnyAttitude)
    motion.orientation = Eigen::AngleAxisd(uniform(0, 2 * std::numbers::pi), normal().normalized());
  if (how != Throw::kOwn) {
    motion.linear_velocity = uniform(0.5, 1.3) * loads_.velocity + 0.1 * speed * normal();
    motion.angular_velocity = uniform(0.5, 1.3) * loads_.spin + 0.2 * speed / body_.size * normal();
  }
  const Eigen::Matrix3d rotation = motion.orientation.toRotationMatrix();
  double farthest = 0;
  for (const auto& vertex : body_.vertices.rowwise())
    farthest = std::max(farthest, along.dot(rotation * (vertex - body_.centre).transpose()));
  const Eigen::Vector3d point = body_.centre.transpose() + (farthest + kGap * body_.size) * along;
  segment.obstacle = runtime::Obstacle{runtime::Plane{point, -along},
                                       {},
                                       loads_.obstacle->stiffness,
                                       loads_.obstacle->damping,
                                       loads_.obstacle->friction};
}

Segment SegmentDrawer::segment() {
  Segment segment;
  segment.kind = options_.kind;
  segment.duration = options_.duration * uniform(0.7, 1.3);
  segment.gravity = vary(loads_.gravity, 0.5, 1.5, 0.2, loads_.any_gravity);
  for (const VertexForceConfig& force : loads_.forces) {
    const bool ceased = std::isfinite(force.end) && uniform(0, 1) < kCeased;
    const Eigen::Vector3d varied = vary(force.force, 0.4, 1.4, 0.3, loads_.any_direction);
    if (!ceased) segment.forces.push_back({force.vertices, varied});
  }
  const double spread = stiffness_spread(loads_);
  for (const runtime::ExampleSettings& examples : loads_.examples) {
    runtime::ExampleSettings varied = examples;
    varied.stiffness *= std::exp(uniform(-spread, spread));
    varied.damping *= uniform(0.5, 2);
    varied.bias = std::clamp(examples.bias + uniform(-kBiasSpread, kBiasSpread), 0.0, 1.0);
    segment.examples.push_back(varied);
  }
  const int fewest = options_.kind.empty() ? 0 : 1;  // of a kind by itself, which would not act
  if (loads_.patches)
    for (int count = std::uniform_int_distribution<int>(fewest, 2)(generator_); count > 0; --count) add_patch(segment);
  return segment;
}

// The loads as they are between two times, none of which begins or ends there.
Segment SegmentDrawer::own_segment(double begin, double end) const {
  Segment segment;
  segment.duration = end - begin;
  segment.gravity = loads_.gravity;
  segment.examples = loads_.examples;
  const double middle = 0.5 * (begin + end);
  for (const VertexForceConfig& force : loads_.forces)
    if (force.start <= middle && middle < force.end) segment.forces.push_back({force.vertices, force.force});
  return segment;
}

Chain SegmentDrawer::own_chain() {
  const double duration = std::min(loads_.duration, kOwnDurations * options_.duration);
  std::vector<double> times{0, duration};
  for (const VertexForceConfig& force : loads_.forces)
    for (const double time : {force.start, force.end})
      if (time > 0 && time < duration) times.push_back(time);
  std::ranges::sort(times);
  Chain chain;
  for (std::size_t i = 0; i + 1 < times.size(); ++i)
    if (times[i] < times[i + 1]) chain.push_back(own_segment(times[i], times[i + 1]));
  return chain;
}

std::vector<Chain> SegmentDrawer::chains() {
  const bool thrown = is_thrown();
  std::vector<Chain> chains;
  if (options_.own_loads && loads_.duration > 0) {
    chains.push_back(own_chain());
    if (thrown) throw_at_obstacle(Throw::kOwn, chains.back().front());
  }
  const auto own = chains.size();
  const int count = thrown ? options_.segments * 3 / 2 : options_.segments;
  for (int i = 0; i < count; ++i) {
    Segment next = segment();
    const bool at_rest = uniform(0, 1) < kAtRest;
    if (thrown) throw_at_obstacle(i % 2 == 1 ? Throw::kAnyAttitude : Throw::kLikeIt, next);
    if (chains.size() == own || thrown || at_rest) chains.emplace_back();
    chains.back().push_back(std::move(next));
  }
  return chains;
}

}  // namespace

std::vector<Chain> draw_segments(const TrainingLoads& loads, const SegmentBody& body, const SegmentOptions& options) {
  return SegmentDrawer(loads, body, options).chains();
}

}  // namespace exmat::precompute
