#include "base/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

namespace tessera {
namespace {

spdlog::logger& logger() {
  static const std::shared_ptr<spdlog::logger> instance = [] {
    auto console = spdlog::stderr_color_mt("tessera");
    console->set_pattern("%^%l%$: %v");
    return console;
  }();
  return *instance;
}

}  // namespace

void logWarning(const std::string& text) {
  logger().warn("{}", text);
}
void logInfo(const std::string& text) {
  logger().info("{}", text);
}

}  // namespace tessera
