// Opens scenes as render sources, without linking any training code.
#pragma once

#include "apps/tessera/render_source.h"

namespace tessera {

// Returns the default budget for a scene's contents: half of the memory in which they lie, the GPU's own or the
// machine's.
uint64_t sceneBudgetBytes(const Device& device);

// Throws Error if the folder holds no scene, if the scene has no such level, or if its coarsest level does not fit into
// memory. Warns if an image was rendered coarser than requested because memory was short.
std::unique_ptr<RenderSource> openScene(const Device& device, const fs::path& folder,
                                        const RenderSourceOptions& options);

}  // namespace tessera
