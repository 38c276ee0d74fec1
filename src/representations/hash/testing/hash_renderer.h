// For tests: the CPU renderer for `hash` scenes.
#pragma once

#include "render/cpu/scene_renderer.h"
#include "representations/hash/cpu/hash_drawer.h"

namespace tessera {

class HashRenderer final : public SceneRenderer {
 public:
  HashRenderer(const TileFrame& frame, TileTree tree, TileSource<Content> source, const SceneRendererSettings& settings)
      : SceneRenderer(makeHashDrawer(), frame, std::move(tree), std::move(source), settings) {}
};

}  // namespace tessera
