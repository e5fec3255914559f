#pragma once

#include <string>

#include "precompute/study/sweep/study.h"

namespace exmat::precompute {

/// One page, all in itself: plots of error against run time with the front, against r and against s, tables, and the
/// worst frames of some points.
std::string report_html(const StudyResult& result);

/// The point whose error is split: "point 3 (m 20, ...)".
std::string sources_point(const StudyResult& result);

/// The sentence that answers a budget, or says what comes nearest to it; empty without one.
std::string recommendation_text(const StudyResult& result);

}  // namespace exmat::precompute
