// State hashes of a pack, to be compared with those of other systems (run) and of tests/web/hash.test.mjs:
//   exmat-pack-hash PACK EVERY TIMES [MEMBER=VALUE...] [floor=Z]
// prints the hash after EVERY, 2 EVERY, ... steps. Members are numbers of exmat_settings.
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <exmat/exmat.hpp>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace {

void set(exmat_settings& settings, const std::string& name, double value) {
  const std::map<std::string, double*> numbers{{"time_step", &settings.time_step},
                                               {"gravity_z", &settings.gravity[2]},
                                               {"mass_damping", &settings.mass_damping},
                                               {"stiffness_damping", &settings.stiffness_damping},
                                               {"example_stiffness", &settings.example_stiffness},
                                               {"example_damping", &settings.example_damping},
                                               {"example_bias", &settings.example_bias}};
  const std::map<std::string, std::int32_t*> counts{
      {"use_examples", &settings.use_examples}, {"use_contact", &settings.use_contact}, {"space", &settings.space}};
  if (const auto number = numbers.find(name); number != numbers.end())
    *number->second = value;
  else
    *counts.at(name) = static_cast<std::int32_t>(value);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  std::ifstream stream(argv[1], std::ios::binary);
  const std::string pack((std::istreambuf_iterator<char>(stream)), {});
  exmat_settings settings = exmat::default_settings();
  std::optional<double> floor_height;
  for (int i = 4; i < argc; ++i) {
    const std::string word = argv[i];
    const std::size_t sign = word.find('=');
    const double value = std::atof(word.c_str() + sign + 1);
    if (word.starts_with("floor="))
      floor_height = value;
    else
      set(settings, word.substr(0, sign), value);
  }
  const exmat::Model model = exmat::Model::from_memory(std::as_bytes(std::span(pack)), settings);
  exmat::Body body(model);
  if (floor_height) {
    exmat_obstacle floor = exmat::default_obstacle();
    floor.point[2] = *floor_height;
    floor.stiffness = 1e7;
    floor.damping = 2e4;
    floor.friction = 0.5;
    std::int64_t id = 0;
    exmat::check(exmat_world_add_obstacle(exmat_body_world(body.get()), &floor, &id));
  }
  for (int i = 0; i < std::atoi(argv[3]); ++i) {
    body.step(std::atoi(argv[2]));
    std::uint64_t hash = 0;
    exmat_body* const handle = body.get();
    exmat::check(exmat_bodies_hash(&handle, 1, &hash));
    std::printf("%016" PRIx64 "\n", hash);
  }
}
