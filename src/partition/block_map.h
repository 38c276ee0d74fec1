// Pictures of a partition for people: blocks.svg and, for maps, blocks.geojson.
#pragma once

#include <string>

#include "base/file.h"
#include "partition/partition.h"

namespace tessera {

// The view from above, the grid's x to the right: cells with their indices, photos and pixels, the bluer the more
// pixels, thin ones hatched; the outline of what the photos show; training cameras as dots, others as circles (stray
// ones are left out); a scale bar; and north, where the Earth is known.
std::string blockMapSvg(const Capture& capture, const Partition& partition);

// Writes `folder`/blocks.svg and, with a geo reference, `folder`/blocks.geojson; whether the second was written. Throws
// Error when a file cannot be written.
bool writeBlockMap(const fs::path& folder, const Capture& capture, const Partition& partition);

}  // namespace tessera
