// Runs a function of a library that does not withstand every input in a copy of this process first.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace tessera {

struct TrialLimits {
  uint64_t bytes = uint64_t{8} << 30;  // that it may take besides what the process has; no limit under sanitizers
  int seconds = 120;                   // of processor time
};

// Calls `attempt` in a copy of this process (fork) and waits for its end; nothing that it does to memory reaches this
// process. `attempt` returns an empty text, or why it failed, and must neither start threads nor wait for others.
// Returns its text (at most 4,000 bytes), or how the copy ended if it crashed or exceeded the limits.
std::string tryInCopy(const std::function<std::string()>& attempt, const TrialLimits& limits = {});

}  // namespace tessera
