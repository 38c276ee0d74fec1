// `tessera bake`: a trained `hash` model to a scene of tiles (NGP-RT, section 4.1; the specification's section 6).
#pragma once

#include <functional>
#include <memory>

#include "bake/baker.h"
#include "representations/hash/content/hash_content.h"
#include "representations/hash/train/hash_model.h"
#include "scene/capture.h"

namespace tessera {

struct HashBakeSettings {
  int dilation = 1;  // cells around those that are seen are kept, too
  // Of a finest block's occupancy along an edge, a multiple of 8, and half as many for each coarser level; 0: at each
  // level three times as many as its lattice has corners, up to 384 or as many as those.
  uint32_t cells = 0;
};

struct BakeHashOptions : BakeOptions, HashBakeSettings {};

// Gives the model of a level, the finest (0) first. One is held at a time.
using HashLevelModels = std::function<std::unique_ptr<HashModel>(uint32_t level)>;

// Of models of all levels.
std::unique_ptr<Baker> makeHashBaker(HashLevelModels models, uint32_t levels, const HashBakeSettings& settings);

// bakeScene of that: writes the scene folder; tileset.json last. A function of models, capture and options. Throws
// Error when a file cannot be written, and as below.
BakedScene bakeHash(const HashLevelModels& models, uint32_t levels, const Capture& capture, const fs::path& scene,
                    const BakeHashOptions& options);

// The steps of it. Throws Error for a model that scenes cannot hold: that mixes levels by a network for each sample, or
// whose steps are out of bounds.
void requireBakeable(const HashModel& model);
// Which cells of each block hold anything that a training photo sees through pixels that no mask
// leaves out, dilated: [blocks]. Of a surround of its own also what is seen beside the photos. Throws Error when a mask
// cannot be read.
std::vector<OccupancyBits> findSeenCells(HashModel& model, const Capture& capture, const BakeHashOptions& options);
// A block's features as bytes: of the lattice's corners around seen cells, of the tables' entries all that a sample
// there may read.
HashPart bakeHashPart(HashModel& model, uint32_t block, const OccupancyBits& seen);
// What is drawn together: blocks of a level, or the surround alone. `seen` by block.
HashContent bakeHashGroup(HashModel& model, const std::vector<uint32_t>& blocks,
                          const std::vector<OccupancyBits>& seen);

}  // namespace tessera
