// The method `field`, for the table of methods (representations/methods.h).
#pragma once

#include "train/method.h"

namespace tessera {

const Method& fieldMethod();

}  // namespace tessera
