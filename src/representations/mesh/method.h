// The method of this representation, UE4-NeRF.
#pragma once

#include "train/method.h"

namespace tessera {

const Method& meshMethod();

}  // namespace tessera
