// The scalar device that defines the mathematics.
#pragma once

#include <memory>

#include "compute/device.h"

namespace tessera {

std::unique_ptr<Device> makeReferenceDevice();

}  // namespace tessera
