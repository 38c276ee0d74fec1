// Where a grid of blocks stands for those who train blocks: scene units in which half a block's edge is 1.
#pragma once

#include "compute/blocks.h"
#include "scene/block_grid.h"
#include "train/model_folder.h"
#include "train/scene_frame.h"

namespace tessera {

// Scene units of BlockSpace: half a block's edge is 1, the origin amid all blocks at half the scene's height.
SceneFrame sceneFrameOf(const BlockGrid& grid);
BlockSpace blockSpaceOf(const BlockGrid& grid, double near, Surround surround);

// Of the setting `surround`. Throws Error when there is none of that name.
Surround surroundNamed(const std::string& name);

// Throws Error when the manifest of a model's folder does not name one checkpoint a block.
void requireOneFileABlock(const fs::path& folder, const ModelManifest& manifest, uint32_t blocks);
// The blocks that a model was trained in. Throws Error when there are none.
BlockGrid requireGrid(const ModelFolder& folder);

}  // namespace tessera
