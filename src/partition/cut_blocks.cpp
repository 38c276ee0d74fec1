#include "partition/cut_blocks.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/log.h"
#include "partition/block_map.h"
#include "scene/block_grid_json.h"

namespace tessera {

BlockGrid cutBlocks(const Capture& capture, const fs::path& model, const PartitionOptions& options) {
  const Partition partition = partitionCapture(capture, options);
  for (const std::string& note : partition.notes) inform("{}", note);
  for (const ThinCell& thin : partition.thin) warn("{}", thin.warning);
  writeBlockMap(model, capture, partition);
  return partition.grid;
}

void requireSameBlocks(const fs::path& path, const BlockGrid& has, const BlockCount& count,
                       const std::optional<BlockGrid>& grid) {
  const auto other = [&](const std::string& flag, const std::string& why) {
    return Error(path.string(), "grid", why, fmt::format("resume without {}, or train into another folder", flag));
  };
  if (grid && blockGridToJson(has) != blockGridToJson(*grid)) {
    throw other("--grid", "the run has other blocks than those of --grid");
  }
  if (!grid && !count.automatic && (count.columns != has.columns || count.rows != has.rows)) {
    throw other("--blocks",
                fmt::format("the run has {}x{} blocks, not {}x{}", has.columns, has.rows, count.columns, count.rows));
  }
}

}  // namespace tessera
