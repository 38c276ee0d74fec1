// Geographic positions of blocks.
#pragma once

#include <optional>
#include <string>

#include "partition/partition.h"

namespace tessera {

struct PlaceOnEarth {
  double latitude = 0, longitude = 0;  // degrees, WGS 84
  double altitude = 0;                 // metres, with the same reference as GeoFrame::altitude
};
// Returns the geographic position of a point of the world.
PlaceOnEarth placeOnEarth(const GeoFrame& frame, const Vec3d& xInWorld);

// Returns a GeoJSON FeatureCollection (RFC 7946) with one polygon per block, at the height of the ground, with the
// properties id, column, row, photos, pixels, pixels_beyond, edge_metres and thin; nothing if the capture has no geo
// reference. Across the antimeridian longitudes continue beyond ±180.
std::optional<std::string> blocksAsGeoJson(const Capture& capture, const Partition& partition);

}  // namespace tessera
