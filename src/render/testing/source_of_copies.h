// For tests: a renderer's source that serves contents from memory.
#pragma once

#include <type_traits>

#include "render/tile_cache.h"
#include "tiles/content.h"

namespace tessera {

// Returns a source of copies of contentAt(tile).
template <class ContentAt>
TileSource<Content> sourceOfCopies(ContentAt contentAt) {
  TileSource<Content> source;
  source.bytes = [contentAt](int tile) { return bytesInMemory(contentAt(tile)); };
  source.load = [contentAt](int tile) { return makeContent(std::decay_t<decltype(contentAt(tile))>(contentAt(tile))); };
  return source;
}

}  // namespace tessera
