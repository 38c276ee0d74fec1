#include "base/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <mutex>
#include <optional>

#include "base/check.h"

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

std::mutex recordMutex;
std::optional<std::vector<std::string>> recorded;  // nothing: there is no recorder

}  // namespace

void logWarning(const std::string& text) {
  logger().warn("{}", text);
  const std::lock_guard lock(recordMutex);
  if (recorded && recorded->size() < WarningRecorder::kMaxRecorded) recorded->push_back(text);
}
void logInfo(const std::string& text) {
  logger().info("{}", text);
}

WarningRecorder::WarningRecorder() {
  const std::lock_guard lock(recordMutex);
  CHECK(!recorded);
  recorded.emplace();
}
WarningRecorder::~WarningRecorder() {
  const std::lock_guard lock(recordMutex);
  recorded.reset();
}
std::vector<std::string> WarningRecorder::texts() const {
  const std::lock_guard lock(recordMutex);
  return *recorded;
}

}  // namespace tessera
