// Partitions a capture into blocks on the ground (City-on-Web, sections 3.1 and 4.1).
#pragma once

#include <optional>

#include "partition/block_layout.h"
#include "partition/coverage.h"

namespace tessera {

struct PartitionOptions {
  BlockCount blocks;
  std::optional<BlockGrid> grid;  // if set, this grid is used and `blocks` and `limits` are ignored
  BlockLimits limits;
  CoverageThresholds enough;
  DepthOf findRayDepth;  // optional: the lengths of rays; see coverage.h
};

// What is divided into blocks.
struct Site {
  Ground ground;
  Region region;
  Heights heights;
};

// Finds it by the same data as partitionCapture, which takes longer. The capture must have training photos.
Site findSite(const Capture& capture);

struct Partition : Site {
  BlockGrid grid;
  DecidedBy decidedBy = DecidedBy::request;
  std::vector<CellCoverage> coverage;  // one entry per cell
  std::vector<ThinCell> thin;          // cells to warn about before training, in order of cell
  std::vector<std::string> notes;      // for log messages: how ground, region and blocks were determined

  bool isThin(int cell) const;
};

// Partitions a capture. The result depends only on the capture's training photos, points and geo reference, and on the
// options. Throws Error if the capture has no training photos.
Partition partitionCapture(const Capture& capture, const PartitionOptions& options);

}  // namespace tessera
