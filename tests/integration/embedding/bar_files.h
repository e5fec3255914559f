#pragma once

#include <string>

#include "common/bundle/bundle.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace exmat::test {

/// A folder with the bundle of a clamped bar of three examples, and scenes of it.
class BarFiles {
 public:
  BarFiles() { write_bundle(bar_.model, bundle()); }

  const Bar& bar() const { return bar_; }
  Eigen::Index vertices() const { return bar_.model.object->mesh.vertex_count(); }
  std::int64_t tip() const { return vertices() - 1; }
  const TemporaryFolder& folder() const { return folder_; }
  std::string bundle() const { return folder_ / "bar.h5"; }

  /// A scene file with these members beside bundle and time step.
  std::string scene(const std::string& members) const {
    return folder_.write("scene.json", "{\"bundle\": \"bar.h5\", \"time_step\": 0.005, " + members + "}");
  }

 private:
  Bar bar_ = make_bar({.examples = 3});
  TemporaryFolder folder_;
};

/// The settings of the tests as members of a scene file.
inline const std::string kDampedExamples =
    "\"gravity\": [0, -9.81, 0], \"integrator\": \"newmark\", \"damping\": {\"mass\": 0.1, \"stiffness\": 0.001}, "
    "\"examples\": {\"stiffness\": 100, \"damping\": 1, \"bias\": 0.5}";

}  // namespace exmat::test
