#include "compute/device.h"

#include "compute/mlp.h"

namespace tessera {

Array<float> Device::allocateActivations(const MlpShape& shape, size_t samples) {
  return array<float>(samples * shape.activationsPerSample() / (storesActivationsInHalf() ? 2 : 1));
}

void Device::lacks(const OperationId& operation) const {
  const std::string missing = name() + " has no operation " + std::string(operation.name());
  CHECK(missing == "");
}

}  // namespace tessera
