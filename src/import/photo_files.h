// Writes a photo, a mask or a depth map into a capture folder, downscaled if requested. A photo or mask that is already
// there, with the right size and not older than its source, is left unchanged: the caller must ensure that it was
// produced from this source (picture_origins.h).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

// `ready`: the target is complete. Otherwise no target was written: a photo ends early (truncated), or the source
// cannot be decoded or, for masks and depth maps, is missing (unreadable). The functions below throw Error if a source
// cannot be read or the target cannot be written.
enum class FileOutcome { ready, truncated, unreadable };

// Imports a photo at width × height. Colours are averaged over area as sRGB values (which training compares with),
// premultiplied where there is alpha. A photo that keeps its size is hard-linked, or copied where the file system does
// not support links; it is decoded nevertheless, because the grey end of a truncated photo would be trained on as if it
// were part of the scene. The extension of `target` selects the format: .png, else JPEG of quality 98.
FileOutcome importPhoto(const fs::path& source, const fs::path& target, int width, int height);
// A downscaled photo of at most this many pixels is stored as PNG, because metrics compare with it; a larger one as
// JPEG.
inline constexpr int64_t kLosslessPixels = int64_t{1} << 21;

// Imports a mask, with one channel of 0 or 255. A pixel is trained on only where all of its source area is white, or,
// if `inverted`, where all of it is black.
FileOutcome importMask(const fs::path& source, const fs::path& target, int width, int height, bool inverted);
// Returns the mask that importMask would write; nothing if the source is missing or cannot be decoded.
std::optional<ImageU8> readMask(const fs::path& source, int width, int height, bool inverted);
// Returns a mask of one channel, 0 or 255: 255 where a colour of the image is bright, or, if `inverted`, where it is
// black.
ImageU8 toMask(const ImageU8& image, bool inverted);
// Whether a mask of one channel, 0 or 255, excludes all pixels.
bool excludesAll(const ImageU8& mask);
// Warns of the photos whose masks exclude all their pixels. Throws Error naming the folder `masks` if these are all
// `count` photos: then the masks are likely to state something else, such as classes 0 and 1.
void warnOfExcluded(const std::vector<std::string>& photos, size_t count, const fs::path& masks);

// Whether the target is there, of that size and not older than its source.
bool isReady(const fs::path& source, const fs::path& target, int width, int height);

struct DepthUnits {
  float unit = 1;    // world units per step of a PNG
  double scale = 1;  // world units per unit of an EXR
};
// Imports a depth map as EXR in world units. Depth is never averaged, because a mean across an edge lies on no surface:
// each pixel takes the source pixel nearest to its centre.
FileOutcome importDepth(const fs::path& source, const fs::path& target, int width, int height, const DepthUnits& units);

}  // namespace tessera
