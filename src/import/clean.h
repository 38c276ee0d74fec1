// Holds a source capture against what is on disk, and drops what is wrong with one warning of each kind.
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
  PhotoTags tags;
};

// Keeps photos[order[0]], photos[order[1]], ... and their observations; unused cameras go too.
void keepPhotos(SourceCapture& source, const std::vector<size_t>& order);

// Reads the head of every photo; drops missing, unreadable and repeated ones and those whose shape is not their
// camera's; gives photos of another size than their camera's a lens scaled to fit; sorts in natural name order. GPS
// goes into Photo::gps where the source had none. Returns the facts of the photos that are left.
std::vector<PhotoFacts> cleanSource(SourceCapture& source, ThreadPool& pool);

// "a.jpg, b.jpg, c.jpg, ..."
std::string firstOf(const std::vector<std::string>& names);

// "12 photos WHAT; dropped (a.jpg, b.jpg, c.jpg, ...)".
void warnDropped(const std::vector<std::string>& names, const std::string& what);

}  // namespace tessera
