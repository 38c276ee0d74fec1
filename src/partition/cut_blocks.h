// The blocks that a model is to be trained in.
#pragma once

#include "base/file.h"
#include "partition/partition.h"

namespace tessera {

// Cuts the capture, draws the map into the model's folder (block_map.h), and says what people should know before hours
// of training.
BlockGrid cutBlocks(const Capture& capture, const fs::path& model, const PartitionOptions& options);

// A run that goes on keeps its blocks. Throws Error, about `path`, when other ones are asked for.
void requireSameBlocks(const fs::path& path, const BlockGrid& has, const BlockCount& count,
                       const std::optional<BlockGrid>& grid);

}  // namespace tessera
