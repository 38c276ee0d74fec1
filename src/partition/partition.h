// A capture cut into blocks on the ground (City-on-Web, sections 3.1 and 4.1).
#pragma once

#include <optional>

#include "partition/block_layout.h"
#include "partition/coverage.h"

namespace tessera {

struct PartitionOptions {
  BlockCount blocks;
  std::optional<BlockGrid> grid;  // of these cells, whatever `blocks` and `limits` say
  BlockLimits limits;
  Sufficiency enough;
  DepthOf depthOf;  // optional: where rays end; see coverage.h
};

struct Partition {
  BlockGrid grid;
  Ground ground;
  Region region;
  Heights heights;
  DecidedBy decidedBy = DecidedBy::request;
  std::vector<CellCoverage> coverage;  // one entry a cell
  std::vector<ThinCell> thin;          // to be warned of before training; by cell
  std::vector<std::string> notes;      // for people: how ground, region and blocks were found

  bool isThin(int cell) const;
};

// A function of the capture's training photos, points and geo reference, and of the options, alone. Throws Error when
// the capture has no training photos.
Partition partitionCapture(const Capture& capture, const PartitionOptions& options);

}  // namespace tessera
