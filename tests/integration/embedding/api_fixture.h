#pragma once

#include <Eigen/Core>
#include <exmat/exmat.hpp>
#include <gtest/gtest.h>
#include <span>

#include "tests/integration/embedding/bar_files.h"

namespace exmat::test {

template <typename Matrix>
auto span_of(Matrix& matrix) {
  return std::span(matrix.data(), static_cast<std::size_t>(matrix.size()));
}

inline Eigen::VectorXd displacement(const BodyRef& body, std::size_t modes) {
  Eigen::VectorXd q(static_cast<Eigen::Index>(modes));
  body.read_displacement(span_of(q));
  return q;
}

inline Eigen::VectorXd velocity(const BodyRef& body, std::size_t modes) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(modes));
  body.read_velocity(span_of(v));
  return v;
}

/// A model of the bar, by settings.
class ApiTest : public ::testing::Test {
 protected:
  /// The settings that kDampedExamples has in a scene file.
  static exmat_settings damped_examples() {
    exmat_settings settings = default_settings();
    settings.time_step = 0.005;
    settings.gravity[1] = -9.81;
    settings.integrator = EXMAT_NEWMARK;
    settings.mass_damping = 0.1;
    settings.stiffness_damping = 0.001;
    settings.use_examples = 1;
    settings.example_stiffness = 100;
    settings.example_damping = 1;
    settings.example_bias = 0.5;
    return settings;
  }

  Model model() const { return Model(files_.bundle(), damped_examples()); }
  /// The same bundle without forces, in steps as long.
  Model plain_model() const {
    exmat_settings settings = default_settings();
    settings.time_step = damped_examples().time_step;
    return Model(files_.bundle(), settings);
  }

  BarFiles files_;
};

}  // namespace exmat::test
