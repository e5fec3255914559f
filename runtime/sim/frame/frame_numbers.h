#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

namespace exmat::runtime {

// A state as a list of numbers and back; a list of the members, visited in order, serves both.

struct NumberCounter {
  std::size_t count = 0;
  template <typename... Members>
  void operator()(const Members&... members) noexcept {
    count += (size(members) + ...);
  }

 private:
  static std::size_t size(double /*number*/) noexcept { return 1; }
  template <typename Dense>
  static std::size_t size(const Dense& array) noexcept {
    return static_cast<std::size_t>(array.size());
  }
};

/// Writes from `to` on, which is not null.
struct NumberWriter {
  double* to;
  template <typename... Members>
  void operator()(const Members&... members) noexcept {
    (write(members), ...);
  }

 private:
  void write(double number) noexcept { *to++ = number; }
  template <typename Dense>
  void write(const Dense& array) noexcept {
    Eigen::Map<Dense>(to, array.rows(), array.cols()) = array;
    to += array.size();
  }
};

/// There are as many numbers as the members have.
struct NumberReader {
  std::span<const double> numbers;
  template <typename... Members>
  void operator()(Members&... members) noexcept {
    (read(members), ...);
  }

 private:
  void read(double& number) noexcept {
    number = numbers.front();
    numbers = numbers.subspan(1);
  }
  template <typename Dense>
  void read(Dense& array) noexcept {
    const auto count = static_cast<std::size_t>(array.size());
    array = Eigen::Map<const Dense>(numbers.data(), array.rows(), array.cols());
    numbers = numbers.subspan(count);
  }
};

}  // namespace exmat::runtime
