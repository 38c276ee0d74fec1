// Which SIMD kernels run. By itself the cpu device takes the best that the machine has; tests take each in turn.
#pragma once

#include <string>
#include <vector>

namespace tessera::cpu {

// The instruction sets that this build has kernels for and this machine can run, best first: "AVX3", "AVX2", "SSE4",
// "SSSE3". The last is what every x86-64-v2 machine has.
std::vector<std::string> simdTargets();

// From now on kernels are those of this target, one of the above, on all cpu devices of the process; with an empty name
// the best. Not while an operation runs.
void useSimdTarget(const std::string& name);

}  // namespace tessera::cpu
