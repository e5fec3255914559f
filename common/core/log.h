#pragma once

#include <functional>
#include <string_view>

namespace exmat::log {

enum class Level { kDebug, kInfo, kWarning, kError };

/// Receives every message. Without one, messages are dropped.
using Sink = std::function<void(Level, std::string_view)>;
/// Returns the former sink. Not thread-safe: set it in main.
Sink set_sink(Sink sink);

void debug(std::string_view message);
void info(std::string_view message);
void warning(std::string_view message);
void error(std::string_view message);

}  // namespace exmat::log
