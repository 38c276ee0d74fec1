// The memory that this process uses, from /proc, and the memory that it may use.
#pragma once

#include <cstdint>

namespace tessera {

// Return the largest and the current resident size of the process in bytes; 0 without /proc.
int64_t peakResidentBytes();
int64_t residentBytes();

// Returns the machine's memory in bytes, or the limit of a control group (a container, a service) where that is lower.
int64_t usableMemoryBytes();

}  // namespace tessera
