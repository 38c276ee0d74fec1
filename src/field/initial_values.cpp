#include "field/initial_values.h"

#include <cmath>

#include "base/random.h"

namespace tessera {

std::vector<float> initialTable(size_t count, uint64_t seed) {
  const RandomStream random(seed, 0x7ab1e);
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = (2 * random.uniform(i) - 1) * 1e-4f;
  return values;
}

std::vector<float> initialWeights(const MlpShape& shape, uint64_t seed, uint64_t stream) {
  const RandomStream random(seed, stream);
  std::vector<float> values(shape.parameters());
  size_t i = 0;
  for (int l = 0; l < shape.layers(); ++l) {
    const size_t end = i + static_cast<size_t>(shape.layerInputs(l)) * shape.layerOutputs(l);
    const float bound = std::sqrt(6.0f / static_cast<float>(shape.layerInputs(l) + shape.layerOutputs(l)));
    for (; i < end; ++i) values[i] = (2 * random.uniform(i) - 1) * bound;
  }
  return values;
}

}  // namespace tessera
