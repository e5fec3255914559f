#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "precompute/study/measure/error_metrics.h"

namespace exmat::precompute {

/// A number, null where it is not finite; read back as infinite.
nlohmann::ordered_json json_number(double value);
double number_from(const nlohmann::ordered_json& json);

/// An error, null where there is none.
nlohmann::ordered_json to_json(const RelativeError& error);
nlohmann::ordered_json to_json(const std::optional<RelativeError>& error);
std::optional<RelativeError> relative_error_from(const nlohmann::ordered_json& json);

}  // namespace exmat::precompute
