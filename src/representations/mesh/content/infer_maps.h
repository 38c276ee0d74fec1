// Infers the maps of parts, the textures of their features and opacities, from the encoder of their block.
#pragma once

#include "compute/device.h"
#include "compute/hash_grid.h"
#include "compute/mlp.h"
#include "representations/mesh/content/mesh_encoder.h"
#include "tiles/bc4.h"

namespace tessera {

struct PatchSet;

class MapInference {
 public:
  // Copies the encoder to the device, in float32: twice the size of its file, and 16 MiB. Keeps a reference to
  // `device`.
  MapInference(Device& device, const MeshEncoder& encoder);

  // Sets the textures of a part that has a PatchEncoder, which names this encoder. On the CPU the result depends on
  // neither the number of threads nor the other parts.
  void infer(PatchSet& set, Bc4Effort effort = Bc4Effort::fast);

 private:
  std::vector<float> evaluate(std::span<const float> positions);

  Device& device_;
  HashGrid grid_;
  MlpShape shape_;
  float opacityOffset_;
  Array<float> table_, weights_, positions_, encodedArray_, features_;
  Matrix<float> encoded_;
};

struct MeshContent;
// Sets the textures of all parts of a content that have a PatchEncoder. `threads`: 0: as many as the machine has.
void inferMapsOnCpu(MeshContent& content, int threads);

}  // namespace tessera
