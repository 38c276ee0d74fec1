#include "base/memory.h"

#include <unistd.h>

#include <algorithm>
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

bool restartPeakResidentBytes() {
  constexpr const char* kHighWaterMark = "5";  // proc(5)
  std::ofstream marks("/proc/self/clear_refs");
  marks << kHighWaterMark << std::flush;
  return marks.good();
}

int64_t controlGroupLimit(const fs::path& groups, const fs::path& membership) {
  int64_t lowest = 0;
  const auto consider = [&](const fs::path& file) {
    int64_t limit = 0;  // the file contains "max" where there is no limit
    if (std::ifstream(file) >> limit && limit > 0 && (lowest == 0 || limit < lowest)) lowest = limit;
  };
  // Of a container, the path may be one outside of it; then only the root is there.
  const auto considerAll = [&](const fs::path& root, fs::path group, const char* file) {
    for (group = group.relative_path(); !group.empty(); group = group.parent_path()) consider(root / group / file);
    consider(root / file);
  };
  constexpr const char* kFile = "memory.max";                   // version 2: "0::/path"
  constexpr const char* kFormerFile = "memory.limit_in_bytes";  // version 1: "8:memory:/path"
  std::ifstream lines(membership);
  for (std::string line; std::getline(lines, line);) {
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == line.npos || second == line.npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const std::string group = line.substr(second + 1);
    if (controllers == ",,") considerAll(groups, group, kFile);
    if (controllers.find(",memory,") != controllers.npos) considerAll(groups / "memory", group, kFormerFile);
  }
  return lowest;
}

int64_t availableMemoryBytes(const fs::path& meminfo) {
  constexpr const char* kAvailable = "MemAvailable:";
  std::ifstream lines(meminfo);
  std::string name, unit;
  for (int64_t kibibytes = 0; lines >> name >> kibibytes;) {
    if (name == kAvailable && kibibytes > 0) return std::min(1024 * kibibytes, usableMemoryBytes());
    std::getline(lines, unit);
  }
  return usableMemoryBytes();
}

int64_t usableMemoryBytes() {
  const int64_t bytes = static_cast<int64_t>(sysconf(_SC_PHYS_PAGES)) * sysconf(_SC_PAGESIZE);
  const int64_t limit = controlGroupLimit("/sys/fs/cgroup", "/proc/self/cgroup");
  return limit > 0 ? std::min(bytes, limit) : bytes;
}

}  // namespace tessera
