#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace exmat::runtime {

// A state as a list of numbers and back; a list of the members, visited in order, serves both.

struct NumberWriter {
  std::vector<double> numbers;
  template <typename... Members>
  void operator()(const Members&... members) {
    (write(members), ...);
  }

 private:
  void write(double number) { numbers.push_back(number); }
  template <typename Dense>
  void write(const Dense& array) {
    for (Eigen::Index i = 0; i < array.size(); ++i) numbers.push_back(array.data()[i]);
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
    for (Eigen::Index i = 0; i < array.size(); ++i) read(array.data()[i]);
  }
};

}  // namespace exmat::runtime
