// What this process holds in memory, from /proc.
#pragma once

#include <cstdint>

namespace tessera {

int64_t peakResidentBytes();
int64_t residentBytes();

}  // namespace tessera
