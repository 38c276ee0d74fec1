// Finds what moves in photographs: pixels whose colour differs from what other photos show at the same place.
#pragma once

#include <vector>

#include "base/image.h"

namespace tessera {

// A photo beside the picture of a coarse field of the same place. Both images have the same size and 3 channels.
struct ComparedPhoto {
  ImageF difference;  // photo less field, sRGB; see subtractField
  ImageF points;      // the point of a surface that the field shows, scene units; NaN where it shows none
};

// Divides a photo by its gain relative to the field, for each channel the median of the quotients of pixels with a
// point, and subtracts the field. All images: 3 channels, of the same size.
ImageF subtractField(const ImageF& photo, const ImageF& field, const ImageF& points);

struct TransientSettings {
  double voxel = 0.01;  // edge, scene units; twice as long in each octave of the distance from the region [-1,1]³
  // A pixel is transient if its colour deviates by more than both: a difference of sRGB, the mean of the channels, and
  // a multiple of the median deviation of the photos that show the same voxel.
  float leastDeviation = 0.05f;
  float spreads = 5;
  size_t leastPhotos = 5;  // that show the voxel
};

// Returns a mask for each photo, 0 where something transient is seen and 255 elsewhere. The difference between photo
// and field is compared with the median of the same difference in all photos that show a voxel: errors of the field are
// in all of them. The colours of 3×3 pixels are averaged. Of the pixels that deviate, those remain that are connected
// to one whose neighbours mostly deviate, too; they are dilated by one pixel.
std::vector<ImageU8> findTransientPixels(std::vector<ComparedPhoto> photos, const TransientSettings& settings);

}  // namespace tessera
