// Visualisations of a partition: blocks.svg and, for geographic software, blocks.geojson.
#pragma once

#include <string>

#include "base/file.h"
#include "partition/partition.h"

namespace tessera {

// Returns a map of the partition seen from above, with the grid's x to the right: cells with their indices and numbers
// of photos and pixels, in a deeper blue for more pixels, thin cells hatched; the outline of the ground that the photos
// show; training cameras as dots and others as circles (outliers are left out); a scale bar; and north, if the capture
// has a geo reference.
std::string blockMapSvg(const Capture& capture, const Partition& partition);

// Writes `folder`/blocks.svg and, if the capture has a geo reference, `folder`/blocks.geojson. Returns whether the
// latter was written. Throws Error if a file cannot be written.
bool writeBlockMap(const fs::path& folder, const Capture& capture, const Partition& partition);

}  // namespace tessera
