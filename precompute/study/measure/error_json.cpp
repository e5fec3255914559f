#include "precompute/study/measure/error_json.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace exmat::precompute {

using Ordered = nlohmann::ordered_json;

Ordered json_number(double value) { return std::isfinite(value) ? Ordered(value) : Ordered(nullptr); }

double number_from(const Ordered& json) {
  return json.is_null() ? std::numeric_limits<double>::infinity() : json.get<double>();
}

Ordered to_json(const RelativeError& error) {
  return {{"mean", json_number(error.mean)},
          {"max", json_number(error.max)},
          {"end", json_number(error.end)},
          {"settled", json_number(error.settled)}};
}

Ordered to_json(const std::optional<RelativeError>& error) { return error ? to_json(*error) : Ordered(nullptr); }

std::optional<RelativeError> relative_error_from(const Ordered& json) {
  if (json.is_null()) return std::nullopt;
  return RelativeError{number_from(json.at("mean")), number_from(json.at("max")), number_from(json.at("end")),
                       number_from(json.at("settled"))};
}

}  // namespace exmat::precompute
