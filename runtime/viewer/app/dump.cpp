#include "runtime/viewer/app/dump.h"

#include <nlohmann/json.hpp>
#include <vector>

#include "common/core/atomic_file.h"

namespace exmat::viewer {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::vector<double> numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

void dump(const Snapshot& snapshot, const Studio& studio, const PictureSize& picture,
          const std::filesystem::path& file) {
  const Camera& camera = studio.camera();
  OrderedJson json{{"time", snapshot.time},
                   {"steps", snapshot.steps},
                   {"picture", {picture.width, picture.height}},
                   {"camera",
                    {{"position", numbers(camera.position())},
                     {"target", numbers(camera.target())},
                     {"up", numbers(camera.up())},
                     {"field_of_view", camera.field_of_view()}}}};
  for (std::size_t i = 0; i < snapshot.bodies.size(); ++i) {
    const BodySnapshot& body = snapshot.bodies[i];
    json["bodies"].push_back({{"offset", numbers(studio.offsets()[i])},
                              {"reduced", body.q},
                              {"placement", body.placement},
                              {"space", body.positions.empty() ? "reduced" : "full"},
                              {"weights", body.weights},
                              {"contacts", body.contacts.size()}});
    if (!body.positions.empty()) json["bodies"].back()["positions"] = body.positions;
    if (!body.bones.empty()) json["bodies"].back()["bones"] = body.bones;
  }
  json["hands"] = OrderedJson::array();
  for (const GripSnapshot& grip : snapshot.grips)
    json["hands"].push_back({{"body", grip.body},
                             {"point", numbers(grip.point)},
                             {"target", numbers(grip.target)},
                             {"force", numbers(grip.force)}});
  json["pins"] = OrderedJson::array();
  for (const Eigen::Vector3d& pin : snapshot.pins) json["pins"].push_back(numbers(pin));
  const LostWork& lost = studio.lost_work();
  if (lost.hand) json["lost_work"]["hand"] = *lost.hand;
  if (lost.contact) json["lost_work"]["contact"] = *lost.contact;
  json["obstacles"] = OrderedJson::array();
  for (const ObstacleSnapshot& obstacle : snapshot.obstacles)
    json["obstacles"].push_back(
        {{"id", obstacle.id},
         {"position", std::vector<double>(obstacle.motion.position, obstacle.motion.position + 3)}});
  write_file_atomically(file, json.dump(1) + "\n");
}

}  // namespace exmat::viewer
