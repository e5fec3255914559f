#include "runtime/sim/contact/body_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "runtime/sim/contact/moving_surface.h"
#include "tests/runtime/sim/world/fork.h"
#include "tests/runtime/sim/world/touching_blocks.h"

namespace exmat::runtime {
namespace body_contact_test {

using test::Blocks;

constexpr double kTimeStep = 1e-3;

/// Two overlapping blocks, the vertices of the first against the surface of the second.
struct Overlap {
  explicit Overlap(double friction) : contact({1e6, 1e2, friction}) {
    start_a.position = Eigen::Vector3d(0, 0, 0);
    start_b.position = Eigen::Vector3d(0.05, 0.03, 0.18);
    start_b.rotation = Eigen::AngleAxisd(0.2, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    qa = 0.02 * Eigen::VectorXd::Random(blocks.model->modes());
    qb = 0.02 * Eigen::VectorXd::Random(blocks.model->modes());
    va = vb = Eigen::VectorXd::Random(blocks.model->modes());
    SurfaceShape shape = blocks.surface->surface.make_shape();
    blocks.surface->surface.place(qb, shape);
    const TouchingBody a{
        *blocks.model->contact, *blocks.surface, {start_a, qa}, {FrameVelocity{{0, 0, 1}, {0, 1, 0}}, va}};
    const TouchingBody b{*blocks.model->contact,
                         *blocks.surface,
                         {start_b, qb},
                         {FrameVelocity{{1, 0, 0}, Eigen::Vector3d::Zero()}, vb}};
    NearVertices near;
    contact.gather(a, b, {kTimeStep, 0.01, true, {}, shape, near}, candidates);
  }

  /// W after the rigid unknowns (translation, rotation about the position) and q of either changed.
  double potential(const Eigen::VectorXd& da, const Eigen::VectorXd& db) {
    const auto moved = [](const Placement& placement, const Eigen::VectorXd& d) {
      Placement result = placement;
      result.position += d.head<3>();
      const Eigen::Vector3d turn = d.segment<3>(3);
      if (turn.norm() > 0)
        result.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * placement.rotation;
      return result;
    };
    const Eigen::VectorXd qa_moved = qa + da.tail(qa.size()), qb_moved = qb + db.tail(qb.size());
    const BodyPose pose_a{moved(start_a, da), qa_moved}, pose_b{moved(start_b, db), qb_moved};
    const ContactSet& set = *blocks.model->contact;
    return contact.potential(ReducedSide{set, pose_a}, ReducedSide{set, pose_b}, 0, candidates);
  }

  Blocks blocks{kTimeStep};
  BodyContact contact;
  Placement start_a, start_b;
  Eigen::VectorXd qa, qb, va, vb;
  BodyCandidates candidates;
};

TEST(BodyContact, ForcesAreThoseOfThePotentialAndEqualAndOpposite) {
  Overlap overlap(0.5);
  const Eigen::Index modes = overlap.qa.size();
  ContactSums a, b;
  const auto evaluate = [&] {
    a.set_zero(modes);
    b.set_zero(modes);
    const ContactSet& set = *overlap.blocks.model->contact;
    const BodyPose pose_a{overlap.start_a, overlap.qa}, pose_b{overlap.start_b, overlap.qb};
    overlap.contact.evaluate(ReducedSide{set, pose_a}, ReducedSide{set, pose_b}, 0, overlap.candidates, a, b);
  };
  evaluate();
  FrictionChange change;
  overlap.contact.refresh_friction(overlap.candidates, change);
  // Slip, so that friction acts.
  overlap.start_a.position += Eigen::Vector3d(3e-4, -2e-4, 0);
  evaluate();
  ASSERT_GT(a.touching, 3);
  EXPECT_NEAR((a.force + b.force).norm(), 0, 1e-12 * a.force.norm());
  EXPECT_NEAR(a.potential, overlap.potential(Eigen::VectorXd::Zero(6 + modes), Eigen::VectorXd::Zero(6 + modes)),
              1e-12 * a.potential);
  Eigen::VectorXd force_a(6 + modes), force_b(6 + modes);
  force_a << a.force, a.torque, a.generalised;
  force_b << b.force, b.torque, b.generalised;
  const double h = 1e-7, scale = force_a.norm();
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(6 + modes);
  for (Eigen::Index i = 0; i < 6 + modes; ++i) {
    const Eigen::VectorXd d = h * Eigen::VectorXd::Unit(6 + modes, i);
    // Central differences of a potential of 1e2 J with steps of 1e-7: 1e-7 of rounding beside h^2.
    EXPECT_NEAR(-(overlap.potential(d, none) - overlap.potential(-d, none)) / (2 * h), force_a[i], 1e-5 * scale) << i;
    EXPECT_NEAR(-(overlap.potential(none, d) - overlap.potential(none, -d)) / (2 * h), force_b[i], 1e-5 * scale) << i;
  }
}

TEST(BodyContact, StiffnessIsTheDerivativeOfTheForces) {
  Overlap overlap(0);
  const Eigen::Index modes = overlap.qa.size();
  const auto force_of_b = [&](const Eigen::VectorXd& qa) {
    ContactSums a, b;
    a.set_zero(modes);
    b.set_zero(modes);
    const ContactSet& set = *overlap.blocks.model->contact;
    const BodyPose pose_a{overlap.start_a, qa}, pose_b{overlap.start_b, overlap.qb};
    overlap.contact.evaluate(ReducedSide{set, pose_a}, ReducedSide{set, pose_b}, 0, overlap.candidates, a, b);
    Eigen::VectorXd force(6 + modes);
    force << b.force, b.torque, b.generalised;
    return force;
  };
  force_of_b(overlap.qa);
  Eigen::MatrixXd columns_a, columns_b;
  const ContactSet& set = *overlap.blocks.model->contact;
  const BodyPose pose_a{overlap.start_a, overlap.qa}, pose_b{overlap.start_b, overlap.qb};
  const Eigen::Index used = BodyContact::stiffness_columns(ReducedSide{set, pose_a, 6}, ReducedSide{set, pose_b, 6},
                                                           overlap.candidates, columns_a, columns_b);
  ASSERT_GT(used, 3);
  // -d f_b / d q_a = -columns_b columns_a^T: linear but where contacts begin or end.
  const Eigen::MatrixXd expected = columns_b.leftCols(used) * columns_a.leftCols(used).transpose();
  const double h = 1e-6;
  for (Eigen::Index i = 0; i < modes; ++i) {
    const Eigen::VectorXd d = h * Eigen::VectorXd::Unit(modes, i);
    const Eigen::VectorXd slope = (force_of_b(overlap.qa + d) - force_of_b(overlap.qa - d)) / (2 * h);
    EXPECT_NEAR((slope - expected.col(6 + i)).norm(), 0, 1e-6 * expected.norm()) << i;
  }
}

TEST(BodyContact, FindsWhatIsNearAndWhatWasInside) {
  Overlap overlap(0);
  for (const BodyCandidate& candidate : overlap.candidates.all) EXPECT_LE(candidate.normal.norm(), 1 + 1e-12);
  const std::size_t all = overlap.candidates.all.size();
  // Without a past nothing deeper than the margin is looked for; with it, what was inside is found again.
  SurfaceShape shape = overlap.blocks.surface->surface.make_shape();
  overlap.blocks.surface->surface.place(overlap.qb, shape);
  const TouchingBody a{*overlap.blocks.model->contact,
                       *overlap.blocks.surface,
                       {overlap.start_a, overlap.qa},
                       {FrameVelocity{}, overlap.va}};
  const TouchingBody b{*overlap.blocks.model->contact,
                       *overlap.blocks.surface,
                       {overlap.start_b, overlap.qb},
                       {FrameVelocity{}, overlap.vb}};
  ContactSums sums;
  sums.set_zero(overlap.qa.size());
  overlap.contact.evaluate(ReducedSide{a.set, a.pose}, ReducedSide{b.set, b.pose}, 0, overlap.candidates, sums, sums);
  std::vector<HeldBodyContact> held;
  overlap.contact.commit(a.pose, b.pose, overlap.candidates, held);
  BodyCandidates closest, again;
  NearVertices near;
  overlap.contact.gather(a, b, {1e-3, 1e-6, false, {}, shape, near}, closest);
  overlap.contact.gather(a, b, {1e-3, 0.01, false, held, shape, near}, again);
  EXPECT_LT(closest.all.size(), all);
  EXPECT_EQ(again.all.size(), all);
}

// Surfaces that fold or cross themselves do not tell inside from outside: what is suddenly deep has not come in.
TEST(BodyContact, WhatIsDeepWithoutHavingComeInDoesNotPush) {
  Overlap overlap(0);
  SurfaceShape shape = overlap.blocks.surface->surface.make_shape();
  overlap.blocks.surface->surface.place(overlap.qb, shape);
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(overlap.qa.size());
  const auto gather = [&](double speed, bool anew) {
    const TouchingBody a{*overlap.blocks.model->contact,
                         *overlap.blocks.surface,
                         {overlap.start_a, overlap.qa},
                         {FrameVelocity{{0, 0, speed}, Eigen::Vector3d::Zero()}, still}};
    const TouchingBody b{*overlap.blocks.model->contact,
                         *overlap.blocks.surface,
                         {overlap.start_b, overlap.qb},
                         {FrameVelocity{}, still}};
    BodyCandidates found;
    NearVertices near;
    overlap.contact.gather(a, b, {kTimeStep, 0.1, anew, {}, shape, near}, found);
    ContactSums sums;
    sums.set_zero(overlap.qa.size());
    overlap.contact.evaluate(ReducedSide{a.set, a.pose}, ReducedSide{b.set, b.pose}, 0, found, sums, sums);
    return found;
  };
  const auto deeper_than = [](const BodyCandidates& found, double depth) {
    return std::ranges::count_if(found.all, [=](const BodyCandidate& one) { return -one.gap > depth; });
  };
  const double radius = overlap.blocks.surface->surface.bound(overlap.qb).radius;
  const BodyCandidates anew = gather(0, /*anew=*/true);
  for (const double speed : {0.0, 2.0}) {
    SCOPED_TRACE(speed);
    // Two steps of the way, or a hundredth of the radius.
    const double deepest = std::max(2 * kTimeStep * speed, 0.01 * radius);
    const BodyCandidates found = gather(speed, /*anew=*/false);
    EXPECT_EQ(deeper_than(found, 1.001 * deepest), 0);
    EXPECT_EQ(std::ssize(found.all), std::ssize(anew.all) - deeper_than(anew, deepest));
    EXPECT_GT(deeper_than(anew, 1.001 * deepest), 0);
  }
}

TEST(BodyContact, WhatEarlierStepsFoundChangesNoCandidate) {
  // One block wanders over and into another while both deform; each gathering is compared with the distances of all
  // vertices and with a gathering that knows of none before it.
  const Overlap overlap(0.3);
  const BodySurface& surface = overlap.blocks.surface->surface;
  const ContactSet& set = *overlap.blocks.model->contact;
  constexpr double kMargin = 2e-2;  // [m]
  constexpr int kSteps = 2000;
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(overlap.qa.size());
  SurfaceShape shape = surface.make_shape();
  NearVertices kept;
  int searches = 0, served = 0, most = 0;
  for (int step = 0; step < kSteps; ++step) {
    const double t = step / static_cast<double>(kSteps);
    Placement place_a = overlap.start_a;
    const Placement& place_b = overlap.start_b;
    place_a.position += Eigen::Vector3d(0.3 * std::sin(7 * t), 0.2 * t, 0.05 * std::cos(9 * t) - 0.06);
    place_a.rotation = Eigen::AngleAxisd(2 * t, Eigen::Vector3d(1, -1, 2).normalized()).toRotationMatrix();
    const Eigen::VectorXd qa = (1 + t) * overlap.qa, qb = std::cos(5 * t) * overlap.qb;
    const TouchingBody a{set, *overlap.blocks.surface, {place_a, qa}, {FrameVelocity{}, still}};
    const TouchingBody b{set, *overlap.blocks.surface, {place_b, qb}, {FrameVelocity{}, still}};
    surface.place(qb, shape);
    BodyCandidates with, without;
    const double before = kept.radius;
    const Placement from = kept.a_in_b;
    NearVertices none;
    overlap.contact.gather(a, b, {1e-3, kMargin, false, {}, shape, kept}, with);
    overlap.contact.gather(a, b, {1e-3, kMargin, false, {}, shape, none}, without);
    if (before < 0 || from.position != kept.a_in_b.position) ++searches;
    if (kept.radius >= 0 && kept.served > 1) ++served;
    const double deepest = 0.01 * surface.bound(qb).radius;  // that may have come in, at rest
    std::vector<int> brute;
    for (int vertex = 0; vertex < set.vertices(); ++vertex) {
      const Eigen::Vector3d point =
          place_b.rotation.transpose() * (place_a.position + set.world_arm(vertex, a.pose) - place_b.position);
      const auto hit = surface.nearest(point, 10, shape);
      if (hit && hit->distance <= kMargin && -hit->distance <= deepest) brute.push_back(vertex);
    }
    ASSERT_EQ(with.all.size(), brute.size()) << step;
    ASSERT_EQ(with.all.size(), without.all.size()) << step;
    for (std::size_t i = 0; i < brute.size(); ++i) {
      EXPECT_EQ(with.all[i].vertex, brute[i]) << step;
      EXPECT_EQ(with.all[i].normal, without.all[i].normal) << step;
      EXPECT_EQ(with.all[i].rest, without.all[i].rest) << step;
    }
    most = std::max(most, static_cast<int>(brute.size()));
  }
  EXPECT_GT(most, 3);
  EXPECT_LT(searches, kSteps / 2);
  EXPECT_GT(served, kSteps / 2);
}

// A body that moves fast against itself looks only at what velocities may bring near. Prongs that have closed to
// less than half of their distance at rest: who is near after the step on its way is a candidate.
TEST(BodyContact, WhatMovesFastAgainstItselfFindsWhatComesNear) {
  const test::Fork fork(1e-3, /*free=*/false, /*meets_itself=*/true);
  const TouchingSurface& touching = *fork.blocks.surface;
  const ContactSet& set = *fork.blocks.model->contact;
  const BodyContact contact({1e6, 1e2, 0.3});
  constexpr double kMargin = 1e-4, kStep = 1e-3;  // [m], [s]
  SurfaceShape shape = touching.surface.make_shape();
  int near_after = 0, few = 0;
  for (const double speed : {5.0, 20.0, 60.0})
    for (double gap = 0.004; gap < 0.036; gap += 0.002) {
      const State state = fork.closed_to(gap, speed).state;
      ASSERT_GT(4 * kStep * set.tree().movement().of(state.v), 10 * kMargin);
      const TouchingBody body{set, touching, {Placement(), state.q}, {FrameVelocity{}, state.v}};
      touching.surface.place(state.q, shape);
      BodyCandidates candidates;
      NearVertices near;
      contact.gather_own(body, {kStep, kMargin, false, {}, shape, near}, candidates);
      std::vector<bool> found(static_cast<std::size_t>(set.vertices()));
      for (const BodyCandidate& candidate : candidates.all) found[static_cast<std::size_t>(candidate.vertex)] = true;
      const double step = std::min(kStep, 0.5 * gap / speed);  // none is inside yet
      const Eigen::VectorXd after = state.q + step * state.v;
      touching.surface.place(after, shape);
      for (int vertex = 0; vertex < set.vertices(); ++vertex) {
        const auto hit =
            touching.surface.nearest_approached(set.world_arm(vertex, {Placement(), after}), set.rest(vertex),
                                                touching.places[static_cast<std::size_t>(vertex)], 0.6 * gap, shape);
        if (!hit) continue;
        ++near_after;
        EXPECT_TRUE(found[static_cast<std::size_t>(vertex)]) << vertex << " at " << speed << " from " << gap;
      }
      few += candidates.all.size() < static_cast<std::size_t>(set.vertices()) / 2;
    }
  EXPECT_GE(few, 24);
  EXPECT_GT(near_after, 20);
}

// The same of a body with itself: the prongs of a fork close and open, beside a search for every vertex.
TEST(BodyContact, WhatEarlierStepsFoundChangesNoCandidateOfABodyWithItself) {
  const test::Fork fork(1e-3, /*free=*/false, /*meets_itself=*/true);
  const TouchingSurface& touching = *fork.blocks.surface;
  const ContactSet& set = *fork.blocks.model->contact;
  const BodyContact contact({1e6, 1e2, 0.3});
  constexpr double kMargin = 1e-2;  // [m]
  constexpr int kSteps = 3000;
  SurfaceShape shape = touching.surface.make_shape();
  NearVertices kept, kept_moving;
  Eigen::VectorXd searched;
  int searches = 0, served = 0, served_moving = 0;
  std::size_t found = 0;
  MovingSurface moving(set, touching);  // the same fork as one that does not move by its modes, turned and elsewhere
  const RowMatrix& basis = fork.blocks.bar.basis();
  const VertexArray& rest = fork.blocks.bar.model.object->mesh.vertices;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const Placement elsewhere{Eigen::Vector3d::Zero(), {3, 4, 5}, turn};
  const Eigen::VectorXd sway = Eigen::VectorXd::Random(fork.blocks.model->modes());
  for (int step = 0; step < kSteps; ++step) {
    const double t = step / static_cast<double>(kSteps);
    const State state = fork.closed_to(0.042 + 0.038 * std::cos(9 * t), 0).state;
    const Eigen::VectorXd q = state.q + 2e-4 * std::sin(20 * t) * sway;
    const TouchingBody body{set, touching, {Placement(), q}, {FrameVelocity{}, state.v}};
    touching.surface.place(q, shape);
    BodyCandidates with, without;
    NearVertices none;
    contact.gather_own(body, {1e-3, kMargin, false, {}, shape, kept}, with);
    contact.gather_own(body, {1e-3, kMargin, false, {}, shape, none}, without);
    if (searched.size() == 0 || searched != kept.q_a) ++searches;
    searched = kept.q_a;
    if (kept.radius >= 0 && kept.served > 1) ++served;
    std::vector<int> all;
    for (int vertex = 0; vertex < set.vertices(); ++vertex) {
      if (touching.vertex_bounds.row(vertex).dot(q.cwiseAbs()) < 1) continue;
      const auto hit =
          touching.surface.nearest_approached(set.world_arm(vertex, body.pose), set.rest(vertex),
                                              touching.places[static_cast<std::size_t>(vertex)], kMargin, shape);
      if (hit && hit->distance >= 0) all.push_back(vertex);
    }
    ASSERT_EQ(with.all.size(), all.size()) << step;
    ASSERT_EQ(with.all.size(), without.all.size()) << step;
    for (std::size_t i = 0; i < all.size(); ++i) {
      ASSERT_EQ(with.all[i].vertex, all[i]) << step;
      ASSERT_EQ(with.all[i].rest, without.all[i].rest) << step;
    }
    const auto position = [&](int vertex) -> Eigen::Vector3d {
      const Eigen::Vector3d place = rest.row(vertex).transpose() + basis.middleRows<3>(3 * vertex) * q;
      return elsewhere.position + turn * place;
    };
    const FrameVelocity spin{{1, 2, 3}, {4, 5, 6}};
    moving.place(elsewhere, spin, position,
                 [&](int vertex) -> Eigen::Vector3d { return spin.at(position(vertex) - elsewhere.position); });
    BodyCandidates by_vertices;
    contact.gather_own(moving.touching(), {1e-3, kMargin, false, {}, moving.shape(), kept_moving}, by_vertices);
    if (kept_moving.radius >= 0 && kept_moving.served > 1) ++served_moving;
    ASSERT_EQ(by_vertices.all.size(), all.size()) << step;
    for (std::size_t i = 0; i < all.size(); ++i) {
      ASSERT_EQ(by_vertices.all[i].vertex, all[i]) << step;
      ASSERT_LT((by_vertices.all[i].normal - turn * without.all[i].normal).norm(), 1e-9) << step;
    }
    found += all.size();
  }
  EXPECT_GT(found, 500U);
  EXPECT_LT(searches, kSteps / 2);
  EXPECT_GT(served, kSteps / 2);
  EXPECT_GT(served_moving, kSteps / 2);
}

}  // namespace body_contact_test
}  // namespace exmat::runtime
