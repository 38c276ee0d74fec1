// Places a grid of blocks in scene units for training: half the edge of a block is 1.
#pragma once

#include "compute/blocks.h"
#include "scene/block_grid.h"
#include "train/model_folder.h"
#include "train/scene_frame.h"

namespace tessera {

// Returns the frame of the scene units of BlockSpace: half the edge of a block is 1, and the origin is the centre of
// all blocks at half the scene's height.
SceneFrame makeSceneFrame(const BlockGrid& grid);
// Returns the grid in these scene units. `near`: scene units.
BlockSpace makeBlockSpace(const BlockGrid& grid, double near, BackgroundBlockMode backgroundBlock);

// Returns the value of the setting `background_block`. Throws Error if no value has that name.
BackgroundBlockMode parseBackgroundBlockMode(const std::string& name);

// Throws Error if the manifest of the model in `folder` does not name one checkpoint per block.
void requireOneFileABlock(const fs::path& folder, const ModelManifest& manifest, uint32_t blocks);
// Returns the blocks that a model was trained in. Throws Error if it was not trained in blocks.
BlockGrid requireGrid(const ModelFolder& folder);

}  // namespace tessera
