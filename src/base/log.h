// Warnings and informational messages on stderr. The library never prints anywhere else.
#pragma once

#include <fmt/format.h>

#include <string>
#include <vector>

namespace tessera {

void logWarning(const std::string& text);
void logInfo(const std::string& text);

template <class... Args>
void warn(fmt::format_string<Args...> format, Args&&... args) {
  logWarning(fmt::format(format, std::forward<Args>(args)...));
}

template <class... Args>
void inform(fmt::format_string<Args...> format, Args&&... args) {
  logInfo(fmt::format(format, std::forward<Args>(args)...));
}

// Keeps the texts of the first kMaxRecorded warnings that any thread gives while it exists. There is at most one at a
// time.
class WarningRecorder {
 public:
  static constexpr size_t kMaxRecorded = 20;

  WarningRecorder();
  ~WarningRecorder();
  WarningRecorder(const WarningRecorder&) = delete;
  WarningRecorder& operator=(const WarningRecorder&) = delete;

  std::vector<std::string> texts() const;
};

}  // namespace tessera
