// Steps a scene. Prints as JSON the processor's seconds of each frame, the places of a single body's vertices after
// each, and the mean height of all vertices at the end. exmat.mjs calls it.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exmat/exmat.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <span>
#include <string>
#include <vector>

#include "tests/benchmark/thread_clock.h"

using exmat::benchmarks::thread_seconds;

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fputs("usage: exmat-peers-benchmark SCENE.json FRAMES STEPS_OF_A_FRAME\n", stderr);
    return 2;
  }
  try {
    exmat::World world = exmat::World::from_scene(argv[1]);
    const std::vector<std::int64_t> ids = world.ids();
    const exmat::Points vertices = exmat::Points::all_vertices(world.body(ids.front()).model());
    std::vector<float> xyz(static_cast<std::size_t>(3 * vertices.size()));
    std::vector<std::string> seconds, ways;
    for (int frame = 0; frame < std::atoi(argv[2]); ++frame) {
      const double start = thread_seconds();
      world.step(std::atoi(argv[3]), 1);
      seconds.push_back(fmt::format("{:.9f}", thread_seconds() - start));
      if (ids.size() > 1) continue;
      world.body(ids.front()).read_positions(vertices, std::span(xyz));
      ways.push_back(fmt::format("[{:.7g}]", fmt::join(xyz, ",")));
    }
    double height = 0;
    for (const std::int64_t id : ids) {
      world.body(id).read_positions(vertices, std::span(xyz));
      for (std::size_t i = 2; i < xyz.size(); i += 3) height += static_cast<double>(xyz[i]);
    }
    height /= static_cast<double>(ids.size() * xyz.size() / 3);
    fmt::print(R"({{"seconds": [{}], "ways": [{}], "height": {}}})", fmt::join(seconds, ","), fmt::join(ways, ","),
               height);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
