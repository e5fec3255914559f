// consumer SCENE STEPS VERTEX: steps bodies of the scene by one and by two threads and prints q of one of them,
// in hexadecimal, then the position of the vertex; then what an error says.
#include <cstdio>
#include <cstdlib>
#include <exmat/exmat.hpp>
#include <string>
#include <utility>
#include <vector>

namespace {

std::vector<double> displacement(const exmat::Model& model, const exmat::BodyRef& body) {
  std::vector<double> q(model.modes());
  body.read_displacement(q);
  return q;
}

exmat::World stepped(const exmat::Model& model, std::int64_t steps, int threads) {
  exmat_contact_law law = exmat::default_contact_law();
  law.apart = 1;
  exmat::World world(law);
  for (int i = 0; i < 3; ++i) world.add(exmat::Body(model));
  world.step(steps, threads);
  return world;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 3;
  const auto model = exmat::Model::from_scene(argv[1]);
  const std::int64_t steps = std::atoll(argv[2]), vertex = std::atoll(argv[3]);
  exmat::World alone = stepped(model, steps, 1);
  const exmat::World together = stepped(model, steps, 2);
  for (const std::int64_t id : alone.ids())
    if (displacement(model, alone.body(id)) != displacement(model, together.body(id))) return 1;
  exmat::BodyRef first = alone.body(0);

  std::vector<float> xyz(3), all(3 * model.vertices());
  const auto points = exmat::Points::vertices(model, {&vertex, 1});
  first.read_positions(points, xyz);
  first.read_positions(exmat::Points::all_vertices(model), all);
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (xyz[axis] != all[3 * static_cast<std::size_t>(vertex) + axis]) return 1;
  for (const double value : displacement(model, first)) std::printf("%a ", value);
  std::printf("%a %a %a\n", xyz[0], xyz[1], xyz[2]);

  try {
    first.read_positions(points, all);
    return 1;
  } catch (const exmat::Error& error) {
    std::printf("%d %s\n", static_cast<int>(error.status()), error.what());
  }
  return 0;
}
