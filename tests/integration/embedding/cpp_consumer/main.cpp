// consumer SCENE STEPS VERTEX: steps three bodies of the scene by one and by two threads and prints q of one of them,
// in hexadecimal, then the position of the vertex; then what an error says.
#include <cstdio>
#include <cstdlib>
#include <exmat/exmat.hpp>
#include <string>
#include <utility>
#include <vector>

namespace {

std::vector<double> displacement(const exmat::Model& model, const exmat::Body& body) {
  std::vector<double> q(model.modes());
  body.read_displacement(q);
  return q;
}

exmat::Bodies stepped(const exmat::Model& model, std::int64_t steps, int threads) {
  exmat::Bodies bodies;
  for (int i = 0; i < 3; ++i) {
    exmat::Body body(model);
    body.step(i);  // out of step with the others
    bodies.add(std::move(body));
  }
  bodies.step(steps, threads);
  return bodies;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 3;
  const auto model = exmat::Model::from_scene(argv[1]);
  const std::int64_t steps = std::atoll(argv[2]), vertex = std::atoll(argv[3]);
  exmat::Bodies alone = stepped(model, steps, 1);
  const exmat::Bodies together = stepped(model, steps, 2);
  for (std::size_t i = 0; i < alone.size(); ++i)
    if (displacement(model, alone[i]) != displacement(model, together[i])) return 1;

  std::vector<float> xyz(3), all(3 * model.vertices());
  const auto points = exmat::Points::vertices(model, {&vertex, 1});
  alone[0].read_positions(points, xyz);
  alone[0].read_positions(exmat::Points::all_vertices(model), all);
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (xyz[axis] != all[3 * static_cast<std::size_t>(vertex) + axis]) return 1;
  for (const double value : displacement(model, alone[0])) std::printf("%a ", value);
  std::printf("%a %a %a\n", xyz[0], xyz[1], xyz[2]);

  try {
    alone[0].read_positions(points, all);
    return 1;
  } catch (const exmat::Error& error) {
    std::printf("%d %s\n", static_cast<int>(error.status()), error.what());
  }
  return 0;
}
