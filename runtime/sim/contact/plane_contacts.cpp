#include "runtime/sim/contact/plane_contacts.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <numeric>

namespace exmat::runtime {
namespace {

constexpr std::size_t kAtOnce = 6;  // panels whose products stay in the first-level cache

void write(const Eigen::Vector3d& vector, std::size_t lane, double (*numbers)[kLanes]) {
  for (int i = 0; i < 3; ++i) numbers[i][lane] = vector[i];
}

Eigen::Vector3d read(const double (*numbers)[kLanes], std::size_t lane) {
  return {numbers[0][lane], numbers[1][lane], numbers[2][lane]};
}

/// As kernels take a pose.
std::array<double, 12> numbers_of(const Placement& placement) {
  std::array<double, 12> numbers;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data()) = placement.rotation;
  Eigen::Map<Eigen::Vector3d>(numbers.data() + 9) = placement.position;
  return numbers;
}

/// Those kLanes for each number, one after the other.
template <std::ptrdiff_t count>
struct LaneSums {
  double operator[](std::ptrdiff_t number) const {
    const double* const from = lanes.data() + number * kLanes;
    return std::accumulate(from, from + kLanes, 0.0);
  }
  Eigen::Vector3d vector(std::ptrdiff_t first) const {
    return {(*this)[first], (*this)[first + 1], (*this)[first + 2]};
  }
  alignas(kAlignment) std::array<double, static_cast<std::size_t>(count* kLanes)> lanes{};
};

/// clearance_of() a panel's candidates at the first evaluation, the least.
double least_clearance(const PlaneContactPanel& panel) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t l = 0; l < kLanes; ++l) {
    if (panel.stiffness[l] == 0) continue;
    if (panel.normal_force[l] > 0 || panel.friction[l] > 0) return -1;
    const double depth = -panel.gap[l] - panel.damping[l] * (panel.gap[l] - panel.distance[l]);
    least = std::min({least, panel.gap[l], -panel.share[l] * depth});
  }
  return least;
}

/// An evaluation of vertices that are too far away to be looked at.
void leave_untouched(PlaneContactPanel& panel) {
  for (auto* const numbers : {panel.force[0], panel.force[1], panel.force[2], panel.normal_force, panel.gap})
    std::fill_n(numbers, kLanes, 0.0);
}

}  // namespace

void PlaneContacts::set(std::size_t number, const Eigen::Vector3d& rest, double distance, double friction,
                        const ContactCandidate& candidate) noexcept {
  PlaneContactPanel& own = panel(number);
  const std::size_t l = lane(number);
  const Eigen::Vector3d stretch = candidate.carried - candidate.anchor;
  write(rest, l, own.rest);
  write(candidate.normal, l, own.normal);
  write(candidate.carried, l, own.start);
  write(stretch - candidate.normal.dot(stretch) * candidate.normal, l, own.stretch);
  own.distance[l] = distance;
  own.stiffness[l] = candidate.stiffness;
  own.damping[l] = candidate.damping;
  own.share[l] = candidate.spring_share;
  own.friction[l] = candidate.friction_force;
  coefficients_[number] = friction;
  vertices_[number] = candidate.vertex;
}

void PlaneContacts::end(std::size_t candidates) noexcept {
  count_ = (candidates + kLanes - 1) / kLanes;
  std::fill_n(clearances_.begin(), count_, -1.0);
  for (std::size_t unused = candidates; unused < count_ * kLanes; ++unused) {
    panel(unused).stiffness[lane(unused)] = panel(unused).friction[lane(unused)] = 0;
    coefficients_[unused] = 0;
    vertices_[unused] = vertices_[candidates - 1];
  }
}

/// work(panel, where its vertices have been moved to) of those that are to be looked at.
template <class Work>
void PlaneContacts::for_near(const Body& body, double way, Work work) const noexcept {
  std::array<int, kAtOnce * kLanes> vertices;
  std::array<double, 3 * vertices.size()> products;
  std::array<std::size_t, kAtOnce> panels;
  for (std::size_t next = 0; next < count_;) {
    std::size_t some = 0;
    for (; next < count_ && some < kAtOnce; ++next) {
      if (clearances_[next] > way) continue;
      std::copy_n(vertices_.data() + next * kLanes, kLanes, vertices.data() + some * kLanes);
      panels[some++] = next;
    }
    body.rows.products(vertices.data(), static_cast<std::ptrdiff_t>(some) * kLanes, body.q, products.data());
    for (std::size_t i = 0; i < some; ++i) work(panels[i], products.data() + 3 * kLanes * i);
  }
}

PlaneContacts::Sums PlaneContacts::evaluate(const Body& body, double way, bool is_first, AlignedArray& loads) noexcept {
  const auto pose = numbers_of(body.placement);
  LaneSums<kPlaneSums> sums;
  std::array<double, 3 * kLanes> vectors;
  for (std::size_t p = 0; p < count_; ++p) {
    if (clearances_[p] > way) leave_untouched(panels_[p]);
    loaded_[p] = 0;
  }
  for_near(body, way, [&](std::size_t p, const double* products) {
    PlaneContactPanel& own = panels_[p];
    const unsigned lanes = kernels().plane_contacts(own, pose.data(), products, vectors.data(), sums.lanes.data());
    loaded_[p] = static_cast<std::uint8_t>(lanes);
    if (is_first) clearances_[p] = least_clearance(own);
    std::array<int, kLanes> vertices;
    int some = 0;
    for (unsigned left = lanes; left != 0; left &= left - 1, ++some) {
      const auto l = static_cast<std::size_t>(std::countr_zero(left));
      vertices[static_cast<std::size_t>(some)] = vertices_[p * kLanes + l];
      std::copy_n(vectors.data() + 3 * l, 3, vectors.data() + 3 * some);
    }
    kernels().add_vertex_loads(body.rows.data(), body.rows.stride(), vertices.data(), some, vectors.data(),
                               loads.data());
  });
  return {sums.vector(0), sums.vector(3), sums[6], sums[7], static_cast<int>(sums[8])};
}

double PlaneContacts::potential(const Body& body, double way) const noexcept {
  const auto pose = numbers_of(body.placement);
  LaneSums<1> sums;
  for_near(body, way, [&](std::size_t p, const double* products) {
    kernels().plane_potential(panels_[p], pose.data(), products, sums.lanes.data());
  });
  return sums[0];
}

void PlaneContacts::refresh_friction(FrictionChange& change) noexcept {
  for (std::size_t p = 0; p < count_; ++p) {
    if (loaded_[p] == 0) continue;
    for (std::size_t l = 0; l < kLanes; ++l) {
      const double force = coefficients_[p * kLanes + l] * panels_[p].normal_force[l];
      change.add(panels_[p].friction[l], force);
      panels_[p].friction[l] = force;
    }
  }
}

std::ptrdiff_t PlaneContacts::factors(std::size_t panel, const Placement& placement, double* vectors, double* rigid,
                                      int* vertices) const noexcept {
  if (loaded_[panel] == 0) return 0;
  const auto pose = numbers_of(placement);
  const std::ptrdiff_t count = kernels().plane_factors(panels_[panel], pose.data(), vectors, rigid, vertices);
  for (std::ptrdiff_t i = 0; i < count; ++i)
    vertices[i] = vertices_[panel * kLanes + static_cast<std::size_t>(vertices[i])];
  return count;
}

void PlaneContacts::take(std::size_t number, ContactCandidate& candidate) const noexcept {
  const PlaneContactPanel& own = panel(number);
  const std::size_t l = lane(number);
  candidate.arm = read(own.arm, l);
  candidate.force = read(own.force, l);
  candidate.slip = read(own.slip, l);
  candidate.normal_force = own.normal_force[l];
  candidate.friction_force = own.friction[l];
  candidate.gap = own.gap[l];
  candidate.direction = candidate.normal;
  candidate.by_plane = false;
}

}  // namespace exmat::runtime
