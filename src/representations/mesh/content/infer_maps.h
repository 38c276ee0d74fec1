// Infers the maps of a part, the textures of its features and opacities, from the encoder of its block.
#pragma once

#include "compute/device.h"
#include "representations/mesh/content/mesh_encoder.h"
#include "tiles/bc4.h"

namespace tessera {

struct PatchSet;

// Sets the textures of a part that has a PatchEncoder (`encoder`: that which it names). On the CPU the result depends
// on neither the number of threads nor the other parts. While it runs, it takes four times the memory of the encoder
// and 16 MiB.
void inferMaps(PatchSet& set, const MeshEncoder& encoder, Device& device, Bc4Effort effort = Bc4Effort::fast);

}  // namespace tessera
