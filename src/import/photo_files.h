// Puts a photo, a mask or a depth map into a capture folder, reduced when asked. A photo or a mask that is there
// already, of the right size and not older than its source, is left alone: that it was made from this source is the
// caller's to know (picture_origins.h).
#pragma once

#include "base/file.h"

namespace tessera {

enum class FileOutcome { ready, truncated, unreadable };

// Colours are averaged over area in sRGB bytes (what training compares with), premultiplied where there is alpha. A
// photo that keeps its size is hard-linked, or copied where the file system cannot; it is decoded all the same, since
// a truncated one would train its grey end as if it were the place. `target`'s extension says the format: .png, or JPEG
// of quality 98.
FileOutcome importPhoto(const fs::path& source, const fs::path& target, int width, int height);
// Up to this many pixels a reduced photo is stored as PNG, because measuring is done against it; above, as JPEG.
inline constexpr int64_t kLosslessPixels = int64_t{1} << 21;

// One channel, 0 or 255. A pixel is trained on only where all of its area is white; `inverted`: where all is black.
FileOutcome importMask(const fs::path& source, const fs::path& target, int width, int height, bool inverted);

struct DepthUnits {
  float unit = 1;    // world units per step of a PNG
  double scale = 1;  // world units per unit of an EXR
};
// Depth is never averaged (a mean across an edge lies on nothing): the sample nearest to each pixel's centre is taken.
// Written as EXR in world units.
FileOutcome importDepth(const fs::path& source, const fs::path& target, int width, int height, const DepthUnits& units);

}  // namespace tessera
