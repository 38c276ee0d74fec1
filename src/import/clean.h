// Compares a source capture with the files on disk, and drops photos that cannot be used, with one warning for each
// kind of fault.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/threads.h"
#include "import/exif.h"
#include "import/source.h"

namespace tessera {

struct PhotoFacts {
  int width = 0, height = 0;  // 0: missing or unreadable
  bool isPng = false;         // by its content
  PhotoTags tags;
};

// Keeps photos[order[0]], photos[order[1]], ... in this order, and their observations. Removes unused cameras too.
void keepPhotos(SourceCapture& source, const std::vector<size_t>& order);

// Reads the header of every photo; drops missing, unreadable and repeated photos and those whose aspect ratio differs
// from their camera's; scales the lens of photos whose size differs from their camera's; sorts in natural name order.
// Sets Photo::gps from the photo's tags where the source had none. Returns the facts of the remaining photos, in their
// new order. Throws Error if a disk fails to read a photo that is there.
std::vector<PhotoFacts> cleanSource(SourceCapture& source, ThreadPool& pool);

// Returns the first names and, where there are more, an ellipsis: "a.jpg, b.jpg, c.jpg, ...".
std::string abbreviateList(const std::vector<std::string>& names);

// Warns "12 photos WHAT; dropped (a.jpg, b.jpg, c.jpg, ...)" unless `names` is empty.
void warnDropped(const std::vector<std::string>& names, const std::string& what);

}  // namespace tessera
