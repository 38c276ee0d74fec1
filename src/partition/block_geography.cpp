#include "partition/block_geography.h"

#include <Eigen/Dense>
#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

namespace tessera {
namespace {

using nlohmann::ordered_json;

double rounded(double degrees) {
  return std::round(degrees * 1e9) / 1e9;  // a tenth of a millimetre
}

}  // namespace

PlaceOnEarth placeOnEarth(const GeoFrame& frame, const Vec3d& xInWorld) {
  const Vec3d enu = (frame.enuFromWorld * xInWorld.homogeneous()).head<3>();
  const GeographicLib::LocalCartesian local(frame.latitude, frame.longitude, frame.altitude);
  PlaceOnEarth place;
  local.Reverse(enu.x(), enu.y(), enu.z(), place.latitude, place.longitude, place.altitude);
  return place;
}

std::optional<std::string> blocksAsGeoJson(const Capture& capture, const Partition& partition) {
  if (!capture.geo) return std::nullopt;
  const BlockGrid& grid = partition.grid;
  const double groundInGrid = partition.ground.height - partition.ground.up().dot(grid.originInWorld);
  const double metresPerUnit = std::cbrt(capture.geo->enuFromWorld.topLeftCorner<3, 3>().determinant());
  ordered_json features = ordered_json::array();
  for (int cell = 0; cell < grid.cells(); ++cell) {
    ordered_json ring = ordered_json::array();
    for (const Vec2d& corner : {Vec2d(-1, -1), Vec2d(1, -1), Vec2d(1, 1), Vec2d(-1, 1), Vec2d(-1, -1)}) {
      const Vec2d at = grid.centre(cell) + grid.edge / 2 * corner;
      const PlaceOnEarth place = placeOnEarth(*capture.geo, grid.inWorld({at.x(), at.y(), groundInGrid}));
      const double east = std::remainder(place.longitude - capture.geo->longitude, 360.0);
      ring.push_back({rounded(capture.geo->longitude + east), rounded(place.latitude)});
    }
    const CellCoverage& has = partition.coverage[static_cast<size_t>(cell)];
    const bool thin = partition.isThin(cell);
    features.push_back({{"type", "Feature"},
                        {"id", cell},
                        {"geometry", {{"type", "Polygon"}, {"coordinates", ordered_json::array({ring})}}},
                        {"properties",
                         {{"id", cell},
                          {"column", cell % grid.columns},
                          {"row", cell / grid.columns},
                          {"photos", has.photos},
                          {"pixels", has.pixels},
                          {"pixels_beyond", has.pixelsBeyond},
                          {"edge_metres", grid.edge * metresPerUnit},
                          {"thin", thin}}}});
  }
  const ordered_json collection = {{"type", "FeatureCollection"}, {"features", features}};
  return collection.dump(1) + "\n";
}

}  // namespace tessera
