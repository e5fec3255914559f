#include "common/core/log.h"

#include <utility>

namespace exmat::log {
namespace {

Sink& sink() {
  static Sink current;
  return current;
}

void send(Level level, std::string_view message) {
  if (sink()) sink()(level, message);
}

}  // namespace

Sink set_sink(Sink new_sink) { return std::exchange(sink(), std::move(new_sink)); }

void debug(std::string_view message) { send(Level::kDebug, message); }
void info(std::string_view message) { send(Level::kInfo, message); }
void warning(std::string_view message) { send(Level::kWarning, message); }
void error(std::string_view message) { send(Level::kError, message); }

}  // namespace exmat::log
