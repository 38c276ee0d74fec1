// Where blocks lie on the Earth.
#pragma once

#include <optional>
#include <string>

#include "partition/partition.h"

namespace tessera {

struct PlaceOnEarth {
  double latitude = 0, longitude = 0;  // degrees, WGS 84
  double altitude = 0;                 // metres, as GeoFrame's
};
PlaceOnEarth placeOnEarth(const GeoFrame& frame, const Vec3d& xInWorld);

// A FeatureCollection of one polygon a block, at the height of the ground, with the properties id, column, row, photos,
// pixels, pixels_beyond, edge_metres and thin (RFC 7946). Nothing without a geo reference. Across the antimeridian
// longitudes go on beyond ±180.
std::optional<std::string> blocksAsGeoJson(const Capture& capture, const Partition& partition);

}  // namespace tessera
