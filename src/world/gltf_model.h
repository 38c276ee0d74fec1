// Reads models of glTF 2.0, as JSON or GLB. The file is not trusted: assimp's reader is not used because it takes
// memory as the file says, and follows nodes that share children.
// Source: Khronos glTF 2.0 specification; KHR_mesh_quantization, KHR_texture_transform, KHR_materials_unlit,
// KHR_materials_emissive_strength, KHR_materials_transmission.
#pragma once

#include "world/model_assembler.h"

namespace tessera {

// `file`: the model's own file. Adds all that its scene shows to `to`. Throws Error that names the file and the place.
void readGltf(const Bytes& file, ModelAssembler& to, const ModelLimits& limits);

}  // namespace tessera
