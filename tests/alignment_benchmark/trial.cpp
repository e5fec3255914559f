#include <fmt/format.h>
#include <cstring>

#include "common/core/timer.h"
#include "common/mesh/geometry.h"
#include "precompute/alignment/pose_alignment.h"
#include "precompute/shape_space/transfer.h"
#include "tests/support/posed_bodies.h"
using namespace exmat;
using namespace exmat::precompute;
using namespace exmat::test;

int main(int argc, char** argv) {
  const double scale = argc > 1 ? atof(argv[1]) : 1;
  const bool free = argc > 2 && !strcmp(argv[2], "free");
  const bool marks = argc > 3 && !strcmp(argv[3], "marks");
  const double L = 4;
  for (const double h : {0.6, 1.0}) {
    const auto c = [&](double a, double b, double d) { return std::array<int, 3>{int(a * scale), int(b * scale), int(d * scale)}; };
    const TetMesh object = centred(shaken_box(c(16, 5, 4), {L, 1, h}, 1));
    const TetMesh rest = centred(shaken_box(c(14, 4, 4), {L, 1, h}, 2));
    const LaplaceBasis basis = laplace_basis(object, 20, "o");
    Timer t0;
    const AlignedShape shape = aligned_shape(rest, 60, "e0");
    const Symmetry sym = rest_symmetry(shape);
    fmt::print("h {} n {} basis+sym {:.2f} s, {} symmetries, revolution {}\n", h, rest.vertex_count(), t0.seconds(), sym.rotations.size(), sym.of_revolution);
    for (const int which : {0, 1, 2}) {
      const Pose pose = which == 0 ? bend(L, 1.57) : which == 1 ? twist(L, 1.2) : s_bend(L, 0.8);
      TetMesh mesh = posed(centred(shaken_box(c(15, 5, 3), {L, 1, h}, 3)), pose);
      if (free) mesh.vertices = (mesh.vertices * Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix().transpose()).eval();
      Timer t;
      const AlignedShape target = aligned_shape(mesh, 60, "ek");
      const double tb = t.seconds();
      AlignmentHints hints; hints.free_frame = free;
      if (marks) {
        // box corners: vertex indices
        const auto n0 = c(14,4,4), nk = c(15,5,3);
        std::vector<Eigen::Triplet<double>> a, b;
        for (int k = 0; k < 8; ++k) {
          const auto id = [&](const std::array<int,3>& n) { return (((k>>2&1)*n[2]) * (n[1] + 1) + (k>>1&1)*n[1]) * (n[0] + 1) + (k&1)*n[0]; };
          a.emplace_back(k, id(n0), 1); b.emplace_back(k, id(nk), 1);
        }
        hints.correspondences.on_rest.resize(8, rest.vertex_count()); hints.correspondences.on_rest.setFromTriplets(a.begin(), a.end());
        hints.correspondences.on_pose.resize(8, mesh.vertex_count()); hints.correspondences.on_pose.setFromTriplets(b.begin(), b.end());
      }
      const PoseAlignment al = align_pose(shape, sym, target, hints);
      const double ta = t.seconds();
      // transfer
      const RestMap map = rest_map(basis, rest, laplace_basis(rest, 35, "e0"));
      const PoseFrame frame{free, scalar_mass(object)};
      const auto rc = coefficients(basis, basis.vertices);
      const LaplaceBasis rb = laplace_basis(rest, 35, "e0");
      const auto tr = transfer_pose(basis, rc, map, rb, al.positions, frame);
      const VertexArray exact0 = normalised_positions(posed(object, pose));
      const Eigen::Matrix3d axes = procrustes_rotation(basis.vertices.transpose() * (basis.mass * exact0));
      const VertexArray exact = exact0 * axes.transpose() - basis.vertices;
      const VertexArray ideal = basis.eigenfunctions * coefficients(basis, exact);
      const VertexArray ours = basis.eigenfunctions * (tr.coefficients - rc);
      const auto norm = [&](const VertexArray& f) { return std::sqrt((f.transpose() * (basis.mass * f)).trace()); };
      // same connectivity
      const auto tr2 = transfer_pose(basis, rc, map, rb, normalised_positions(posed(rest, pose)), PoseFrame{false, scalar_mass(object)});
      const VertexArray same = basis.eigenfunctions * (tr2.coefficients - rc);
      fmt::print("  {}: ideal {:.3f} same {:.3f} ours {:.3f} | start {} J {:.3f} res {:.4f} inv {:.3f} competing {} ambiguous {} mirrored {} disp {:.3f} | {:.2f} + {:.2f} s\n",
                 which == 0 ? "bend " : which == 1 ? "twist" : "S    ", norm(ideal - exact) / norm(exact), norm(same - exact) / norm(exact), norm(ours - exact) / norm(exact),
                 al.start, al.confidence, al.residual, al.inverted_fraction, al.competing_maps, al.ambiguous, al.mirrored, al.displacement, tb, ta - tb);
      fflush(stdout);
    }
  }
}
