// The reference device: scalar code in double that defines the results of all operations.
#pragma once

#include <memory>

#include "compute/device.h"

namespace tessera {

std::unique_ptr<Device> makeReferenceDevice();

}  // namespace tessera
