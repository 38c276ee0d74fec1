// The instruction set that drawing on the CPU uses.
#pragma once

namespace tessera {

// As Highway names it: "AVX3".
const char* renderSimdTarget();

}  // namespace tessera
