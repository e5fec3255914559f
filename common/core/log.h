#pragma once

#include <functional>
#include <string_view>

namespace exmat::log {

enum class Level { kDebug, kInfo, kWarning, kError };

/// Receives every message; replaces the former sink. Without one, messages are dropped. Not thread-safe: set it in
/// main.
using Sink = std::function<void(Level, std::string_view)>;
void set_sink(Sink sink);

void debug(std::string_view message);
void info(std::string_view message);
void warning(std::string_view message);
void error(std::string_view message);

}  // namespace exmat::log
