// What a method costs on a capture, before it is trained.
#pragma once

#include "train/method.h"

namespace tessera {

// Returns the costs of a method on a capture that training divides into blocks with default settings; those of one
// block if it has no training photos. `gpuBytes`: as in BlockRunOptions. The photos are not read.
MethodCosts costsOnCapture(const Method& method, const Capture& capture, uint64_t gpuBytes);

}  // namespace tessera
