#include "precompute/targets/element_parts.h"

#include <algorithm>
#include <span>

namespace exmat::precompute {
namespace {

using Chosen = std::span<Eigen::Index>;

class Halving {
 public:
  Halving(const VertexArray& vertices, const Elements& elements, Eigen::Index most, std::vector<ElementPart>& parts)
      : elements_(elements), most_(most), parts_(parts), centres_(VertexArray::Zero(elements.count(), 3)) {
    for (Eigen::Index e = 0; e < centres_.rows(); ++e) {
      const auto own = elements.vertices_of(e);
      for (const std::int32_t vertex : own) centres_.row(e) += vertices.row(vertex) / static_cast<double>(own.size());
    }
  }

  void halve(Chosen chosen) {
    if (std::ssize(chosen) <= most_) return finish(chosen);
    Eigen::RowVector3d low = centres_.row(chosen.front()), high = low;
    for (const Eigen::Index e : chosen) {
      low = low.cwiseMin(centres_.row(e));
      high = high.cwiseMax(centres_.row(e));
    }
    Eigen::Index axis = 0;
    (high - low).maxCoeff(&axis);
    const std::size_t half = chosen.size() / 2;
    std::ranges::nth_element(chosen, chosen.begin() + static_cast<std::ptrdiff_t>(half), [&](auto a, auto b) {
      return centres_(a, axis) != centres_(b, axis) ? centres_(a, axis) < centres_(b, axis) : a < b;
    });
    halve(chosen.first(half));
    halve(chosen.subspan(half));
  }

 private:
  void finish(Chosen chosen) {
    std::ranges::sort(chosen);
    ElementPart& part = parts_.emplace_back();
    part.elements.assign(chosen.begin(), chosen.end());
    for (const Eigen::Index e : chosen) {
      const auto own = elements_.vertices_of(e);
      part.vertices.insert(part.vertices.end(), own.begin(), own.end());
    }
    std::ranges::sort(part.vertices);
    part.vertices.erase(std::unique(part.vertices.begin(), part.vertices.end()), part.vertices.end());
    for (const Eigen::Index e : chosen) {
      for (const std::int32_t vertex : elements_.vertices_of(e)) {
        const auto place = std::ranges::lower_bound(part.vertices, vertex);
        part.places.indices.push_back(static_cast<std::int32_t>(place - part.vertices.begin()));
      }
      part.places.close();
    }
  }

  const Elements& elements_;
  Eigen::Index most_;
  std::vector<ElementPart>& parts_;
  VertexArray centres_;
};

}  // namespace

std::vector<ElementPart> element_parts(const VertexArray& vertices, const Elements& elements,
                                       std::vector<Eigen::Index> chosen, Eigen::Index most) {
  std::vector<ElementPart> parts;
  if (!chosen.empty()) Halving(vertices, elements, most, parts).halve(chosen);
  return parts;
}

}  // namespace exmat::precompute
