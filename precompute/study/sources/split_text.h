#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "precompute/study/sources/error_split.h"

namespace exmat::precompute {

// A split as text and JSON; `headline` is "shape" or "position".

/// An <svg> element: the parts stacked, for all of the time and for its last tenth, the total marked on both.
std::string split_svg(const ErrorSplit& split, const std::string& headline);

/// A section of a page: advice, picture, table.
std::string split_html(const ErrorSplit& split, const std::string& point, const std::string& headline);
/// The same without the picture.
std::string split_markdown(const ErrorSplit& split, const std::string& study, const std::string& point,
                           const std::string& headline);

/// A line for each source, the sum and the total. RFC 4180; errors are relative.
std::string split_csv(const ErrorSplit& split);

nlohmann::ordered_json to_json(const ErrorSplit& split);

}  // namespace exmat::precompute
