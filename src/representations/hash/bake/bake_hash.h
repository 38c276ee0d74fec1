// `tessera bake`: converts a trained `hash` model to a scene of tiles (NGP-RT, section 4.1).
#pragma once

#include <functional>
#include <memory>

#include "bake/baker.h"
#include "representations/hash/content/hash_content.h"
#include "representations/hash/train/hash_model.h"
#include "scene/capture.h"

namespace tessera {

struct HashBakeSettings {
  int dilation = 1;  // number of layers of cells around the visible ones that are kept as well
  // Cells along an edge of a finest block's occupancy, a multiple of 8; halved for each coarser level. With 0, each
  // level has three times as many cells as its lattice has corners, but at most 384, or as many as corners if these are
  // more.
  uint32_t cells = 0;
};

struct BakeHashOptions : BakeOptions, HashBakeSettings {};

// Returns the model of a level; 0 is the finest. Called in the order of levels; one model is in memory at a time.
using HashLevelModels = std::function<std::unique_ptr<HashModel>(uint32_t level)>;

// Returns the baker for the models of all levels.
std::unique_ptr<Baker> makeHashBaker(HashLevelModels models, uint32_t levels, const HashBakeSettings& settings);

// Bakes the models with that baker by bakeScene: writes the scene folder, tileset.json last. The result depends on the
// models, the capture and the options only. Throws Error if a file cannot be written, and as the functions below do.
BakedScene bakeHash(const HashLevelModels& models, uint32_t levels, const Capture& capture, const fs::path& scene,
                    const BakeHashOptions& options);

// The steps of baking follow. Throws Error if scenes cannot represent the model: because it mixes levels by a network
// for each sample, or because its step length is out of bounds.
void requireBakeable(const HashModel& model);
// Returns for each block, [blocks], the cells with content that is visible through unmasked pixels of the training
// photos, dilated. For a separate background block, these include cells that are visible in a margin around the photos.
// Throws Error if a mask cannot be read.
std::vector<OccupancyBits> findSeenCells(HashModel& model, const Capture& capture, const BakeHashOptions& options);
// Quantises a block's features to bytes: those of the lattice corners around visible cells, and of all table entries
// that a sample in a visible cell may read.
HashPart bakeHashPart(HashModel& model, uint32_t block, const OccupancyBits& seen);
// Bakes one content: several blocks of a level, or the background block alone. `seen` is indexed by block.
HashContent bakeHashGroup(HashModel& model, const std::vector<uint32_t>& blocks,
                          const std::vector<OccupancyBits>& seen);

}  // namespace tessera
