#include "base/memory.h"

#include <fstream>
#include <string>
#include <string_view>

namespace tessera {
namespace {

int64_t statusBytes(std::string_view key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.compare(0, key.size(), key) == 0) return std::strtoll(line.c_str() + key.size(), nullptr, 10) * 1024;
  }
  return 0;
}

}  // namespace

int64_t peakResidentBytes() {
  return statusBytes("VmHWM:");
}
int64_t residentBytes() {
  return statusBytes("VmRSS:");
}

}  // namespace tessera
