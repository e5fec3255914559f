#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <span>

#include "runtime/api/failures.h"

namespace exmat::runtime {

/// The numbers of a state, from the first on. Throws InvalidArgument where they are not what is asked for.
class StateNumbers {
 public:
  explicit StateNumbers(std::span<const double> numbers) : numbers_(numbers) {}

  std::size_t left() const { return numbers_.size(); }

  std::span<const double> take(std::size_t count) {
    if (count > numbers_.size()) throw InvalidArgument("numbers: they end early: are they of another model or world?");
    const auto taken = numbers_.first(count);
    numbers_ = numbers_.subspan(count);
    return taken;
  }
  double number() { return take(1).front(); }
  Eigen::Vector3d vector() { return Eigen::Vector3d(take(3).data()); }
  void read(Eigen::VectorXd& array) { std::ranges::copy(take(static_cast<std::size_t>(array.size())), array.begin()); }

  bool flag(const char* name) {
    const double found = number();
    if (found != 0 && found != 1)
      throw InvalidArgument(fmt::format("numbers: {} = {:g}: expected 0 or 1", name, found));
    return found == 1;
  }
  /// A whole number below `end`.
  double count(const char* name, double end) {
    const double found = number();
    if (!(found >= 0 && found < end && found == std::floor(found)))
      throw InvalidArgument(fmt::format("numbers: {} = {:g}: expected a whole number below {:g}", name, found, end));
    return found;
  }
  std::size_t count(const char* name, std::size_t end) {
    return static_cast<std::size_t>(count(name, static_cast<double>(end)));
  }

 private:
  std::span<const double> numbers_;
};

}  // namespace exmat::runtime
