#include "partition/partition.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"

namespace tessera {
namespace {

BlockLayout givenLayout(const BlockGrid& grid) {
  return {grid, DecidedBy::request,
          fmt::format("{} x {} blocks, {:.4g} wide, as given", grid.columns, grid.rows, grid.edge)};
}

}  // namespace

bool Partition::isThin(int cell) const {
  const auto match = std::lower_bound(thin.begin(), thin.end(), cell,
                                      [](const ThinCell& other, int number) { return other.cell < number; });
  return match != thin.end() && match->cell == cell;
}

Site findSite(const Capture& capture) {
  Site site;
  site.ground = findGround(capture);
  site.region = findRegion(capture, site.ground);
  site.heights = findHeights(capture, site.ground, site.region);
  return site;
}

Partition partitionCapture(const Capture& capture, const PartitionOptions& options) {
  if (capture.photosIn(Split::train).empty()) {
    throw Error(capture.root.string(), "", "has no training photos to cut blocks from",
                "import it again with another --holdout");
  }
  Partition partition;
  static_cast<Site&>(partition) = findSite(capture);
  const BlockLayout layout = options.grid ? givenLayout(*options.grid)
                                          : layOutBlocks(partition.ground, partition.region, partition.heights,
                                                         options.blocks, options.limits);
  partition.grid = layout.grid;
  partition.decidedBy = layout.decidedBy;
  partition.coverage =
      countCoverage(capture, partition.grid, partition.ground, partition.region.looksAtGround, options.findRayDepth);
  partition.thin = thinCells(partition.grid, partition.coverage, options.enough);
  const Rectangle& area = partition.region.rectangle;
  partition.notes = {
      "ground: " + partition.ground.how,
      fmt::format("region: {:.4g} x {:.4g}, from {:.3g} below the ground to {:.3g} above it; {}", area.width,
                  area.depth, -partition.heights.bottom, partition.heights.top, partition.region.how),
      "blocks: " + layout.how};
  return partition;
}

}  // namespace tessera
