// Selection of the SIMD kernels. By default the cpu device uses the best that the machine supports; tests use each of
// them.
#pragma once

#include <string>
#include <vector>

namespace tessera::cpu {

// The instruction sets that this build has kernels for and this machine can run, best first: "AVX3", "AVX2", "SSE4",
// "SSSE3". The last is what every x86-64-v2 machine has.
std::vector<std::string> simdTargets();

// Selects the kernels of all cpu devices of the process: those of the named target, one of simdTargets(), or the best
// for an empty name. Must not be called while an operation runs.
void useSimdTarget(const std::string& name);

}  // namespace tessera::cpu
