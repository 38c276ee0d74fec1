// Chooses the blocks of a model before training.
#pragma once

#include "base/file.h"
#include "partition/partition.h"

namespace tessera {

// Partitions the capture, writes the map into the model's folder (block_map.h), and logs how the blocks were chosen,
// with a warning for every thin cell.
BlockGrid cutBlocks(const Capture& capture, const fs::path& model, const PartitionOptions& options);

// Throws Error naming `path` if the requested blocks differ from `has`: a run that resumes cannot change its blocks.
void requireSameBlocks(const fs::path& path, const BlockGrid& has, const BlockCount& count,
                       const std::optional<BlockGrid>& grid);

}  // namespace tessera
