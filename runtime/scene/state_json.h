#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "runtime/scene/scene_loader.h"

namespace exmat::runtime {

// One body of a state file, schemas/state.json.

/// Numbers as an array, and back from one of three.
std::vector<double> array_of(const auto& numbers) { return {numbers.begin(), numbers.end()}; }
Eigen::Vector3d vector_of(const nlohmann::json& numbers);

nlohmann::ordered_json state_to_json(const State& state, const BodyFrame& frame);

/// Puts `state`, one of the same model and scene, into that of `body` at `place` of the file, which follows the schema.
/// Throws InputError where it does not fit the scene.
void read_body_state(const std::filesystem::path& file, const std::string& place, const nlohmann::json& body,
                     const LoadedScene& loaded, State& state);

}  // namespace exmat::runtime
