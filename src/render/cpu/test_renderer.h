// For tests: renderers of one representation, and sources of contents that are in memory.
#pragma once

#include "render/cpu/hash_drawer.h"
#include "render/cpu/scene_renderer.h"
#include "render/cpu/volume_drawer.h"

namespace tessera {

class VolumeRenderer final : public SceneRenderer {
 public:
  VolumeRenderer(const TileFrame& frame, TileTree tree, TileSource<Content> source,
                 const SceneRendererSettings& settings)
      : SceneRenderer(makeVolumeDrawer(), frame, std::move(tree), std::move(source), settings) {}
};

class HashRenderer final : public SceneRenderer {
 public:
  HashRenderer(const TileFrame& frame, TileTree tree, TileSource<Content> source, const SceneRendererSettings& settings)
      : SceneRenderer(makeHashDrawer(), frame, std::move(tree), std::move(source), settings) {}
};

// Copies of what contentAt(tile) gives.
template <class ContentAt>
TileSource<Content> sourceOfCopies(ContentAt contentAt) {
  TileSource<Content> source;
  source.bytes = [contentAt](int tile) { return bytesInMemory(contentAt(tile)); };
  source.load = [contentAt](int tile) { return makeContent(std::decay_t<decltype(contentAt(tile))>(contentAt(tile))); };
  return source;
}

}  // namespace tessera
