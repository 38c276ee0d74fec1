// What this process holds in memory, from /proc, and what it may.
#pragma once

#include <cstdint>

namespace tessera {

int64_t peakResidentBytes();
int64_t residentBytes();

// The machine's memory, or less where a control group (a container, a service) limits it.
int64_t usableMemoryBytes();

}  // namespace tessera
