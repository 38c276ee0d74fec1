// The pinhole cameras in which the triangles of a view are rasterised. A rasteriser projects straight lines to straight
// lines, which lenses with distortion do not: for them, each pixel looks up what a raster of smaller pixels shows in
// its direction.
#pragma once

#include <vector>

#include "render/pixel_directions.h"

namespace tessera {

struct RasterView {
  Mat3d rasterFromCamera = Mat3d::Identity();
  double focalX = 1, focalY = 1, centreX = 0, centreY = 0;  // pixels
  uint32_t width = 1, height = 1;
  // At least this much of the distance of a point that the raster shows is along its axis.
  double smallestCosine = 1;
};

struct RasterViews {
  std::vector<RasterView> views;  // their pixels together show all directions of the camera's pixels
  bool isSamePixels = false;      // there is one view, whose pixels are the camera's
};

// Of the camera with these directions. One view if they are at most about 70° off the axis, otherwise the sides of a
// cube that are seen. `largestEdge`: the largest number of pixels of a raster along an edge.
RasterViews makeRasterViews(const PixelDirections& directions, uint32_t largestEdge);

}  // namespace tessera
