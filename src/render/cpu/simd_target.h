// The SIMD instruction set that the CPU renderer uses.
#pragma once

namespace tessera {

// Returns the target's name as Highway spells it, for example "AVX3".
const char* renderSimdTarget();

}  // namespace tessera
