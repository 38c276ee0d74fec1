// The memory that this process uses, from /proc, and the memory that it may use.
#pragma once

#include <cstdint>

#include "base/file.h"

namespace tessera {

// Return the largest and the current resident size of the process in bytes; 0 without /proc.
int64_t peakResidentBytes();
int64_t residentBytes();

// From now on, peakResidentBytes() tells of what follows. Returns false, with no effect, where the kernel forbids it.
bool restartPeakResidentBytes();

// Returns the machine's memory in bytes, or the limit of a control group (a container, a service, a batch job) where
// that is lower.
int64_t usableMemoryBytes();

// Returns what other programs on the machine leave of it at the moment; all of it if `meminfo` (proc(5)) does not tell.
int64_t availableMemoryBytes(const fs::path& meminfo = "/proc/meminfo");

// Returns the lowest limit in bytes of a process's control group and of those around it, or 0 if none has one.
// `groups`: where they are mounted; `membership`: the process's /proc/PID/cgroup.
int64_t controlGroupLimit(const fs::path& groups, const fs::path& membership);

}  // namespace tessera
