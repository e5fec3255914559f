#pragma once

#include <string>

namespace exmat::precompute {

/// One of a palette that begins anew; negative: the colour of the page's text.
const char* colour_of(int colour);

/// A <text> element; `anchor` is "start", "middle" or "end", `more` further attributes.
std::string text_at(double x, double y, const char* anchor, const std::string& text, const char* more = "");

}  // namespace exmat::precompute
