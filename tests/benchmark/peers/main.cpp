// Steps a scene and prints the processor's seconds of each frame as JSON. exmat.mjs calls it.
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exmat/exmat.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <vector>

namespace {

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fputs("usage: exmat-peers-benchmark SCENE.json FRAMES STEPS_OF_A_FRAME\n", stderr);
    return 2;
  }
  try {
    exmat::World world = exmat::World::from_scene(argv[1]);
    std::vector<double> seconds(static_cast<std::size_t>(std::atoi(argv[2])));
    for (double& frame : seconds) {
      const double start = processor_seconds();
      world.step(std::atoi(argv[3]), 1);
      frame = processor_seconds() - start;
    }
    fmt::print("[{}]\n", fmt::join(seconds, ", "));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
