// Warnings and informational messages on stderr. The library never prints anywhere else.
#pragma once

#include <fmt/format.h>

#include <string>

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

}  // namespace tessera
